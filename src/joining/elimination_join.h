#pragma once

#include <memory>
#include <vector>

#include "mapjoin/graph/piece.h"
#include "mapjoin/joining/options.h"
#include "mapjoin/joining/refine.h"
#include "mapjoin/solvers/observation_system.h"

namespace mapjoin {

/// The pieces at the root of a join, and what its last solve leaves for those that follow.
template <int D>
struct JoinedPieces {
  std::vector<Piece<D>> pieces;
  std::unique_ptr<ObservationSystem<D>> system;  ///< where there is one piece only: ready for more
  std::unique_ptr<FrontalCholesky> cholesky;     ///< its memory; may be null
  LastSolve last_solve;                          ///< of a single piece
};

/// The observing join along the elimination tree: the same fronts serve the join tree and every
/// solve in it.
///
/// Ordering and analysis of the whole graph are done once. A subtree of fronts eliminates a set of
/// variables that nothing outside knows but through the few it shares with the rest: that is a
/// submap. The tree is cut where subtrees first exceed leaf_variables, arity * leaf_variables,
/// arity^2 * leaf_variables, ... variables; at each cut the submaps below, and the observations
/// between, are laid on one another (place.h), all their observations are evaluated anew there, and
/// the subtree's fronts solve for one step, closed by a small dense system for what is shared.
/// Above all stands the solve of the whole. Where a subtree is not one rigid piece, its pieces are
/// solved one by one as systems of their own. \throws SingularError; CancelledError. Same bits for
/// any number of threads.
template <int D>
JoinedPieces<D> elimination_join(const MeasurementGraph<D>& graph, const JoinOptions& options,
                                 WorkerPool& pool, JoinReport& report);

}  // namespace mapjoin
