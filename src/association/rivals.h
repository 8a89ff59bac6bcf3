#pragma once

#include <vector>

#include "mapjoin/association/candidates.h"

/// \file
/// Matches that are not certain enough to be made, whatever chose them.
///
/// What matches are worth is the likelihood ratio of a hypothesis H against that of all its
/// variables being different ones,
///
///     log L(H) = log N(r_H; 0, S_H) - sum of log density
///
/// where the density says how many variables to expect near any place
/// (CandidatePairs::log_density). A wrong match costs much more than a missing one: it bends the
/// map for good.

namespace mapjoin {

/// The matches that are certain enough, ascending. Two kinds are taken back:
///
/// - those that, given all others, are no likelier than chance, the least likely first: a pair that
///   may still be metres apart when all the others are known says nothing;
/// - those of which another hypothesis, that lays the maps otherwise, is nearly as likely: regular
///   rows of trees fit one row farther on, too. Matches are looked at one by one, the most certain
///   first. Where a variable could as well be another, and that would contradict at least half of
///   the matches still to come, its consequences are followed to their end. Unless the matches are
///   `odds` times as likely then, this one is taken back.
///
/// What is left when some have gone may be no better than chance: so again, until nothing changes.
/// O(scalars^3), and as much for every alternative that is followed.
std::vector<int> certain_matches(const CandidatePairs& pairs, std::vector<int> matched,
                                 double odds);

}  // namespace mapjoin
