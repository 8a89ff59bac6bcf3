// Large local maps, in parts.
#pragma once

#include <vector>

#include "mapjoin/building/local_problem.h"
#include "mapjoin/building/robust_loss.h"

namespace mapjoin {

/// A local map of hundreds of poses is a SLAM problem like any other. The chain of its measurements
/// ends far from where it belongs, and nonlinear least squares started from there may end in a
/// local minimum: all of Victoria Park at 150 times the chi2 of the optimum. A filter of it is
/// dense, and linearises most where it knows least. So a large local map is what everything else is
/// here: its own measurements are cut into parts, the parts are built from their chains, and
/// joined. Nonlinear least squares then starts from where that ends.
///
/// Relative poses and points are joined as they are: every pose with what it measures is a part.
/// All other measurements, and all for a filter or a robust loss, make parts of this many poses; a
/// map is large above twice as many.
inline constexpr int kPartPoses = 50;

/// A filter is large above this many scalars in its state: its cost is their square at every pose.
inline constexpr int kLargestState = 400;

/// The measurements of a problem as parts, in order of time: each measurement in one, by the pose
/// that takes it, a relative pose by the later of both. Neighbours share a pose. Problems of the
/// same recording, pieces of parts where those fall apart. O(n log n).
template <int D>
std::vector<LocalProblem<D>> parts_of(const RawLog<D>& log, const LocalProblem<D>& problem);

/// chi2 of the measurements of what both starts know, with a robust loss the sum of its costs: of
/// two places to start from, the one with the smaller is nearer to the minimum. O(measurements).
template <int D>
double cost(const LocalProblem<D>& problem, const RobustLoss& loss, const InitialValues<D>& at,
            const InitialValues<D>& other);

}  // namespace mapjoin
