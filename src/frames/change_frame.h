#pragma once

#include <span>

#include "mapjoin/frames/anchors.h"
#include "mapjoin/graph/map.h"

namespace mapjoin {

/// One typed column of whatever is being moved: `count` values from variable number `first` on.
template <int D>
struct MovedColumn {
  const VariableKind<D>* kind = nullptr;
  const double* values = nullptr;  ///< before the motion
  int first = 0;
  int count = 0;
};

/// Lambda'_ij = D_i^-T Lambda_ij D_j^-1 for the motion T of the given columns, which cover all
/// variables of `information` in order. Nothing happens to body types. O(blocks).
template <int D>
void move_information(SymmetricBlockMatrix& information, std::span<const MovedColumn<D>> columns,
                      const Rigid<D>& T);

/// Moves a map rigidly: x' = T x, Lambda'_ij = D_i^-T Lambda_ij D_j^-1.
///
/// Exact, whatever the types: nothing happens to the information between poses, a rotation to that
/// of points. The anchor is left as it was; use change_frame unless you know better. O(n + blocks),
/// sparsity kept.
template <int D>
void move(Map<D>& map, const Rigid<D>& T);

/// Writes the map in another frame: equations (18)-(21) of Linear SLAM for every variable type,
/// every anchor, in the plane and in space.
///
/// Pinned values become exactly what the frame says (a pose anchor: the identity). O(n + blocks),
/// sparsity kept. \throws InputError when the anchor's variables are not in the map,
/// DegenerateFrameError when they fix no frame.
template <int D>
Map<D> change_frame(Map<D> map, const Anchor<D>& anchor);

}  // namespace mapjoin
