#pragma once

#include <Eigen/Core>

#include "mapjoin/graph/map.h"

namespace mapjoin {

/// Is a map as good as it says? The normalised estimation error squared, NEES = e^T I e, over the
/// variables whose truth is known, and where it should be.
///
/// For a consistent map NEES is chi-squared with `dimension` degrees of freedom: about `dimension`,
/// within lower .. upper with the probability asked for. Far above: the map is overconfident. Far
/// below: it is too modest.
struct Consistency {
  double nees = 0.0;
  int dimension = 0;
  double confidence = 0.95;
  double lower = 0.0;  ///< two-sided: between lower and upper with probability `confidence`
  double upper = 0.0;
  double one_sided = 0.0;  ///< at most this with probability `confidence`: the bound of Table 3

  bool consistent() const { return lower <= nees && nees <= upper; }
};

/// NEES of a map against the truth of some of its variables.
///
/// The truth may be written in any frame and have further variables. It is written in the map's
/// frame first, so it must have what the map's anchor pins. Errors are in the tangents that the
/// information is in, e = local(estimate, truth); the information is that on the variables in
/// question, the others marginalised: features alone when only features are known. What the anchor
/// pins has no error and does not count in the dimension. On a map without an anchor the truth is
/// laid by the best rigid fit: to first order NEES is the same in every frame.
///
/// One sparse factorisation of the information on what is not known. \throws InputError when the
/// truth lacks the anchor or shares nothing else with the map, or when the map has no information;
/// DegenerateFrameError; SingularError.
template <int D>
Consistency consistency(const Map<D>& map, const Values<D>& truth, double confidence = 0.95);

/// How many errors are inside their bounds, coordinate by coordinate.
struct Coverage {
  int inside = 0;
  int count = 0;
  double share() const { return count > 0 ? static_cast<double>(inside) / count : 0.0; }
};

/// The errors of a map that are within `sigmas` standard deviations, of the variables whose truth
/// is known: the bounds that papers draw (SLSJF's Fig. 3(c)). Of a consistent map 95.4% are within
/// two on average over many maps; within one map errors are correlated, and a turn of the whole map
/// is an error of every feature. Errors as in consistency(); what the anchor pins does not count.
/// One factorisation and selected inversion. \throws as consistency() does.
template <int D>
Coverage coverage(const Map<D>& map, const Values<D>& truth, double sigmas = 2.0);

/// The ellipse (ellipsoid) that holds a position with the probability `confidence`, centred at the
/// estimate.
template <int D>
struct ConfidenceRegion {
  Vec<D> semi_axes;  ///< lengths, the largest first
  Mat<D, D> axes;    ///< their directions, as columns: a rotation
};

/// Of a D x D covariance of a position. \throws InputError unless 0 < confidence < 1.
template <int D>
ConfidenceRegion<D> confidence_region(const Mat<D, D>& covariance, double confidence = 0.95);

}  // namespace mapjoin
