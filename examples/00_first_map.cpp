#include <fmt/format.h>

#include "mapjoin/frames/change_frame.h"
#include "mapjoin/joining/join_all.h"

using namespace mapjoin;

int main() {
  // What was measured, from where: the robot's next pose, and a feature seen twice.
  const Mat<3, 3> step = Vec<3>(100.0, 100.0, 400.0).asDiagonal();  // 0.1 m, 0.1 m, 0.05 rad
  const Mat<2, 2> sight = Vec<2>(25.0, 25.0).asDiagonal();          // 0.2 m
  MeasurementGraphBuilder<2> measured;
  measured.add<Pose2>(pose_key(0), pose_key(1), rigid2(2.0, 0.1, 0.3), step);
  measured.add<Pose2>(pose_key(1), pose_key(2), rigid2(1.5, -0.2, -0.4), step);
  measured.add<Point2>(pose_key(0), point_key(7), {2.9, 1.0}, sight);
  measured.add<Point2>(pose_key(2), point_key(7), {-0.8, 0.6}, sight);

  // The map, without an initial guess; and the same map as the robot sees it from pose 2.
  const JoinResult<2> result = join_all(std::move(measured).build());
  const Map<2> map = change_frame(result.maps[0], pose_anchor<2>(pose_key(2)));
  const Vec<2> feature = map.values.point(point_key(7));
  fmt::print("chi2 {:.3f}, feature at {:.3f} {:.3f}\n", result.report.chi2, feature(0), feature(1));
  return result.report.minimum ? 0 : 1;
}
