#include "mapjoin/association/check_matches.h"

#include <fmt/format.h>

#include <algorithm>

#include "mapjoin/association/joint_innovation.h"
#include "mapjoin/evaluation/chi_squared.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/graph/index.h"

namespace mapjoin {

namespace {

/// The bounds of n tests that together raise a false alarm with the given probability.
std::vector<double> bounds_of(const JointInnovation& joint, double false_alarm) {
  if (!(false_alarm > 0.0 && false_alarm < 1.0))
    throw InputError(fmt::format("the probability of a false alarm must be between 0 and 1, not {}",
                                 false_alarm));
  std::vector<double> by_dimension;
  std::vector<double> out;
  for (int k = 0; k < joint.size(); ++k) {
    const int n = joint.dimension(k);
    while (static_cast<int>(by_dimension.size()) <= n) {
      const int m = static_cast<int>(by_dimension.size());
      by_dimension.push_back(m == 0 ? 0.0
                                    : chi_squared_quantile(1.0 - false_alarm / joint.size(), m));
    }
    out.push_back(by_dimension[at(n)]);
  }
  return out;
}

/// Doubts the worst pair, as often as one is above its bound.
void doubt_the_worst(JointInnovation& joint, const std::vector<double>& bounds) {
  for (;;) {
    int worst = -1;
    double excess = 1.0;
    for (int k = 0; k < joint.size(); ++k) {
      if (!joint.believed(k) || joint.dimension(k) == 0) continue;
      const double here = joint.chi2(k) / bounds[at(k)];
      if (here <= excess) continue;
      excess = here;
      worst = k;
    }
    if (worst < 0) return;
    joint.doubt(worst);
  }
}

}  // namespace

template <int D>
std::vector<TestedPair> test_pairs(const ComparedMaps<D>& maps, const CandidatePairs& pairs,
                                   std::span<const int> chosen, double false_alarm) {
  std::vector<int> all;
  for (int p = 0; p < pairs.known; ++p) all.push_back(p);
  all.insert(all.end(), chosen.begin(), chosen.end());
  if (all.empty()) return {};
  JointInnovation joint(pairs, all);
  const std::vector<double> bounds = bounds_of(joint, false_alarm);
  doubt_the_worst(joint, bounds);
  std::vector<TestedPair> out;
  for (int k = 0; k < joint.size(); ++k) {
    const CandidatePairs::Pair& pair = pairs.pairs[at(all[at(k)])];
    TestedPair tested{maps.a.variables().key(pair.a),
                      maps.b.variables().key(pair.b),
                      0.0,
                      joint.dimension(k),
                      bounds[at(k)],
                      false};
    if (tested.dimension > 0)
      tested.chi2 = joint.believed(k) ? joint.chi2(k) : joint.chi2_of_doubted(k);
    tested.flagged = !joint.believed(k) && tested.chi2 > tested.bound;
    out.push_back(tested);
  }
  return out;
}

template <int D>
std::vector<TestedPair> check_matches(const Map<D>& a, const Map<D>& b, double false_alarm) {
  const ComparedMaps<D> maps = in_common_frame(a, b);
  return test_pairs<D>(maps, common_pairs(maps), {}, false_alarm);
}

#define MAPJOIN_INSTANTIATE(D)                                                                  \
  template std::vector<TestedPair> test_pairs<D>(const ComparedMaps<D>&, const CandidatePairs&, \
                                                 std::span<const int>, double);                 \
  template std::vector<TestedPair> check_matches<D>(const Map<D>&, const Map<D>&, double);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
