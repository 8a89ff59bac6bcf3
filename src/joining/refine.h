#pragma once

#include <span>

#include "mapjoin/graph/piece.h"
#include "mapjoin/joining/options.h"
#include "mapjoin/solvers/observation_system.h"

namespace mapjoin {

/// The solve that led to a piece's values, where its factor is still there to be used again.
struct LastSolve {
  double chi2 = 0.0;       ///< before its step
  double promised = -1.0;  ///< decrease of chi2, by the linear model; negative: there was none
};

/// What an iteration of solves did.
struct RefineResult {
  double chi2_before = 0.0;  ///< where it began
  double chi2 = 0.0;         ///< at the end
  int solves = 0;
  int shortened = 0;     ///< steps that had to be shortened because chi2 would have grown
  bool minimum = false;  ///< what is left above the minimum is within the tolerance
};

/// Repeats the linear solve of a piece, re-evaluating its observations, until no more than a
/// fraction `tolerance` of chi2 is left above the minimum: the nonlinear least squares optimum over
/// all observations (I-SLSJF, I-DMJ).
///
/// Nothing is solved only to see that nothing is left. Near the minimum, with Hessian H* where the
/// linear model has H, the error goes from e to M e, M = 1 - H^-1 H*. A step that promises the
/// decrease p, in a direction in which M is m, then brings p (1 + m) and leaves p m^2 / (1 - m).
/// So there are two estimates of m: from what the step missed of its promise, p |m|, and from the
/// rate p / p_before = m^2 at which promises fall. Both are used and the larger result counts: the
/// m of several directions can cancel in the first, and the rate lags behind where it grows.
/// Without `last_solve`, that is of the same system with the same `cholesky`, the first step cannot
/// be the last, but for a promise of next to nothing (a hundredth of the tolerance).
///
/// After a solve that promised no more than half of chi2 little turns, and H hardly changes: its
/// factor serves again, for the gradient of now (a chord step, at a third of the price or less).
/// M is then about twice what it was for the solve before, whose m^2 the rate shows: four times
/// the rate counts. Where elimination with the old factor promises more than thirty times the
/// tolerance, a whole solve follows at once; a chord step that would increase chi2 is not taken,
/// and after one that misses its promise by more than a tenth whole solves follow.
///
/// Never increases chi2: a step that would is halved until it does not. Same symbolic plan for
/// every solve. \throws SingularError; CancelledError.
template <int D>
RefineResult refine(const MeasurementGraph<D>& graph, Piece<D>& piece, ObservationSystem<D>& system,
                    FrontalCholesky& cholesky, WorkerPool& pool, int most_solves, double tolerance,
                    const ProgressCallback& progress, const LastSolve& last_solve = {});

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
