#pragma once

#include "mapjoin/graph/map.h"

namespace mapjoin {

/// Requires that a map can tell apart what a frame of points hangs on: F_O from F_X and, in space,
/// F_Y from the line through both, by more than three of their standard deviations
/// (expect_distinct). Whoever picks an anchor for a map that has information calls this before
/// change_frame, which is O(n) and knows nothing of covariances.
///
/// Nothing to do, and true, for other anchors and for maps without information or an anchor of
/// their own. Otherwise one sparse factorisation and D^2 solves.
/// \throws DegenerateFrameError that names the points, their distance and its standard deviation;
/// SingularError when the map's information does not determine them.
template <int D>
void expect_determined(const Map<D>& map, const Anchor<D>& anchor);

}  // namespace mapjoin
