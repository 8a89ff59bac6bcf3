#pragma once

#include <span>
#include <vector>

#include "mapjoin/association/associated_join.h"
#include "mapjoin/association/constellations.h"

namespace mapjoin {

/// Finished maps under names that say what they have in common.
template <int D>
struct AssociatedSessions {
  std::vector<Map<D>> maps;  ///< in the order given, ready for join_all
  AssociationReport report;
};

/// Associates each map with all those before it: recordings of several days, or of several robots.
///
/// Maps that share a pose or points by key are compared in the frame of those; others are placed by
/// constellations first (constellations.h). Where nothing is found the maps stay apart, and a
/// warning says so; what is found gets the names of the earlier map. \throws SingularError;
/// InputError.
template <int D>
AssociatedSessions<D> associate_sessions(std::span<const Map<D>> maps,
                                         const AssociationOptions& options = {},
                                         const ConstellationOptions& constellations = {});

}  // namespace mapjoin
