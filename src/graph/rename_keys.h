#pragma once

#include <span>
#include <utility>
#include <vector>

#include "mapjoin/graph/map.h"

namespace mapjoin {

/// Other names for variables: what data association finds out, or what keeps two maps apart that
/// number their features alike.
class Renaming {
 public:
  /// Pairs of an old and a new key. \throws InputError when a key has two new ones, or one of
  /// another type.
  explicit Renaming(std::vector<std::pair<Key, Key>> names);

  /// The new key; a key that is not renamed stays as it is. O(log n).
  Key operator()(const Key& key) const;

  std::span<const std::pair<Key, Key>> names() const { return names_; }

 private:
  std::vector<std::pair<Key, Key>> names_;  // sorted
};

/// The same map under other keys: values, information, anchors and observations.
/// O(n log n). \throws InputError that names two variables of the map which would become one: maps
/// are told which of their variables are the same before they are joined, not after.
template <int D>
Map<D> rename_keys(const Map<D>& map, const Renaming& renaming);

/// The same for a local map as given. Terms that get the same key are two measurements of one
/// variable.
template <int D>
LocalMap<D> rename_keys(LocalMap<D> map, const Renaming& renaming);

/// The same for measurements.
template <int D>
MeasurementGraph<D> rename_keys(const MeasurementGraph<D>& graph, const Renaming& renaming);

}  // namespace mapjoin
