#include "mapjoin/building/filter.h"

#include "mapjoin/building/kalman_filter.h"

namespace mapjoin {

template <int D>
FilteredMap<D> filter(const LocalProblem<D>& problem, const InitialValues<D>& values,
                      std::span<const char> keep) {
  KalmanFilter<D> filter(problem, values, keep);
  while (filter.step()) {
  }
  return {filter.map(), filter.chi2()};
}

template FilteredMap<2> filter<2>(const LocalProblem<2>&, const InitialValues<2>&,
                                  std::span<const char>);
template FilteredMap<3> filter<3>(const LocalProblem<3>&, const InitialValues<3>&,
                                  std::span<const char>);

}  // namespace mapjoin
