// What one change of frame or one join leaves of rounding must not grow with the next ones: maps
// are re-framed thousands of times on the way through a sequential join, or over a robot's life.
#include <gtest/gtest.h>

#include "mapjoin/evaluation/simulate.h"
#include "mapjoin/frames/anchors.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/joining/join.h"
#include "mapjoin/joining/join_all.h"

namespace mapjoin {
namespace {

template <int D>
Simulation<D> simulated(World world, int poses) {
  SimulationOptions options = simulation_defaults(world);
  options.poses = poses;
  return simulate<D>(options);
}

TEST(ManyFrames, LeaveAMapAsItWas) {
  const Simulation<3> sphere = simulated<3>(World::kSphere, 20);
  Map<3> map = join_all(sphere.graph).maps.at(0);
  const Map<3> first = map;
  for (std::uint64_t k = 1; k <= 1000; ++k) {
    map = change_frame(std::move(map), pose_anchor<3>(pose_key(7 * k % 20)));
  }
  EXPECT_EQ(map.anchor.keys[0], first.anchor.keys[0]);
  EXPECT_LT(first.values.local(map.values).norm(), 1e-10);
  const Eigen::MatrixXd before = first.information.dense();
  EXPECT_LT((map.information.dense() - before).norm(), 1e-9 * before.norm());
}

TEST(ManyFrames, LeaveInformationGaugeFreeThroughJoinsAsPublished) {
  const Simulation<2> drive = simulated<2>(World::kManhattan, 200);
  const auto step = [&](std::uint64_t k) {  // the map of pose k and k + 1
    MeasurementGraphBuilder<2> builder;
    const Rigid2 between =
        drive.truth.pose(pose_key(k)).inverse() * drive.truth.pose(pose_key(k + 1));
    builder.add<Pose2>(pose_key(k), pose_key(k + 1), between, Mat<3, 3>::Identity() * 500.0);
    return join_all(std::move(builder).build()).maps.at(0);
  };
  Map<2> map = step(0);
  for (std::uint64_t k = 1; k + 1 < 200; ++k) map = join_as_published(map, step(k), pose_key(k));
  const Eigen::MatrixXd information = map.information.dense();
  const Eigen::MatrixXd gauge = map.values.gauge();
  EXPECT_LT((information * gauge).norm(), 1e-13 * information.norm() * gauge.norm());
}

}  // namespace
}  // namespace mapjoin
