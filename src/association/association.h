#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "mapjoin/association/candidates.h"
#include "mapjoin/association/check_matches.h"
#include "mapjoin/association/matchers.h"

/// \file
/// Data association: which variables of two maps are the same, where keys do not say.
///
///     const Association found = associate(a, b);
///     const Map<2> joined = join(a, rename_keys(b, names_in_a(found)));
///
/// What has equal keys in both maps is the same variable, as everywhere in mapjoin; the rest is
/// matched. So keys that mean nothing across maps must differ (own_keys() in associated_join.h
/// makes them so). Any join, filter or mode goes on from there.

namespace mapjoin {

struct AssociationOptions {
  Matcher matcher = Matcher::kJoint;
  CandidateOptions candidates;
  JointOptions joint;
  /// Matches that are no better than chance are not made, nor those of which another hypothesis is
  /// nearly as likely: by less than this factor (rivals.h). 0: all are made that the matcher finds.
  double odds = 1000.0;
  /// Probability that a join of right matches is reported to hold a wrong one; see check_matches.h.
  double false_alarm = 0.01;
};

/// One variable that is in both maps.
struct Match {
  Key a, b;
  double chi2 = 0.0;  ///< of the innovation given all other matches
  int dimension = 0;
  double bound = 0.0;       ///< above it the match is suspicious
  bool ambiguous = false;   ///< another variable of A would do, all else being as matched
  bool suspicious = false;  ///< it does not agree with the others: see TestedPair::flagged
};

/// What two maps have in common.
struct Association {
  std::vector<Match> matches;  ///< ascending by b
  std::vector<Key> unmatched;  ///< variables of B that A does not have: new ones
  /// Of these, the ones that are not clearly new: some variable of A would do, but was taken or did
  /// not agree with the rest.
  std::vector<Key> doubtful;
  /// What the maps share by key, tested against the matches. Suspicious ones are flagged.
  std::vector<TestedPair> known;
  bool complete = true;         ///< false: joint compatibility was cut short (JointOptions)
  std::int64_t candidates = 0;  ///< pairs within the gate
  std::int64_t hypotheses = 0;  ///< that the matcher looked at

  int ambiguous() const;
  int suspicious() const;
};

/// Which variables of B are in A: candidates (candidates.h), a matcher (matchers.h), and a test of
/// what it found (check_matches.h). What could as well be chance or otherwise is not matched
/// (rivals.h); such variables are `doubtful`.
///
/// The maps must share by key what fixes the frame they are compared in: a pose, or points.
/// \throws DisconnectedError when they do not (see constellations.h); SingularError; InputError for
/// options that are no probabilities or types.
template <int D>
Association associate(const Map<D>& a, const Map<D>& b, const AssociationOptions& options = {});

/// The same in a frame of the caller's choice.
template <int D>
Association associate(const ComparedMaps<D>& maps, const AssociationOptions& options = {});

/// The new names of B's variables: those they have in A.
std::vector<std::pair<Key, Key>> names_in_a(const Association& association);

}  // namespace mapjoin
