#pragma once

#include <Eigen/Core>
#include <vector>

#include "mapjoin/graph/anchor.h"
#include "mapjoin/graph/values.h"

namespace mapjoin {

/// The anchor that is a pose: all of it is pinned, at the identity.
template <int D>
const AnchorKind<D>& pose_anchor_kind();

/// A frame fixed by one pose.
template <int D>
Anchor<D> pose_anchor(const Key& key) {
  return {&pose_anchor_kind<D>(), {key}};
}

/// The rigid motion into the frame of a pose: its inverse, with a rotation that is orthonormal to
/// rounding whatever the pose has gathered.
///
/// Frames change many times on the way through a sequential join. Without this, what the pose's
/// rotation lacks would be added to that of every variable each time, and so double with each
/// frame.
template <int D>
Rigid<D> motion_into(const Rigid<D>& pose);

/// Is the anchor one pose, all of it? Then results are in that pose's frame.
template <int D>
bool is_pose_anchor(const Anchor<D>& anchor) {
  return anchor.kind != nullptr && anchor.kind->tag == Tag("pose");
}

/// "pose:12", "points:84,85" for anchors of several variables of one type ("points:1/84,1/85" in
/// session 1), "level:pose:3,up:0" for those of several types.
template <int D>
std::string to_string(const Anchor<D>& anchor);

/// The numbers of an anchor's variables in a set. \throws InputError that names a key that is not
/// in the set or is of the wrong type.
template <int D>
std::vector<int> anchor_variables(const Anchor<D>& anchor, const VariableSet<D>& variables);

/// The rigid motion from the frame that `values` are written in into the anchor's frame.
/// \throws DegenerateFrameError when the variables do not fix a frame.
template <int D>
Rigid<D> motion_into(const Anchor<D>& anchor, const Values<D>& values);

/// What an anchor does to tangents, at values written in its frame.
struct AnchorRows {
  std::vector<int> variables;  ///< numbers, in the order of the anchor's keys
  std::vector<int> scalars;    ///< numbers of their stacked tangent scalars
  Eigen::MatrixXd P;           ///< kGauge x scalars: the pinned quantity is P d
  Eigen::MatrixXd C;           ///< P g: kGauge x kGauge, invertible
  /// Numbers of the scalars that the anchor drops from the state, ascending; empty when P mixes
  /// scalars.
  std::vector<int> pinned;
};

/// \throws DegenerateFrameError when C is singular.
template <int D>
AnchorRows anchor_rows(const Anchor<D>& anchor, const Values<D>& values);

}  // namespace mapjoin
