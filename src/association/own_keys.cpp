#include "mapjoin/association/own_keys.h"

#include <algorithm>
#include <utility>

#include "mapjoin/graph/error.h"
#include "mapjoin/graph/rename_keys.h"

namespace mapjoin {

namespace {

/// Pairs of equal elements: n (n - 1) / 2 of a run of n.
template <class T>
std::int64_t equal_pairs(std::vector<T> items) {
  std::sort(items.begin(), items.end());
  std::int64_t pairs = 0;
  std::int64_t run = 0;
  for (std::size_t k = 1; k < items.size(); ++k) {
    run = items[k] == items[k - 1] ? run + 1 : 0;
    pairs += run;
  }
  return pairs;
}

}  // namespace

template <int D>
OwnKeys<D> own_keys(std::span<const LocalMap<D>> local_maps, const CandidateOptions& options) {
  OwnKeys<D> out;
  std::uint64_t next = 1;
  for (std::size_t m = 0; m < local_maps.size(); ++m) {
    const LocalMap<D>& map = local_maps[m];
    std::vector<Key> seen;
    for (std::size_t i = 0; i < map.keys.size(); ++i) {
      if (may_be_matched(*map.kinds[i], options)) seen.push_back(map.keys[i]);
    }
    std::sort(seen.begin(), seen.end());
    seen.erase(std::unique(seen.begin(), seen.end()), seen.end());
    std::vector<std::pair<Key, Key>> names;
    for (const Key& key : seen) {
      const Key own{key.type, key.session, next++};
      names.emplace_back(key, own);
      out.sightings.push_back({own, key, static_cast<int>(m)});
    }
    out.local_maps.push_back(rename_keys(map, Renaming(std::move(names))));
  }
  std::sort(out.sightings.begin(), out.sightings.end(),
            [](const Sighting& a, const Sighting& b) { return a.key < b.key; });
  return out;
}

AssociationScore score(std::span<const Key> found, std::span<const Key> named) {
  if (found.size() != named.size())
    throw InputError(
        "a score needs both names of every sighting: what was found, and what is true");
  std::vector<std::pair<Key, Key>> both;
  for (std::size_t k = 0; k < found.size(); ++k) both.emplace_back(found[k], named[k]);
  return {equal_pairs(std::vector<Key>(found.begin(), found.end())),
          equal_pairs(std::vector<Key>(named.begin(), named.end())), equal_pairs(std::move(both))};
}

#define MAPJOIN_INSTANTIATE(D) \
  template OwnKeys<D> own_keys<D>(std::span<const LocalMap<D>>, const CandidateOptions&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
