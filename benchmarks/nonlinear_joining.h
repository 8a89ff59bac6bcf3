#pragma once

#include <span>
#include <vector>

#include "mapjoin/graph/map.h"

/// \file
/// The traditional way of joining local maps, for comparison (Linear SLAM section 4.4): every map
/// stays in the frame of its start pose, so joining two of them is nonlinear least squares (24),
/// iterated.

namespace mapjoin::benchmarks {

/// A map in the frame of its start pose P_0, which is not part of the state (22): values with P_0
/// at the identity, and the information over all others.
template <int D>
struct StartFrameMap {
  Values<D> values;
  int start = 0;                     ///< number of P_0
  SymmetricBlockMatrix information;  ///< over all variables; zero rows and columns at P_0
};

/// A local map that is anchored at a pose. \throws InputError when it is not.
template <int D>
StartFrameMap<D> start_frame_map(const Map<D>& map);

/// What joins cost beside their seconds.
struct NonlinearJoining {
  int joins = 0;
  int iterations = 0;  ///< over all joins
};

/// Minimises (24) by Gauss-Newton from the estimate that lays the second map on the end of the
/// first: its start pose must be in the first. Sparse: normal equations with the blocks of both
/// maps, and of everything in the second with its start pose.
template <int D>
StartFrameMap<D> join_nonlinearly(const StartFrameMap<D>& first, const StartFrameMap<D>& second,
                                  NonlinearJoining& cost);

/// Each map onto all before it, or neighbours in pairs (sections 5.1, 5.2).
template <int D>
StartFrameMap<D> join_all_nonlinearly(std::span<const Map<D>> maps, bool sequential,
                                      NonlinearJoining& cost);

}  // namespace mapjoin::benchmarks
