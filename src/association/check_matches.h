#pragma once

#include <span>
#include <vector>

#include "mapjoin/association/candidates.h"

/// \file
/// A wrong match does not pass silently. Every pair of variables that a join fuses is tested
/// against all the others that the join fuses: does what they say of it agree with what it says
/// itself?
///
/// With the innovations r of all fused pairs, their joint covariance S and K = S^-1, the innovation
/// of pair p given all others is K_pp^-1 (K r)_p with covariance K_pp^-1, so that
///
///     chi2_p = (K r)_p^T K_pp^-1 (K r)_p
///
/// is chi-squared with the pair's dimension when all is well. Tests, not decisions: nothing is
/// removed from any map.

namespace mapjoin {

/// A fused pair and how well it agrees with the rest.
struct TestedPair {
  Key a, b;              ///< the variable's key in either map (equal, where it was given by key)
  double chi2 = 0.0;     ///< of its innovation given all pairs that are not flagged
  int dimension = 0;     ///< degrees of freedom; 0: the frame pins it, so it cannot be tested
  double bound = 0.0;    ///< what chi2 stays below unless something is wrong
  bool flagged = false;  ///< it does not
};

/// Tests some of the pairs (numbers) together with the known ones.
///
/// A wrong pair also makes right ones look wrong. So the worst is flagged and left out, the rest
/// tested again, until all agree; then those flagged are tested once more against the rest, and
/// cleared where they agree after all. `false_alarm` is the probability that a join of which every
/// match is right has any pair flagged; each pair has its share. \returns one entry for each known
/// pair, then for each of `chosen`. O((dimension of all pairs)^3).
template <int D>
std::vector<TestedPair> test_pairs(const ComparedMaps<D>& maps, const CandidatePairs& pairs,
                                   std::span<const int> chosen, double false_alarm = 0.01);

/// Tests what two maps share by key, before they are joined or after: with given data association,
/// or after rename_keys().
/// \throws DisconnectedError when they do not share enough to be compared.
template <int D>
std::vector<TestedPair> check_matches(const Map<D>& a, const Map<D>& b, double false_alarm = 0.01);

}  // namespace mapjoin
