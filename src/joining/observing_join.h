#pragma once

#include <vector>

#include "mapjoin/graph/piece.h"
#include "mapjoin/joining/join_tree.h"
#include "mapjoin/joining/options.h"
#include "mapjoin/solvers/worker_pool.h"

namespace mapjoin {

/// Walks a join tree, maps keeping their observations: at each node the children are laid on one
/// another (place.h) and one linear solve over all observations of the node follows, each evaluated
/// in its own frame.
///
/// \returns the pieces at the root: one for each rigid part of the data, at the values of the last
/// solve, in arbitrary frames. Fills the linear part of the report. Same bits for any number of
/// threads. \throws SingularError naming a variable; CancelledError.
template <int D>
std::vector<Piece<D>> observing_join(const MeasurementGraph<D>& graph, const JoinTree& tree,
                                     const JoinOptions& options, WorkerPool& pool,
                                     JoinReport& report);

}  // namespace mapjoin
