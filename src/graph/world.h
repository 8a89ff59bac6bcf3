#pragma once

#include <string_view>

#include "mapjoin/graph/builtin_types.h"
#include "mapjoin/graph/key.h"

/// \file
/// The absolute frame, as a variable.
///
/// Graphs and maps are relative. What is known absolutely (a surveyed pose, a satellite position)
/// is a measurement from a pose that stands for the frame it is known in: the *world*. It is a pose
/// like any other, of which there is one whatever the session, so recordings that know of it are
/// joined by it. A map is georeferenced by writing it in the frame of that pose: `change_frame(map,
/// pose_anchor<2>(world_key()))`, `--anchor world`.
///
///     builder.add<Pose2>(world_key(), pose_key(7), surveyed, information);
///     const PoseMeasurement<2> fix = position_fix<2>({4.0, 1.5}, 25.0 * Mat<2, 2>::Identity());
///     builder.add<Pose2>(world_key(), pose_key(8), fix.z, fix.information);
///
/// A direction of the world, gravity or north, is a variable of its own that the world and the
/// poses both measure: examples/direction3.h is a type for it.
///
/// Nothing is pinned by it: the gauge of the graph is as free as before.

namespace mapjoin {

/// How the world is printed and asked for.
inline constexpr std::string_view kWorldName = "world";

/// The pose that stands for the absolute frame. It comes after all other poses, so it is no map's
/// frame unless asked for.
constexpr Key world_key() { return pose_key(0, 0xffffffffU); }

/// A measurement of a pose from a pose, as MeasurementGraphBuilder::add takes it.
template <int D>
struct PoseMeasurement {
  Rigid<D> z;
  Mat<kGauge<D>, kGauge<D>> information;
};

/// The position of a pose, and no word about its orientation: what a satellite receiver at the pose
/// says. `information` (1/m^2) is along the axes of the world. Information on the rotation is zero;
/// with z.R = E the residual R_z^T (t - t_z) is in those axes.
template <int D>
PoseMeasurement<D> position_fix(const Vec<D>& position, const Mat<D, D>& information) {
  PoseMeasurement<D> out{Rigid<D>(), Mat<kGauge<D>, kGauge<D>>::Zero()};
  out.z.t = position;
  out.information.template topLeftCorner<D, D>() = information;
  return out;
}

/// The orientation of a pose, and no word about its position: a compass with a level (in the plane
/// a compass alone). `information` (1/rad^2) is about the axes of the pose.
template <int D>
PoseMeasurement<D> orientation_fix(const Mat<D, D>& rotation,
                                   const Mat<kRotation<D>, kRotation<D>>& information) {
  PoseMeasurement<D> out{Rigid<D>(), Mat<kGauge<D>, kGauge<D>>::Zero()};
  out.z.R = rotation;
  out.information.template bottomRightCorner<kRotation<D>, kRotation<D>>() = information;
  return out;
}

}  // namespace mapjoin
