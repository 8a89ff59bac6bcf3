#pragma once

#include <cstdint>
#include <vector>

#include "mapjoin/association/candidates.h"

/// \file
/// Which of the candidate pairs are right: the last step of data association. Each variable of
/// either map stands in one pair at most.

namespace mapjoin {

/// How pairs are chosen.
enum class Matcher {
  kNearest,  ///< nn: every variable of B takes the nearest of A
  kGlobal,   ///< gnn: the assignment with the least sum of distances
  kJoint     ///< jcbb: the most pairs that are right together
};

/// The pairs chosen, and whether they are what was looked for.
struct Matching {
  std::vector<int> pairs;  ///< numbers of candidate pairs, ascending
  bool complete = true;    ///< false: the search was cut short, and this is the best it had found
  std::int64_t hypotheses = 0;  ///< that were looked at
};

/// Nearest neighbour with a gate: every variable of B takes the variable of A with the least chi2
/// of the innovation. Where two want the same, the nearer has it, the other stays unmatched.
/// Every pair is judged on its own. O(pairs log pairs).
Matching match_nearest(const CandidatePairs& pairs);

/// Global nearest neighbour: of all assignments the one with the least sum of chi2, where leaving a
/// variable of B unmatched costs the gate. Every pair is judged on its own, but conflicts are
/// settled for the best of all. O(n^3) in the largest set of variables that candidates connect.
Matching match_globally(const CandidatePairs& pairs);

struct JointOptions {
  double gate = 0.9999;  ///< probability with which a right hypothesis is within the joint gate
  std::int64_t most_hypotheses = 5000;  ///< then the best so far is taken, and `complete` is false
};

/// Joint compatibility branch and bound (Neira and Tardos 2001): the hypothesis with most pairs,
/// of equals the one with the least joint chi2.
///
/// A hypothesis is compatible when its joint chi2, with the covariances between all its pairs, is
/// within the joint gate; and each of its pairs, given those taken before it, within its own. The
/// second is no part of the original: among a hundred right pairs the joint gate alone has room for
/// a wrong one. Next is always the variable with the fewest candidates left, of equals the one that
/// is predicted best: so what is certain comes first, and what it leaves possible of the rest is
/// what the bound counts. \throws InputError for a gate that is no probability.
Matching match_jointly(const CandidatePairs& pairs, const JointOptions& options = {});

/// By name.
Matching match(const CandidatePairs& pairs, Matcher matcher, const JointOptions& options = {});

}  // namespace mapjoin
