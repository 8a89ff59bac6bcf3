// The frame of a map is a free choice, and so is what fixes it. Here are anchors that no file of
// the library knows: a line and a point in the plane (line_anchor.h), and a level frame at a pose
// in space (level_anchor.h).

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "level_anchor.h"
#include "line_anchor.h"
#include "mapjoin/evaluation/random.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/frames/points_anchor.h"
#include "mapjoin/joining/join_all.h"

using namespace mapjoin;

// 1. In the plane: a robot drives down a corridor, sees its wall and doors, and knows nothing of
//    where the corridor lies in the world.
bool corridor() {
  Random random(1);
  const own::Line::Value<double> wall{0.4, 1.5 - 3.0 * std::sin(0.4) + 2.0 * std::cos(0.4)};
  MeasurementGraphBuilder<2> builder;
  Rigid2 pose = rigid2(3.0, 2.0, 0.4);
  for (std::uint64_t k = 0; k < 20; ++k) {
    const auto seen = own::Line::transform<double>(pose.inverse(), wall);
    const Vec<2> wall_noise(0.01 * random.normal(), 0.02 * random.normal());
    builder.add<own::Line>(pose_key(k), own::line_key(0),
                           own::Line::retract<double>(seen, wall_noise),
                           Vec<2>(1e4, 2.5e3).asDiagonal());
    for (std::uint64_t door = 0; door < 3; ++door) {
      const double along = 5.0 * static_cast<double>(door);
      const Vec<2> at(3.0 + std::cos(0.4) * along - std::sin(0.4) * 1.5,
                      2.0 + std::sin(0.4) * along + std::cos(0.4) * 1.5);
      const Vec<2> noise(0.05 * random.normal(), 0.05 * random.normal());
      builder.add<Point2>(pose_key(k), point_key(door), pose.inverse() * at + noise,
                          400.0 * Mat<2, 2>::Identity());
    }
    const Rigid2 next = pose * rigid2(0.5, 0.0, 0.02 * random.normal());
    if (k + 1 < 20)
      builder.add<Pose2>(pose_key(k), pose_key(k + 1), pose.inverse() * next,
                         Vec<3>(1e3, 1e3, 1e4).asDiagonal());
    pose = next;
  }
  Map<2> map = join_all(std::move(builder).build()).maps[0];
  map = change_frame(std::move(map), own::line_anchor(0, 0));  // from the wall and the first door
  for (std::uint64_t door = 0; door < 3; ++door) {
    const Vec<2> at = map.values.point(point_key(door));
    fmt::print("door {} at {:6.3f} m along the wall\n", door, at(0));
  }
  const double last = map.values.point(point_key(2))(0);
  map = change_frame(std::move(map), points_anchor(point_key(0), point_key(2)));  // and from doors
  return std::abs(last - 10.0) < 0.1 && map.values.point(point_key(2))(1) == 0.0;
}

// 2. In space: a robot on a slope measures which way is up. Level, its map says how high things
// are.
bool slope() {
  Random random(2);
  MeasurementGraphBuilder<3> builder;
  Rigid3 pose;
  pose.R = rotation_exp<3, double>(Vec<3>(0.2, -0.3, 1.0));
  for (std::uint64_t k = 0; k < 10; ++k) {
    const Vec<3> up = pose.R.transpose() * Vec<3>(0.0, 0.0, 1.0);
    const Vec<2> noise(0.01 * random.normal(), 0.01 * random.normal());
    builder.add<own::Direction>(pose_key(k), own::up_key(0),
                                own::Direction::retract<double>(up, noise),
                                1e4 * Mat<2, 2>::Identity());
    if (k == 9) break;
    Rigid3 step;
    step.t(0) = 1.0;
    Mat<6, 6> information = 1e4 * Mat<6, 6>::Identity();
    builder.add<Pose3>(pose_key(k), pose_key(k + 1), step, information);
    pose = pose * step;
  }
  const Rigid3 truth = pose;
  const Map<3> tilted = join_all(std::move(builder).build()).maps[0];
  const Map<3> level = change_frame(tilted, own::level_anchor(0, 0));
  const double height = level.values.pose(pose_key(9)).t(2);
  fmt::print("the last pose is {:.2f} m up; in the frame of the first pose z is {:.2f}\n", height,
             tilted.values.pose(pose_key(9)).t(2));
  return std::abs(height - truth.t(2)) < 0.1;
}

int main() { return corridor() && slope() ? 0 : 1; }
