// A kind of anchor of one's own, in space: level at a pose. The origin is where a pose is, z points
// up, and x to where the pose looks. Up is a variable like any other, measured by accelerometers:
// nothing absolute is put into the map, it is only written in a frame that people find their way
// in.
#pragma once

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <cmath>

#include "direction3.h"
#include "mapjoin/frames/anchors.h"
#include "mapjoin/graph/builtin_types.h"
#include "mapjoin/graph/error.h"

namespace own {

namespace detail {

/// Below this sine of the angle between its x axis and up, a pose looks in no direction of the
/// compass.
inline constexpr double kLooksSomewhere = 1e-6;

inline mapjoin::Rigid3 level_frame(const double* const* x, const mapjoin::Key* keys) {
  const auto& pose = *reinterpret_cast<const mapjoin::Rigid3*>(x[0]);
  const Vec<3> up = reinterpret_cast<const Vec<3>*>(x[1])->normalized();
  const Vec<3> ahead = pose.R.col(0) - up * up.dot(pose.R.col(0));
  if (!(ahead.norm() > kLooksSomewhere)) {
    throw mapjoin::DegenerateFrameError(fmt::format(
        "{} looks along {} (sine of the angle {:.3g}): it has no heading; choose another pose",
        to_string(keys[0]), to_string(keys[1]), ahead.norm()));
  }
  mapjoin::Rigid3 into;
  into.R.row(0) = ahead.normalized().transpose();
  into.R.row(1) = up.cross(ahead.normalized()).transpose();
  into.R.row(2) = up.transpose();
  into.t = -(into.R * pose.t);
  return into;
}

/// Tangents: of the pose (rho, phi), of the direction two. The position is pinned (rho = 0,
/// whatever the pose's orientation) and the direction; of the pose's orientation the heading alone,
/// which is a mixture of its three rotations: R_y . (phi x e_x) = 0. Roll and pitch stay free.
inline void level_rows(const double* const* x, double* P) {
  const auto& pose = *reinterpret_cast<const mapjoin::Rigid3*>(x[0]);
  Eigen::Map<Eigen::Matrix<double, 6, 8>> pinned(P);
  pinned.setZero();
  for (int k = 0; k < 3; ++k) pinned(k, k) = 1.0;
  pinned(3, 6) = pinned(4, 7) = 1.0;
  pinned(5, 4) = -pose.R(1, 2);
  pinned(5, 5) = pose.R(1, 1);
}

inline void pin_level(double* const* x) {
  auto& pose = *reinterpret_cast<mapjoin::Rigid3*>(x[0]);
  pose.t.setZero();
  pose.R(1, 0) = 0.0;
  *reinterpret_cast<Vec<3>*>(x[1]) = Vec<3>(0.0, 0.0, 1.0);
}

inline constexpr mapjoin::Tag kLevelTypes[] = {"pose", "up"};

constexpr mapjoin::AnchorKind<3> make_level_anchor() {
  mapjoin::AnchorKind<3> kind;
  kind.tag = "level";
  kind.arity = 2;
  kind.types = kLevelTypes;
  kind.tangent = 8;
  kind.frame = &level_frame;
  kind.rows = &level_rows;
  kind.pin = &pin_level;
  return kind;
}

}  // namespace detail

inline constexpr mapjoin::AnchorKind<3> kLevelAnchor = detail::make_level_anchor();

/// The level frame at a pose, z along the given direction.
inline mapjoin::Anchor<3> level_anchor(std::uint64_t pose, std::uint64_t up) {
  return {&kLevelAnchor, {mapjoin::pose_key(pose), up_key(up)}};
}

}  // namespace own
