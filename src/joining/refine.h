#pragma once

#include <span>

#include "mapjoin/graph/piece.h"
#include "mapjoin/joining/options.h"
#include "mapjoin/solvers/observation_system.h"

namespace mapjoin {

/// Of chi2: what may be left above the minimum, by an estimate that is rather too large, wherever
/// nobody asks for another figure.
inline constexpr double kRefineTolerance = 2e-8;

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
/// `promised_before` is the promise of the solve that led to the piece's values, absolute; negative
/// where there was none: then the first step cannot be the last, but for a promise of next to
/// nothing (a hundredth of the tolerance).
///
/// Never increases chi2: a step that would is halved until it does not. Same symbolic plan for
/// every solve. \throws SingularError; CancelledError.
template <int D>
RefineResult refine(const MeasurementGraph<D>& graph, Piece<D>& piece, ObservationSystem<D>& system,
                    FrontalCholesky& cholesky, WorkerPool& pool, int most_solves, double tolerance,
                    const ProgressCallback& progress, double promised_before = -1.0);

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
