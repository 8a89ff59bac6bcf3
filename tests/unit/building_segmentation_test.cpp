// Cutting a recording: nothing is lost, nothing is used twice, and maps share what joins need.
#include "mapjoin/building/segmentation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <set>

#include "mapjoin/building/local_problem.h"
#include "mapjoin/building/nonlinear.h"
#include "mapjoin/evaluation/simulate.h"
#include "mapjoin/graph/error.h"
#include "tests/support/driven_worlds.h"

namespace mapjoin {
namespace {

using By = SegmentRule::By;
using test::Drive;
using test::drive;
using test::DrivenWorld;
using test::Sensor;

template <int D>
Simulation<D> simulated_in(World kind, int poses) {
  SimulationOptions options = simulation_defaults(kind);
  options.poses = poses;
  return simulate<D>(options);
}

std::vector<SegmentRule> all_rules() {
  return {{By::kPoses, 1},    {By::kPoses, 13},         {By::kMaps, 7}, {By::kMaps, 1000},
          {By::kFeatures, 9}, {By::kUncertainty, 0.15}, {By::kGraph, 8}};
}

template <int D>
void expect_each_once(const RawLog<D>& log, const Segmentation& segments) {
  std::vector<std::int64_t> all;
  for (const auto& map : segments.maps) {
    EXPECT_FALSE(map.empty());
    EXPECT_TRUE(std::is_sorted(map.begin(), map.end()));
    all.insert(all.end(), map.begin(), map.end());
  }
  std::sort(all.begin(), all.end());
  std::vector<std::int64_t> wanted(log.size());
  std::iota(wanted.begin(), wanted.end(), 0);
  EXPECT_EQ(all, wanted);
}

/// Information of all measurements at one estimate, over all variables.
template <int D>
Eigen::MatrixXd information(const RawLog<D>& log, std::span<const std::int64_t> measurements,
                            const Values<D>& at) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(log.variables.scalars(), log.variables.scalars());
  for (const LocalProblem<D>& problem : local_problems(log, measurements)) {
    const Values<D> values = subset(at, std::span<const int>(problem.numbers));
    const Eigen::MatrixXd part = information_at(problem, {}, values).dense();
    for (int i = 0; i < problem.variables.size(); ++i) {
      for (int j = 0; j < problem.variables.size(); ++j) {
        const int a = log.variables.offset(problem.numbers[static_cast<std::size_t>(i)]);
        const int b = log.variables.offset(problem.numbers[static_cast<std::size_t>(j)]);
        const int rows = problem.variables.dim(i);
        const int columns = problem.variables.dim(j);
        out.block(a, b, rows, columns) +=
            part.block(problem.variables.offset(i), problem.variables.offset(j), rows, columns);
      }
    }
  }
  return out;
}

TEST(Segmentation, UsesEachMeasurementOnceByCounting) {
  const auto plane = simulated_in<2>(World::kLandmarks2d, 150);
  const auto space = simulated_in<3>(World::kGrid3d, 150);
  for (const SegmentRule& rule : all_rules()) {
    const RawLog<2> a = raw_log(plane.graph);
    expect_each_once(a, segment(a, rule));
    const RawLog<3> b = raw_log(space.graph);
    expect_each_once(b, segment(b, rule));
    const RawLog<2> bearings = drive({.sensor = Sensor::kBearing}).log;
    expect_each_once(bearings, segment(bearings, rule));
  }
}

TEST(Segmentation, UsesEachMeasurementOnceByInformation) {
  const auto plane = simulated_in<2>(World::kLandmarks2d, 80);
  const RawLog<2> log = raw_log(plane.graph);
  std::vector<std::int64_t> all(log.size());
  std::iota(all.begin(), all.end(), 0);
  const Eigen::MatrixXd wanted = information(log, all, plane.truth);
  EXPECT_LT((wanted * plane.truth.gauge()).cwiseAbs().maxCoeff(),
            1e-9 * wanted.cwiseAbs().maxCoeff());
  for (const SegmentRule& rule : all_rules()) {
    Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(wanted.rows(), wanted.cols());
    for (const auto& map : segment(log, rule).maps) sum += information(log, map, plane.truth);
    EXPECT_LT((sum - wanted).cwiseAbs().maxCoeff(), 1e-12 * wanted.cwiseAbs().maxCoeff());
  }
}

/// Poses of a map, as times.
std::set<std::uint64_t> poses_of(const RawLog<2>& log, const std::vector<std::int64_t>& map) {
  std::set<std::uint64_t> out;
  for (const std::int64_t m : map) {
    const auto [column, row] = log.find(m);
    out.insert(log.variables.key(log.columns[column].from[row]).id);
  }
  return out;
}

TEST(Segmentation, GivesAsManyMapsAsAskedFor) {
  const RawLog<2> log = drive({}).log;  // 120 poses
  for (const int n : {1, 2, 5, 7, 119}) {
    EXPECT_EQ(segment(log, {By::kMaps, static_cast<double>(n)}).maps.size(),
              static_cast<std::size_t>(n));
  }
  EXPECT_EQ(segment(log, {By::kMaps, 5000}).maps.size(), 119U);
}

TEST(Segmentation, NeighboursShareThePoseBetweenThem) {
  const RawLog<2> log = drive({}).log;
  const Segmentation segments = segment(log, {By::kPoses, 10});
  ASSERT_EQ(segments.maps.size(), 12U);
  for (std::size_t k = 1; k < segments.maps.size(); ++k) {
    const auto before = local_problems(log, std::span(segments.maps[k - 1]));
    const auto after = local_problems(log, std::span(segments.maps[k]));
    ASSERT_EQ(before.size(), 1U);
    ASSERT_EQ(after.size(), 1U);
    EXPECT_EQ(before[0].variables.key(before[0].last_pose()),
              after[0].variables.key(after[0].first_pose()));
  }
}

TEST(Segmentation, ALoopClosureBringsTheEarlierPoseAlong) {
  RawLogBuilder<2> builder;
  const Mat<3, 3> I = Mat<3, 3>::Identity();
  for (std::uint64_t i = 0; i < 6; ++i)
    builder.add<RelativeModel<Pose2>>(pose_key(i), pose_key(i + 1), rigid2(1, 0, 0), I);
  builder.add<RelativeModel<Pose2>>(pose_key(0), pose_key(6), rigid2(6, 0, 0), I);
  const RawLog<2> log = std::move(builder).build();
  const Segmentation segments = segment(log, {By::kPoses, 3});
  ASSERT_EQ(segments.maps.size(), 2U);
  const auto last = local_problems(log, std::span(segments.maps[1]));
  ASSERT_EQ(last.size(), 1U);
  EXPECT_TRUE(last[0].variables.find(pose_key(0)).has_value());
  EXPECT_FALSE(last[0].variables.find(pose_key(1)).has_value());
}

TEST(Segmentation, MapsOfFeaturesShareEnoughOfThem) {
  const RawLog<2> log = drive({.beacons = 60, .range = 4.0}).log;
  const Segmentation segments = segment(log, {By::kPoses, 2}, 3);
  ASSERT_GT(segments.maps.size(), 3U);
  std::set<int> before;
  for (std::size_t k = 0; k < segments.maps.size(); ++k) {
    std::set<int> here;
    for (const std::int64_t m : segments.maps[k]) {
      const auto [column, row] = log.find(m);
      const int to = log.columns[column].to[row];
      if (log.variables.key(to).type == Tag("point")) here.insert(to);
    }
    int shared = 0;
    for (const int f : here) shared += before.count(f) > 0 ? 1 : 0;
    if (k > 0) {
      EXPECT_GE(shared, 3) << "map " << k;
    }
    before.insert(here.begin(), here.end());
  }
}

TEST(Segmentation, EndsMapsSoonerWhereOdometryIsWorse) {
  const RawLog<2> log = drive({}).log;
  std::size_t maps = 0;
  for (const double sigma : {2.0, 0.3, 0.1, 0.05}) {
    const std::size_t now = segment(log, {By::kUncertainty, sigma}).maps.size();
    EXPECT_GE(now, maps) << sigma;
    maps = now;
  }
  EXPECT_GT(maps, 10U);
}

TEST(Segmentation, FeaturesRuleCountsFeatures) {
  const RawLog<2> log = drive({}).log;
  const Segmentation segments = segment(log, {By::kFeatures, 12});
  ASSERT_GT(segments.maps.size(), 1U);
  for (std::size_t k = 0; k + 1 < segments.maps.size(); ++k) {
    std::set<int> features, without_last_pose;
    const std::uint64_t last = *poses_of(log, segments.maps[k]).rbegin();
    for (const std::int64_t m : segments.maps[k]) {
      const auto [column, row] = log.find(m);
      const auto& c = log.columns[column];
      if (log.variables.key(c.to[row]).type != Tag("point")) continue;
      features.insert(c.to[row]);
      if (log.variables.key(c.from[row]).id < last) without_last_pose.insert(c.to[row]);
    }
    EXPECT_GE(features.size(), 12U);
    EXPECT_LT(without_last_pose.size(), 12U);
  }
}

TEST(Segmentation, RefusesRulesThatMeanNothing) {
  for (const char* text : {"", "poses", "poses:", "poses:0", "poses:2.5", "poses:-1", "maps:x",
                           "uncertainty:0", "uncertainty:nan", "time:3", "graph:1e400"}) {
    EXPECT_THROW(parse_segment_rule(text), InputError) << text;
  }
  EXPECT_EQ(parse_segment_rule("uncertainty:0.5").amount, 0.5);
  EXPECT_EQ(parse_segment_rule("graph:16").by, By::kGraph);
}

}  // namespace
}  // namespace mapjoin
