// A local map by an extended Kalman filter.
#pragma once

#include <span>

#include "mapjoin/building/local_problem.h"
#include "mapjoin/graph/map.h"

namespace mapjoin {

/// What a filter makes of the measurements, and the sum of its normalised innovations squared.
template <int D>
struct FilteredMap {
  Map<D> map;
  double chi2 = 0.0;
};

/// All measurements of a problem by EKF-SLAM (kalman_filter.h), which has the arguments. The map
/// has all kept variables. \throws SingularError when the covariance loses its definiteness.
template <int D>
FilteredMap<D> filter(const LocalProblem<D>& problem, const InitialValues<D>& values,
                      std::span<const char> keep);

}  // namespace mapjoin
