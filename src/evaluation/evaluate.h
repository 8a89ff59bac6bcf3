#pragma once

#include <span>

#include "mapjoin/graph/map.h"

namespace mapjoin {

/// chi2 of an estimate against measurements: the sum of r^T I r, r = local(z, estimate in the
/// anchor's frame). \throws InputError that names a variable the measurements need and the estimate
/// lacks. O(measurements).
template <int D>
double chi2(const Values<D>& estimate, const MeasurementGraph<D>& graph);

/// How far an estimate lies from a reference, in metres, per coordinate as in the papers.
struct Deviation {
  std::size_t poses = 0;     ///< common poses
  std::size_t features = 0;  ///< common points
  double pose_rmse =
      0.0;  ///< both written in the frame of the lowest common pose, which itself does not count
  double feature_rmse = 0.0;
  double relative_rmse = 0.0;  ///< positions of consecutive common poses relative to each other
  double aligned_feature_rmse =
      0.0;  ///< after the best rigid fit of the points: the figure for maps without poses
};

/// How far `estimate` lies from `reference`, over the variables that both have.
template <int D>
Deviation deviation(const Values<D>& estimate, const Values<D>& reference);

}  // namespace mapjoin
