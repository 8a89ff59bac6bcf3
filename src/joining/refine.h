#pragma once

#include <span>

#include "mapjoin/graph/piece.h"
#include "mapjoin/joining/options.h"
#include "mapjoin/solvers/observation_system.h"

namespace mapjoin {

/// What an iteration of solves did.
struct RefineResult {
  double chi2 = 0.0;  ///< at the end
  int solves = 0;
  int shortened = 0;     ///< steps that had to be shortened because chi2 would have grown
  bool minimum = false;  ///< the linear model promises no further decrease
};

/// Repeats the linear solve of a piece, re-evaluating its observations, until it promises no more
/// than a fraction `tolerance` of chi2: the nonlinear least squares optimum over all observations
/// (I-SLSJF, I-DMJ).
///
/// Never increases chi2: a step that would is halved until it does not. Same symbolic plan for
/// every solve. \throws SingularError; CancelledError.
template <int D>
RefineResult refine(const MeasurementGraph<D>& graph, Piece<D>& piece, ObservationSystem<D>& system,
                    FrontalCholesky& cholesky, WorkerPool& pool, int most_solves, double tolerance,
                    const ProgressCallback& progress);

/// One solve and the step it asks for, without any question. \returns what the linear model said.
/// \throws SingularError.
template <int D>
typename ObservationSystem<D>::Step linear_step(const MeasurementGraph<D>& graph, Piece<D>& piece,
                                                ObservationSystem<D>& system,
                                                FrontalCholesky& cholesky, WorkerPool& pool);

/// The same below the root of a tree: a piece that its own observations do not determine stays as
/// it was placed. Measurements may be semidefinite, and those of other pieces can say the rest; the
/// root tells if none do.
template <int D>
void linear_step_if_determined(const MeasurementGraph<D>& graph, Piece<D>& piece,
                               ObservationSystem<D>& system, FrontalCholesky& cholesky,
                               WorkerPool& pool);

}  // namespace mapjoin
