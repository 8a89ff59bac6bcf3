// Large local maps: built in parts that are joined, whatever the builder.
#include "mapjoin/building/parts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "mapjoin/building/build.h"
#include "mapjoin/building/simulate_log.h"
#include "mapjoin/building/solve.h"
#include "mapjoin/evaluation/evaluate.h"
#include "mapjoin/evaluation/simulate.h"
#include "mapjoin/frames/exact_gauge.h"
#include "tests/support/driven_worlds.h"

namespace mapjoin {
namespace {

template <int D>
MeasurementGraph<D> large_world(World kind, int poses) {
  SimulationOptions options = simulation_defaults(kind);
  options.poses = poses;
  return simulate<D>(options).graph;
}

template <int D>
std::vector<std::int64_t> all_of(const RawLog<D>& log) {
  std::vector<std::int64_t> out(log.size());
  std::iota(out.begin(), out.end(), 0);
  return out;
}

template <int D>
Segmentation in_one_map(const RawLog<D>& log) {
  return {{all_of(log)}};
}

TEST(Parts, HaveEachMeasurementOnce) {
  const RawLog<2> log = raw_log(large_world<2>(World::kManhattan, 520));
  const auto all = all_of(log);
  const std::vector<LocalProblem<2>> whole = local_problems(log, std::span(all));
  ASSERT_EQ(whole.size(), 1U);
  std::vector<std::int64_t> found;
  for (const LocalProblem<2>& part : parts_of(log, whole[0])) {
    for (const auto& m : part.measurements) found.push_back(m.number);
  }
  std::sort(found.begin(), found.end());
  EXPECT_EQ(found, all);
}

TEST(Parts, FollowEachOtherInTimeAndMeetInAPose) {
  const RawLog<2> log = test::drive({.poses = 290}).log;
  const auto all = all_of(log);
  const auto parts = parts_of(log, local_problems(log, std::span(all)).at(0));
  ASSERT_EQ(parts.size(), 5U);  // of 50, the last of 89
  for (std::size_t k = 0; k < parts.size(); ++k) {
    const Key first = parts[k].variables.key(parts[k].first_pose());
    const Key last = parts[k].variables.key(parts[k].last_pose());
    EXPECT_EQ(first, pose_key(kPartPoses * k));
    EXPECT_EQ(last, pose_key(k == 4 ? 289 : kPartPoses * (k + 1)));
  }
}

/// The whole problem from its chain ends elsewhere; otherwise it ends where joining without a start
/// does.
template <int D>
void expect_the_optimum(const SimulationOptions& options) {
  const MeasurementGraph<D> graph = simulate<D>(options).graph;
  const RawLog<D> log = raw_log(graph);
  const double optimum = join_all(graph, {}).report.chi2;
  const BuiltMaps<D> whole = build_local_maps(log, in_one_map(log), {.whole = true});
  EXPECT_GT(whole.chi2, 1.2 * optimum);  // else there is nothing to show
  const BuiltMaps<D> built = build_local_maps(log, in_one_map(log));
  ASSERT_EQ(built.maps.size(), 1U);
  EXPECT_EQ(built.used.size(), log.size());
  EXPECT_NEAR(built.chi2, optimum, 1e-6 * optimum);
  EXPECT_TRUE(is_gauge_free(built.maps[0]));
}

TEST(LargeLocalMaps, EndInTheOptimumWhereTheirChainDoesNot) {
  SimulationOptions plane = simulation_defaults(World::kLandmarks2d);
  plane.poses = 1000;
  plane.sigma_rotation = 0.1;
  plane.visible_features = 1.0;
  plane.sensor_range = 3.0;
  expect_the_optimum<2>(plane);
  SimulationOptions space = simulation_defaults(World::kSphere);
  space.poses = 600;
  space.sigma_rotation = 0.2;
  expect_the_optimum<3>(space);
}

/// Ranges and bearings cannot be joined as they are, parts of fifty poses can.
TEST(LargeLocalMaps, OfRangesAndBearingsEndInTheOptimumToo) {
  LogSimulationOptions options;
  options.poses = 1500;
  options.sensors.sigma_turn_rate = 0.1;
  options.most_turn = 1.0;
  const RawLog<2> log = simulate_log(options).log;
  const BuiltMaps<2> built = build_local_maps(log, in_one_map(log));
  const BuiltMaps<2> small = build_local_maps(log, segment(log, {SegmentRule::By::kPoses, 40}));
  const JoinResult<2> joined = join_all(std::span<const Map<2>>(small.maps), {}, {});
  EXPECT_NEAR(built.chi2, small.chi2 + joined.report.chi2, 0.01 * built.chi2);
}

TEST(LargeLocalMaps, OfAFilterAreNearTheOptimumAndSolvedToIt) {
  const MeasurementGraph<2> graph = large_world<2>(World::kLandmarks2d, 700);
  const RawLog<2> log = raw_log(graph);
  const JoinResult<2> optimum = join_all(graph, {});
  for (const LocalFrame frame : {LocalFrame::kStart, LocalFrame::kEnd, LocalFrame::kFeatures}) {
    const BuildOptions options{.builder = Builder::kFilter, .frame = frame};
    const BuiltMaps<2> built = build_local_maps(log, in_one_map(log), options);
    ASSERT_EQ(built.maps.size(), 1U);
    EXPECT_EQ(built.used.size(), log.size());
    EXPECT_TRUE(is_gauge_free(built.maps[0]));
    EXPECT_NE(built.maps[0].observations, nullptr);  // its parts, not one of all that is dense
    EXPECT_LT(deviation(built.maps[0].values, optimum.maps[0].values).pose_rmse, 0.1);
    EXPECT_NEAR(built.chi2, optimum.report.chi2, 0.05 * optimum.report.chi2);
    const SolvedLog<2> solved = solve_by_local_maps(log, in_one_map(log), options, {});
    EXPECT_NEAR(solved.result.report.chi2, optimum.report.chi2, 1e-6 * optimum.report.chi2);
  }
}

/// What is marginalised in the end has to stay until the parts are joined.
TEST(LargeLocalMaps, OfAFilterThatForgetsItsPosesAreTheSameWithoutThem) {
  SimulationOptions options = simulation_defaults(World::kLandmarks2d);
  options.poses = 900;
  options.visible_features = 15.0;
  const RawLog<2> log = raw_log(simulate<2>(options).graph);
  const BuiltMaps<2> all = build_local_maps(log, in_one_map(log), {.builder = Builder::kFilter});
  const BuiltMaps<2> end =
      build_local_maps(log, in_one_map(log), {.builder = Builder::kFilter, .keep = Keep::kEndPose});
  ASSERT_EQ(end.maps.size(), 1U);
  ASSERT_GT(end.maps[0].variables().scalars(), kLargestState);  // else it is not built in parts
  EXPECT_EQ(end.maps[0].values.column<Pose2>().size(), 2U);
  const Deviation apart = deviation(end.maps[0].values, all.maps[0].values);
  EXPECT_LT(apart.pose_rmse, 0.01);
  EXPECT_LT(apart.feature_rmse, 0.01);
}

TEST(LargeLocalMaps, HaveTheSameBitsForAnyNumberOfThreads) {
  const RawLog<2> log = test::drive({.poses = 260}).log;
  const Segmentation segments = segment(log, {SegmentRule::By::kMaps, 2});
  for (const Builder builder : {Builder::kNonlinear, Builder::kFilter}) {
    const BuiltMaps<2> one = build_local_maps(log, segments, {.builder = builder});
    const BuiltMaps<2> two = build_local_maps(log, segments, {.builder = builder, .threads = 2});
    ASSERT_EQ(one.maps.size(), two.maps.size());
    for (std::size_t k = 0; k < one.maps.size(); ++k)
      EXPECT_EQ(one.maps[k].information, two.maps[k].information);
  }
}

/// Parts place the features, or the whole map does.
TEST(LargeLocalMaps, OfRangesAloneAreAsGoodAsSmallOnes) {
  const test::DrivenWorld w = test::drive({.sensor = test::Sensor::kRange, .poses = 300});
  const Segmentation segments = segment(w.log, {SegmentRule::By::kPoses, 40});
  const SolvedLog<2> small = solve_by_local_maps(w.log, segments, {}, {});
  const double rmse = deviation(small.result.maps[0].values, w.truth).feature_rmse;
  for (const Builder builder : {Builder::kNonlinear, Builder::kFilter}) {
    const BuiltMaps<2> built = build_local_maps(w.log, in_one_map(w.log), {.builder = builder});
    ASSERT_EQ(built.maps.size(), 1U);
    EXPECT_EQ(built.used.size() + built.refused.size(), w.log.size());
    EXPECT_LT(deviation(built.maps[0].values, w.truth).feature_rmse, 2.0 * rmse);
    if (builder == Builder::kNonlinear) {
      EXPECT_LE(built.refused.size(), small.refused);
    }
  }
}

/// A loss so wide that it changes nothing.
TEST(LargeLocalMaps, WithARobustLossAndNoOutliersEndInTheOptimumToo) {
  SimulationOptions options = simulation_defaults(World::kGrid3d);
  options.poses = 600;
  options.sigma_rotation = 0.2;
  const RawLog<3> log = raw_log(simulate<3>(options).graph);
  const double optimum = build_local_maps(log, in_one_map(log)).chi2;
  const BuiltMaps<3> robust =
      build_local_maps(log, in_one_map(log), {.loss = parse_robust_loss("huber:1000000")});
  EXPECT_NEAR(robust.chi2, optimum, 1e-6 * optimum);
}

TEST(LargeLocalMaps, WithOutliersAreAsGoodAsSmallOnes) {
  const auto feature_rmse = [](double outliers) {
    const test::DrivenWorld w = test::drive({.poses = 300, .outliers = outliers});
    const BuiltMaps<2> built =
        build_local_maps(w.log, in_one_map(w.log), {.loss = parse_robust_loss("cauchy:2")});
    return deviation(built.maps[0].values, w.truth).feature_rmse;
  };
  EXPECT_LT(feature_rmse(0.05), 2.0 * feature_rmse(0.0));
}

}  // namespace
}  // namespace mapjoin
