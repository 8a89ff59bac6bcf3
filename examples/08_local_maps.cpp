// Where maps come from: ranges and bearings become local maps, and local maps become a map.
//
// A vehicle drives a square, knows its speed and turn rate, and measures beacons by range and
// bearing. The recording is cut into local maps; each is a small nonlinear least squares problem of
// its own, started from its own odometry. Joining them is linear.
#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "mapjoin/building/build.h"
#include "mapjoin/joining/join_all.h"

using namespace mapjoin;

namespace {

// Twelve beacons around a square of 10 m.
constexpr int kSide = 10;
constexpr double kSecond = 1.0;

Vec<2> beacon(std::uint64_t b) {
  const double angle = 2.0 * std::numbers::pi * static_cast<double>(b) / 12.0;
  return Vec<2>(5.0 + 9.0 * std::cos(angle), 5.0 + 9.0 * std::sin(angle));
}

}  // namespace

int main() {
  // Standard deviations: 5 cm/s, 2 cm/s sideways (a vehicle that hardly slips), 1 degree/s; then 5
  // cm and 1 degree. Information is one over their squares.
  const Mat<3, 3> odometry = Vec<3>(400.0, 2500.0, 3283.0).asDiagonal();
  const Mat<2, 2> sight = Vec<2>(400.0, 3283.0).asDiagonal();

  RawLogBuilder<2> builder;
  Rigid2 pose;  // the truth, which the log does not hold
  for (std::uint64_t i = 0; i < 4 * kSide; ++i) {
    for (std::uint64_t b = 0; b < 12; ++b) {
      const Vec<2> seen = pose.inverse() * beacon(b);
      if (seen.norm() > 8.0) continue;
      const double wrong = 0.05 * std::sin(static_cast<double>(7 * i + 3 * b));
      builder.add<RangeBearing>(pose_key(i), point_key(b),
                                {seen.norm() + wrong, std::atan2(seen(1), seen(0))}, sight);
    }
    const double turn = i % kSide == kSide - 1 ? 0.5 * std::numbers::pi : 0.0;
    const double slow = 1.0 + 0.05 * std::cos(static_cast<double>(5 * i));
    builder.add<VelocityTurnRate>(pose_key(i), pose_key(i + 1), {slow, turn + 0.01, kSecond},
                                  odometry);
    pose = pose * VelocityTurnRate::seen({1.0, turn, kSecond});
  }
  const RawLog<2> log = std::move(builder).build();

  const Segmentation segments = segment(log, {SegmentRule::By::kPoses, 8});
  const BuiltMaps<2> built = build_local_maps(log, segments);
  fmt::print("{} measurements, {} local maps, at most {} iterations each\n", log.size(),
             built.maps.size(), built.most_iterations);

  JoinOptions options;
  options.mode = Mode::kSummary;  // one linear solve a join; local maps and nothing else
  const JoinResult<2> joined = join_all(std::span<const Map<2>>(built.maps), {}, options);
  const Rigid2& home = joined.maps[0].values.pose(pose_key(4 * kSide));
  fmt::print("after the square the vehicle is {:.3f} m from where it began\n", home.t.norm());
  for (const std::uint64_t b : {0, 3, 6, 9}) {
    const Vec<2>& p = joined.maps[0].values.point(point_key(b));
    fmt::print("{}: ({:.3f}, {:.3f}), true ({:.3f}, {:.3f})\n", to_string(point_key(b)), p(0), p(1),
               beacon(b)(0), beacon(b)(1));
  }
}
