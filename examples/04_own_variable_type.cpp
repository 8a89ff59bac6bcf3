// A variable type of one's own: walls, seen as lines of the plane. No file of the library knows
// them.

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "mapjoin/evaluation/random.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/joining/join_all.h"

using namespace mapjoin;

// 1. The type: the line where cos(phi) x + sin(phi) y = d. Its functions are templates on the
// scalar,
//    so that the library can differentiate them.
template <class S>
struct Line {
  S phi, d;
};
struct Wall {
  static constexpr int ambient = 2;
  static constexpr int dim = 2;
  static constexpr std::string_view name = "wall";
  static constexpr FrameAction action = FrameAction::kGeneral;
  template <class S>
  using Value = Line<S>;
  template <class S>
  static Line<S> retract(const Line<S>& x, const Vec<2, S>& step) {
    return {x.phi + step(0), x.d + step(1)};
  }
  template <class S>
  static Vec<2, S> local(const Line<S>& x, const Line<S>& y) {
    const Mat<2, 2, S> turn = rotation_exp<2, S>(Vec<1, S>(y.phi - x.phi));
    return {rotation_log<2, S>(turn)(0), y.d - x.d};  // an angle, wrapped
  }
  template <class S>
  static Line<S> transform(const Rigid<2, S>& T, const Line<S>& x) {
    const Vec<2, S> n = T.R * Vec<2, S>(cos(x.phi), sin(x.phi));
    return {atan2(n(1), n(0)), x.d + n.dot(T.t)};
  }
};
static_assert(VariableType<Wall>);

int main() {
  // 2. A robot drives round in a room of 8 m by 6 m and sees all four walls from every pose.
  Random random(1);
  MeasurementGraphBuilder<2> builder;
  std::vector<Rigid2> poses;
  for (std::uint64_t k = 0; k < 60; ++k) {
    const double a = static_cast<double>(k) * std::numbers::pi / 30.0;
    poses.push_back(rigid2(2.0 * std::cos(a), 1.5 * std::sin(a), a));
    for (std::uint64_t w = 0; w < 4; ++w) {
      const Line<double> wall{0.5 * std::numbers::pi * static_cast<double>(w), w % 2 ? 3.0 : 4.0};
      const auto seen = Wall::transform<double>(poses[k].inverse(), wall);
      const Vec<2> noise(0.01 * random.normal(), 0.05 * random.normal());
      builder.add<Wall>(pose_key(k), {"wall", 0, w}, Wall::retract<double>(seen, noise),
                        Vec<2>(1e4, 4e2).asDiagonal());
    }
    if (k == 0) continue;
    const Vec<3> noise(0.1 * random.normal(), 0.1 * random.normal(), 0.05 * random.normal());
    builder.add<Pose2>(pose_key(k - 1), pose_key(k),
                       Pose2::retract<double>(poses[k - 1].inverse() * poses[k], noise),
                       Vec<3>(1e2, 1e2, 4e2).asDiagonal());
  }

  // 3. Joined, and written in another frame, like any map.
  const JoinResult<2> result = join_all(std::move(builder).build());
  const Map<2> map = change_frame(result.maps[0], pose_anchor<2>(pose_key(30)));
  fmt::print("chi2 {:.1f}, {} poses, {} walls\n", result.report.chi2, result.report.poses,
             result.report.features);
  const auto walls = map.values.column<Wall>();
  for (const auto& wall : walls) fmt::print("wall at {:6.3f} rad {:6.3f} m\n", wall.phi, wall.d);
  const double width = walls[0].d + walls[2].d;
  const double depth = walls[1].d + walls[3].d;
  fmt::print("the room is {:.3f} m by {:.3f} m\n", width, depth);
  return std::abs(width - 8.0) < 0.05 && std::abs(depth - 6.0) < 0.05 ? 0 : 1;
}
