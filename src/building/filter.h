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

/// EKF-SLAM in the frame of the first pose (SLSJF section II-B): the state is predicted by each
/// measurement that reaches a new pose, augmented by the first complete measurement of a feature,
/// and updated once a pose by all others taken there. Every measurement is linearised once, where
/// the filter believes to be then.
///
/// `values` says where features are that no single measurement places (delayed.h): their
/// measurements are the last, when all that is known of the poses is in. `keep` marks variables;
/// other poses are dropped when nothing refers to them any more, which is what makes a filter
/// cheap. The first pose is always kept. The map has all kept variables and exact gauge-free
/// information, J^T P^-1 J. Dense in the state: O(measurements x state^2).
/// \throws SingularError when the covariance loses its definiteness.
template <int D>
FilteredMap<D> filter(const LocalProblem<D>& problem, const InitialValues<D>& values,
                      std::span<const char> keep);

}  // namespace mapjoin
