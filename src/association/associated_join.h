#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "mapjoin/association/association.h"
#include "mapjoin/association/own_keys.h"
#include "mapjoin/joining/options.h"

/// \file
/// Joining local maps that do not know which of their features are the same: linear submap joining
/// with data association.
///
/// The maps are joined in order, in pairs of neighbours (divide and conquer, Linear SLAM section
/// 5.2) or each onto all before it (section 5.1). Every join associates first: what the two maps
/// know about one another by then, all of it, decides what is the same. A joined map is a summary,
/// one linear solve a join. The outcome is the joined map; and the local maps under the names that
/// were found, which any other join, filter or mode can start from.

namespace mapjoin {

/// What all joins found.
struct AssociationReport {
  std::int64_t sightings = 0;   ///< matchable variables of all local maps
  std::int64_t variables = 0;   ///< that they were found to be
  std::int64_t matches = 0;     ///< over all joins
  std::int64_t ambiguous = 0;   ///< matches for which there was another choice
  std::int64_t doubtful = 0;    ///< unmatched variables that are not clearly new
  std::int64_t suspicious = 0;  ///< matches that do not agree with the others of their join
  int cut_short = 0;            ///< joins whose search for joint compatibility was
  double seconds = 0.0;
  std::vector<std::string> warnings;  ///< suspicious matches, in sentences that name them
};

template <int D>
struct AssociatedMaps {
  /// The local maps under the names that were found: in the order of first sightings, from 1.
  std::vector<LocalMap<D>> local_maps;
  /// Every sighting under its name in its local map, and what it was found to be: names[k] of
  /// sightings[k].
  std::vector<Sighting> sightings;
  std::vector<Key> names;
  Map<D> joined;  ///< by the joins that associated, under these names
  AssociationReport report;
};

/// Associates and joins local maps. Neighbours must share by key what fixes one to the other: the
/// pose where one ends and the next starts. \throws DisconnectedError that names the local maps
/// that do not; SingularError; CancelledError; InputError.
template <int D>
AssociatedMaps<D> join_associating(std::span<const LocalMap<D>> local_maps,
                                   const AssociationOptions& options = {},
                                   Strategy strategy = Strategy::kDivideAndConquer,
                                   const ProgressCallback& progress = {});

/// Tests the given data association in the same way: every join of the same walk checks what its
/// two maps share by key (check_matches.h). \returns a report of suspicious matches. Errors as
/// above.
template <int D>
AssociationReport check_given_matches(std::span<const LocalMap<D>> local_maps,
                                      double false_alarm = 0.01,
                                      Strategy strategy = Strategy::kDivideAndConquer,
                                      const ProgressCallback& progress = {});

}  // namespace mapjoin
