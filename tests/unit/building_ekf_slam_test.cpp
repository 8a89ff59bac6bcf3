// EKF SLAM over a whole recording: one local map that never ends.
#include "mapjoin/building/ekf_slam.h"

#include <gtest/gtest.h>

#include <map>
#include <numbers>
#include <string>
#include <vector>

#include "mapjoin/building/build.h"
#include "mapjoin/evaluation/consistency.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/solvers/covariance.h"
#include "tests/support/driven_worlds.h"
#include "tests/support/random_maps.h"

namespace mapjoin {
namespace {

using namespace test;  // NOLINT

/// The whole recording as one local map, from all its measurements.
BuiltMaps<2> one_map(const RawLog<2>& log, const BuildOptions& options) {
  return build_local_maps(log, segment(log, {SegmentRule::By::kMaps, 1}), options);
}

TEST(EkfSlam, IsTheLocalMapOfTheWholeRecording) {
  for (const Sensor sensor : {Sensor::kPoint, Sensor::kRangeBearing}) {
    const RawLog<2> log = drive({.sensor = sensor, .poses = 80}).log;
    const Map<2> map = ekf_slam(log).map;
    const Map<2> built =
        one_map(log, {.builder = Builder::kFilter, .keep = Keep::kEndPose}).maps.at(0);
    ASSERT_EQ(map.variables(), built.variables());
    EXPECT_LT(distance(map.values, built.values), 1e-9);
    EXPECT_LT(relative_distance(map.information.dense(), built.information.dense()), 1e-9);
  }
}

/// In the limit of small noise linearising once is as good as solving: the optimum, with the exact
/// covariance of all that it dropped on its way.
TEST(EkfSlam, IsTheOptimumInTheLimitOfSmallNoise) {
  const DrivenWorld world = drive({.poses = 150, .noise = 1e-4});
  EkfSlam<2> slam(world.log);
  while (slam.step()) {
  }
  const Map<2> best = one_map(world.log, {}).maps.at(0);
  const Covariance<2> covariance(best);
  const Values<2> values = slam.values();
  for (int i = 0; i < values.size(); ++i) {
    const Key& key = values.variables().key(i);
    if (key == pose_key(0)) continue;
    const Eigen::MatrixXd P = slam.covariance(key);
    EXPECT_LT(relative_distance(P, covariance.block(key, key)), 1e-3) << to_string(key);
    if (key.type == Tag("point")) {
      EXPECT_LT((values.point(key) - best.values.point(key)).norm(), 1e-3 * P.norm());
    }
  }
}

TEST(EkfSlam, HasTheLastPoseAndAllFeaturesSoFar) {
  const RawLog<2> log = drive({.poses = 60}).log;
  EkfSlam<2> slam(log);
  EXPECT_EQ(slam.poses(), 60);
  int features = 0;
  while (slam.step()) {
    const Values<2> values = slam.values();
    const auto last = static_cast<std::uint64_t>(slam.taken() - 1);
    EXPECT_TRUE(slam.knows(pose_key(last)));
    int poses = 0, points = 0;
    for (int i = 0; i < values.size(); ++i)
      (values.variables().key(i).type == Tag("pose") ? poses : points) += 1;
    EXPECT_EQ(poses, last == 0 ? 1 : 2) << "the first pose is the frame";
    EXPECT_GE(points, features);
    EXPECT_EQ(slam.scalars(), 2 * points + (last == 0 ? 0 : 3));
    features = points;
  }
  EXPECT_EQ(slam.taken(), 60);
  EXPECT_FALSE(slam.step());
}

/// What is known of a feature that is fixed can only become better.
TEST(EkfSlam, NeverForgets) {
  const RawLog<2> log = drive({.poses = 100}).log;
  EkfSlam<2> slam(log);
  std::map<Key, double> before;
  while (slam.step()) {
    const Values<2> values = slam.values();
    for (int i = 0; i < values.size(); ++i) {
      const Key& key = values.variables().key(i);
      if (key.type != Tag("point")) continue;
      const double now = slam.covariance(key).trace();
      const auto known = before.find(key);
      if (known != before.end()) {
        EXPECT_LE(now, known->second * (1.0 + 1e-9));
      }
      before[key] = now;
    }
  }
  EXPECT_FALSE(before.empty());
}

TEST(EkfSlam, IsConsistentWithTheTruth) {
  double nees = 0.0, dimension = 0.0;
  Coverage all;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const DrivenWorld world = drive({.seed = seed});
    const Map<2> map = ekf_slam(world.log).map;
    const Consistency c = consistency(map, world.truth);
    const Coverage inside = coverage(map, world.truth);
    EXPECT_EQ(inside.count, c.dimension);
    nees += c.nees;
    dimension += c.dimension;
    all.inside += inside.inside;
    all.count += inside.count;
  }
  EXPECT_NEAR(nees / dimension, 1.0, 0.15);
  EXPECT_GT(all.share(), 0.90);
  EXPECT_LT(all.share(), 0.99);
}

TEST(EkfSlam, KeepsAPoseThatALoopClosureComesBackTo) {
  MeasurementGraphBuilder<2> builder;
  const Mat<3, 3> I = 100.0 * Mat<3, 3>::Identity();
  const Rigid2 step = rigid2(1.0, 0.0, 0.5 * std::numbers::pi);
  for (std::uint64_t k = 0; k < 5; ++k) builder.add<Pose2>(pose_key(k), pose_key(k + 1), step, I);
  builder.add<Pose2>(pose_key(1), pose_key(5), Rigid2::identity(), I);
  const RawLog<2> log = raw_log(std::move(builder).build());
  EkfSlam<2> slam(log);
  while (slam.step()) EXPECT_EQ(slam.knows(pose_key(1)), slam.taken() > 1 && slam.taken() < 6);
  EXPECT_FALSE(slam.knows(pose_key(3)));
  EXPECT_LT(slam.covariance(pose_key(5)).trace(), 5 * 0.03) << "the loop has told it something";
}

TEST(EkfSlam, RefusesWhatItCannotFilter) {
  MeasurementGraphBuilder<2> builder;
  const Mat<3, 3> I = Mat<3, 3>::Identity();
  builder.add<Pose2>(pose_key(0), pose_key(1), Rigid2::identity(), I);
  builder.add<Pose2>(pose_key(5), pose_key(6), Rigid2::identity(), I);
  const RawLog<2> log = raw_log(std::move(builder).build());
  try {
    EkfSlam<2> slam(log);
    FAIL();
  } catch (const DisconnectedError& error) {
    EXPECT_NE(std::string(error.what()).find("pose:5"), std::string::npos) << error.what();
  }
  const RawLog<2> whole = drive({.poses = 5}).log;
  EXPECT_THROW(EkfSlam<2>(whole).covariance(pose_key(77)), InputError);
  EXPECT_THROW(ekf_slam(whole, [](const Progress&) { return false; }), CancelledError);
}

}  // namespace
}  // namespace mapjoin
