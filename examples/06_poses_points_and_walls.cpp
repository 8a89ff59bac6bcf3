// Poses, points and a type of one's own (line2.h) in the same maps: two robots drive through an
// office of six rooms, one by day with its camera, one at night when only the walls can be seen.
// Their maps have nothing in common but walls.

#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "line2.h"
#include "mapjoin/evaluation/consistency.h"
#include "mapjoin/evaluation/random.h"
#include "mapjoin/joining/join.h"
#include "mapjoin/joining/join_all.h"

using namespace mapjoin;

// 1. The office: rooms of 6 m by 5 m in two rows of three, each with four walls and three marks.
Vec<2> centre(std::uint64_t room) {
  return {6.0 * static_cast<double>(room % 3), 5.0 * static_cast<double>(room / 3)};
}
own::Line::Value<double> wall(std::uint64_t id) {  // the room is to the left of its walls
  const double a = 0.5 * std::numbers::pi * static_cast<double>(id % 4);
  const Vec<2> left(-std::sin(a), std::cos(a));
  return {a, left.dot(centre(id / 4)) - (id % 2 == 0 ? 2.5 : 3.0)};
}
Vec<2> mark(std::uint64_t id) {
  return centre(id / 3) + Vec<2>(static_cast<double>(id % 3) - 1.0, id % 2 == 0 ? 2.5 : -2.5);
}

// 2. A drive: a round of twelve poses in each room, and what is measured on it.
struct Drive {
  MeasurementGraph<2> graph;
  Values<2> truth;
};
Drive drive(std::uint32_t robot, bool light) {
  constexpr double kStep = 0.05, kTurn = 0.01, kMark = 0.1, kAngle = 0.01, kOffset = 0.03;
  const Mat<3, 3> step_info =
      Vec<3>(1 / (kStep * kStep), 1 / (kStep * kStep), 1 / (kTurn * kTurn)).asDiagonal();
  const Mat<2, 2> mark_info = Mat<2, 2>::Identity() / (kMark * kMark);
  const Mat<2, 2> wall_info = Vec<2>(1 / (kAngle * kAngle), 1 / (kOffset * kOffset)).asDiagonal();
  Random random(7, robot);
  const auto normal = [&](double sigma) { return sigma * random.normal(); };
  MeasurementGraphBuilder<2> measured;
  ValuesBuilder<2> truth;
  Rigid2 last;
  for (std::uint64_t k = 0; k < 72; ++k) {
    const std::uint64_t room = robot == 0 ? k / 12 : 5 - k / 12;
    const double a = static_cast<double>(k % 12) * std::numbers::pi / 6.0;
    const Vec<2> at = centre(room) + 1.5 * Vec<2>(std::cos(a), std::sin(a));
    const Rigid2 pose = rigid2(at(0), at(1), a + 1.0);
    const Key key = pose_key(k, robot);
    truth.add<Pose2>(key, pose);
    if (k > 0) {
      const Vec<3> noise(normal(kStep), normal(kStep), normal(kTurn));
      measured.add<Pose2>(pose_key(k - 1, robot), key,
                          Pose2::retract<double>(last.inverse() * pose, noise), step_info);
    }
    for (std::uint64_t id = 4 * room; id < 4 * room + 4; ++id) {
      const auto seen = own::Line::transform<double>(pose.inverse(), wall(id));
      measured.add<own::Line>(
          key, own::line_key(id),
          own::Line::retract<double>(seen, Vec<2>(normal(kAngle), normal(kOffset))), wall_info);
    }
    for (std::uint64_t id = 3 * room; light && id < 3 * room + 3; ++id) {
      measured.add<Point2>(key, point_key(id),
                           pose.inverse() * mark(id) + Vec<2>(normal(kMark), normal(kMark)),
                           mark_info);
    }
    last = pose;
  }
  for (std::uint64_t id = 0; id < 24; ++id) truth.add<own::Line>(own::line_key(id), wall(id));
  for (std::uint64_t id = 0; id < 18; ++id) truth.add<Point2>(point_key(id), mark(id));
  return {std::move(measured).build(), std::move(truth).build()};
}

// 3. Is the map as good as it says? Poses, points and lines alike.
bool expect_consistent(const char* what, const Map<2>& map, const Values<2>& truth) {
  const Consistency c = consistency(map, truth);
  fmt::print("{:20} NEES {:5.1f}, dimension {}, 95% of such maps have {:.1f} to {:.1f}\n", what,
             c.nees, c.dimension, c.lower, c.upper);
  return c.consistent();
}

int main() {
  const Drive day = drive(0, true), night = drive(1, false);
  const Map<2> a = join_all(day.graph).maps.at(0);
  const Map<2> b = join_all(night.graph).maps.at(0);
  bool good = expect_consistent("by day", a, day.truth);
  good = expect_consistent("at night", b, night.truth) && good;

  // 4. Joined: laid on one another by the directions and offsets of 24 walls, then one linear
  // solve.
  good = expect_consistent("one linear solve", join(a, b), day.truth) && good;
  const std::vector<Map<2>> maps{a, b};
  const JoinResult<2> both = join_all<2>(std::span<const Map<2>>(maps), {});
  good = expect_consistent("all measurements", both.maps.at(0), day.truth) && good;
  fmt::print("{} poses, {} marks and walls, chi2 {:.1f}\n", both.report.poses, both.report.features,
             both.report.chi2);
  return good && both.maps.size() == 1 ? 0 : 1;
}
