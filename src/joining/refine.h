#pragma once

#include <span>
#include <vector>

#include "mapjoin/graph/piece.h"
#include "mapjoin/joining/options.h"
#include "mapjoin/solvers/observation_system.h"

namespace mapjoin {

/// The solve that led to a piece's values, where its factor is still there to be used again.
struct LastSolve {
  double chi2 = 0.0;       ///< before its step
  double promised = -1.0;  ///< decrease of chi2, by the linear model; negative: there was none
  std::vector<std::vector<double>> values = {};  ///< the piece's, before its step
};

/// What an iteration of solves did.
struct RefineResult {
  double chi2_before = 0.0;  ///< where it began
  double chi2 = 0.0;         ///< at the end
  int solves = 0;
  int factorizations = 0;  ///< of them; the others used an old one
  int shortened = 0;       ///< steps that had to be shortened because chi2 would have grown
  bool minimum = false;    ///< what is left above the minimum is within the tolerance
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
/// After a solve that promised no more than half of chi2 its factor serves again, as long as a step
/// by it can be the last: for a chord step (ObservationSystem::solve_again), where that promises no
/// more than twenty times the tolerance; else to correct what the last step missed (correct). A
/// chord step's m is about twice that of the solve before, so that four times the rate counts; what
/// corrections left was that of ten times the rate, or more where they missed more. Neither is
/// taken where chi2 would increase. After a chord step that kept nine tenths of its promise there
/// may be another; a correction is only for where the last whole step led, and needs the values of
/// `last_solve`. Otherwise a whole solve follows. A `last_solve` that promised more than half of
/// chi2 gets a chord step as well, as joins end near the minimum however far they came; but only
/// where that promises no more than the tolerance itself, since its m may be anything.
///
/// Never increases chi2: a step that would is halved until it does not. Same symbolic plan for
/// every solve. \throws SingularError; CancelledError.
template <int D>
RefineResult refine(const MeasurementGraph<D>& graph, Piece<D>& piece, ObservationSystem<D>& system,
                    FrontalCholesky& cholesky, WorkerPool& pool, int most_solves, double tolerance,
                    const ProgressCallback& progress, LastSolve last_solve = {});

/// The same over all observations of a graph, from given values, such as a truth or another
/// solver's result; by one thread, planned anew.
template <int D>
RefineResult refine_from(const MeasurementGraph<D>& graph, const Values<D>& values, int most_solves,
                         double tolerance);

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
