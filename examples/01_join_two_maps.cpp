// Joins two small maps step by step. Numbers in parentheses are equations of the paper Linear SLAM.

#include <fmt/format.h>

#include <cmath>

#include "mapjoin/frames/change_frame.h"
#include "mapjoin/joining/join.h"
#include "mapjoin/joining/join_all.h"

using namespace mapjoin;

namespace {

const Mat<3, 3> kPoseInfo = Vec<3>(100.0, 100.0, 400.0).asDiagonal();  // 0.1 m, 0.05 rad
const Mat<2, 2> kPointInfo = Vec<2>(25.0, 25.0).asDiagonal();          // 0.2 m

void print(const char* name, const Eigen::MatrixXd& matrix, int digits) {
  fmt::print("{} =\n", name);
  for (const auto& row : matrix.rowwise()) {
    for (const double x : row)
      fmt::print(" {:>5}", std::abs(x) < 1e-9 ? "." : fmt::format("{:.{}f}", x, digits));
    fmt::print("\n");
  }
}

void print(const char* name, const Map<2>& map) {
  fmt::print("{}, in the frame of {}\n", name, to_string(map.anchor));
  for (int id = 0; id <= 2; ++id) {
    if (!map.values.contains(pose_key(id))) continue;
    const Rigid2& pose = map.values.pose(pose_key(id));
    fmt::print("  pose:{}  {:6.3f} {:6.3f} {:6.3f}\n", id, pose.t(0), pose.t(1), heading(pose));
  }
  const Vec<2>& p = map.values.point(point_key(7));
  fmt::print("  point:7 {:6.3f} {:6.3f}\n", p(0), p(1));
}

}  // namespace

int main() {
  // 1. A robot drives 0 -> 1 -> 2 and sees point 7 thrice. Pose 1 and the point are in both maps.
  MeasurementGraphBuilder<2> first, second;
  first.add<Pose2>(pose_key(0), pose_key(1), rigid2(2.0, 0.1, 0.30), kPoseInfo);
  first.add<Point2>(pose_key(0), point_key(7), {2.9, 1.0}, kPointInfo);
  first.add<Point2>(pose_key(1), point_key(7), {1.1, 0.6}, kPointInfo);
  second.add<Pose2>(pose_key(1), pose_key(2), rigid2(1.5, -0.2, -0.40), kPoseInfo);
  second.add<Point2>(pose_key(2), point_key(7), {-0.8, 0.6}, kPointInfo);
  const Map<2> map_1 = join_all(std::move(first).build()).maps[0];
  const Map<2> map_2 = join_all(std::move(second).build()).maps[0];
  print("map 1", map_1);
  print("map 2", map_2);

  // 2. Map 1 in the frame of map 2: closed form, (18)-(21). Nothing is solved, nothing is lost.
  const Map<2> map_1_at_1 = change_frame(map_1, pose_anchor<2>(pose_key(1)));
  print("map 1", map_1_at_1);

  // 3. In one frame joining is linear: min |A d - Z|^2 in the norm of I_Z, (12)-(15).
  const Merge<2> merged = merge<2>({map_1_at_1, map_2});
  print("A (columns: point:7, pose:0, pose:1, pose:2)", merged.equations.A(), 2);
  print("Z^T", merged.equations.Z().transpose(), 2);
  print("I_Z", merged.equations.I_Z(), 0);

  // 4. One linear solve, (16) and (17); the result in the frame where the next map would begin.
  const Map<2> joined = change_frame(solve(merged), pose_anchor<2>(pose_key(2)));
  print("joined", joined);

  // 5. The frames of the given maps were a free choice. Which frame the join is solved in matters
  //    as little as the maps disagree, here by some centimetres.
  const Map<2> map_2_at_2 = change_frame(map_2, pose_anchor<2>(pose_key(2)));
  const Map<2> again = change_frame(join(map_1_at_1, map_2_at_2), joined.anchor);
  const Map<2> at_0 = change_frame(join(map_1, map_2), joined.anchor);
  const double lost = joined.values.local(again.values).norm();
  const double moved = joined.values.local(at_0.values).norm();
  fmt::print("map 2 given in another frame: differs by {:.0e}\n", lost);
  fmt::print("solved in the frame of pose 0: differs by {:.0e}\n", moved);
  return lost < 1e-12 && moved < 1e-3 ? 0 : 1;
}
