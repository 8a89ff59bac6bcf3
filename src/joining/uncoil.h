#pragma once

#include <vector>

#include "mapjoin/graph/piece.h"
#include "mapjoin/solvers/worker_pool.h"

namespace mapjoin {

/// Poses of chains that are wound up.
///
/// Rotation residuals are logarithms and so never larger than half a turn. Where two parts of a
/// map meet with a larger error than that, after long drives without anything to compare with, the
/// solve turns one of them the wrong way round and spreads a whole turn over the chain of poses
/// between them: a local minimum of a few strained measurements that no step leaves, far above the
/// optimum, and easily told from noise. The rest of the map is as it should be.
///
/// Relative poses are *strained* when the rotation they measured and the one between their poses
/// differ by more than 0.2 rad; strained measurements that hang together are a coil when these
/// angles sum up to more than half a turn.
/// \returns places in the piece, ascending; nothing where nothing is wound up, which takes one
/// sweep over the relative poses of the piece, on all threads of the pool. The same for any number.
template <int D>
std::vector<int> coiled_poses(const MeasurementGraph<D>& graph, const Piece<D>& piece,
                              Places& places, WorkerPool& pool);

/// Lays poses anew, from those around them inwards along the fewest measurements: what is left of
/// a chain's error then meets in one measurement, the shorter way round. Variables that only these
/// poses see follow the first that sees them. Poses that no measurement reaches stay. Nothing is
/// solved; a refinement has to follow. Sweeps over the observations of the piece.
template <int D>
void lay_anew(const MeasurementGraph<D>& graph, Piece<D>& piece, Places& places,
              const std::vector<int>& poses);

}  // namespace mapjoin
