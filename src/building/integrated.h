// A built local map as integrated observations.
#pragma once

#include <memory>

#include "mapjoin/building/local_problem.h"
#include "mapjoin/building/robust_loss.h"
#include "mapjoin/graph/map.h"

namespace mapjoin {

/// The local map as an observation of its variables from its anchor, a pose (SLSJF section II-A),
/// taken apart by the measurements it was made of.
///
/// As one observation it is a clique of all its variables. But its information is a sum over pairs,
/// J^T I J of each measurement at the map's values, and so is r^T I r of the whole: one observation
/// for each pair of variables, all from the same anchor at the same values, is the same quadratic
/// form, and stays as sparse as the measurements were. Every part is positive semidefinite, so any
/// of them may stand alone.
///
/// `map` is written in the frame of its anchor and has all variables of the problem.
/// O(measurements).
template <int D>
std::shared_ptr<const MeasurementGraph<D>> integrated_observations(const LocalProblem<D>& problem,
                                                                   const RobustLoss& loss,
                                                                   const Map<D>& map);

}  // namespace mapjoin
