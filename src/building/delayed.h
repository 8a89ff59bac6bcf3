// Features that no single measurement places.
#pragma once

#include <cstdint>
#include <vector>

#include "mapjoin/building/local_problem.h"

namespace mapjoin {

/// Places features whose measurements say only part of where they are (a range, a bearing), from
/// several measurements at a time, where the geometry allows it.
///
/// Hypotheses of all measurements of a feature are refined by Gauss-Newton with the poses where
/// they are, each to the nearest minimum of its measurements' chi2. A feature is placed when
///   - its standard deviation in the worst direction is below a fifth of its distance from the
///     nearest pose that measures it, so that a linearisation there means something; and
///   - the best minimum is alone: any other that is not the same place fits worse by 25 in chi2.
///     Two ranges leave two places, bearings along a line none.
///
/// Sets `values` and `known` of those it can place. \returns the measurements of the others,
/// ascending numbers of the recording: refused, to be carried over. O(measurements x hypotheses).
template <int D>
std::vector<std::int64_t> place_delayed(const LocalProblem<D>& problem, InitialValues<D>& values);

}  // namespace mapjoin
