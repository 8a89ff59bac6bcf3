#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mapjoin/association/candidates.h"
#include "mapjoin/graph/map.h"

namespace mapjoin {

/// A variable as one local map saw it.
struct Sighting {
  Key key;        ///< its own: no other sighting has it
  Key original;   ///< what it was called in the local map
  int local_map;  ///< number of the local map, from 0
};

/// Local maps whose matchable variables have names of their own, so that none fuse but by
/// association.
template <int D>
struct OwnKeys {
  std::vector<LocalMap<D>> local_maps;
  std::vector<Sighting> sightings;  ///< ascending by key
};

/// Hides what the local maps call their features: in the order of the maps every variable that may
/// be matched gets the next number, from 1, in its session. Poses keep their names: which pose a
/// local map starts and ends at is known. O(n log n).
template <int D>
OwnKeys<D> own_keys(std::span<const LocalMap<D>> local_maps, const CandidateOptions& options = {});

/// How well sightings were put together, judged by their true names.
///
/// Counted are pairs of sightings: of all that are one variable by association, the part that is
/// one by name (precision); of all that are one by name, the part that is one by association
/// (recall). A variable that falls apart into two, or two that fuse, count by all their sightings.
struct AssociationScore {
  std::int64_t found = 0;   ///< pairs of sightings put together
  std::int64_t wanted = 0;  ///< pairs of sightings with the same name
  std::int64_t right = 0;   ///< pairs of which both are true

  double precision() const {
    return found == 0 ? 1.0 : static_cast<double>(right) / static_cast<double>(found);
  }
  double recall() const {
    return wanted == 0 ? 1.0 : static_cast<double>(right) / static_cast<double>(wanted);
  }
};

/// `found[k]` is what sighting k was found to be, `named[k]` what it is called. O(n log n).
/// \throws InputError when there are not as many of both.
AssociationScore score(std::span<const Key> found, std::span<const Key> named);

}  // namespace mapjoin
