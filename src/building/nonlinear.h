// Nonlinear least squares over the measurements of one local map.
#pragma once

#include "mapjoin/building/local_problem.h"
#include "mapjoin/building/robust_loss.h"
#include "mapjoin/graph/map.h"

namespace mapjoin {

/// What the solver did.
struct SolveSummary {
  double chi2 = 0.0;  ///< at the end; with a robust loss, the sum of its costs
  int iterations = 0;
};

/// Moves `values` (all of them placed, written in the frame of the first pose, which stays at the
/// identity) to the minimum of the measurements' chi2, by Ceres over increments.
///
/// Where there are as many measured numbers as unknown ones the values fit exactly and nothing is
/// done. \throws Error when it does not converge within `max_iterations`.
template <int D>
SolveSummary minimise(const LocalProblem<D>& problem, const RobustLoss& loss, int max_iterations,
                      Values<D>& values);

/// Gauge-free information of the measurements at `values`: the sum of J^T I J over all variables,
/// each measurement as often as the loss counts it. Exact, as every measurement is one of a
/// relative position: moving the map moves no residual.
template <int D>
SymmetricBlockMatrix information_at(const LocalProblem<D>& problem, const RobustLoss& loss,
                                    const Values<D>& values);

}  // namespace mapjoin
