#include "mapjoin/association/arrivals.h"

#include <limits>

#include "mapjoin/graph/rename_keys.h"

namespace mapjoin {

namespace {

constexpr std::uint32_t kArriving =
    std::numeric_limits<std::uint32_t>::max();  // a session's number

}  // namespace

template <int D>
std::function<std::vector<std::pair<Key, Key>>(const Map<D>&, const Map<D>&)> associate_arrivals(
    const AssociationOptions& options) {
  return [options](const Map<D>& global, const Map<D>& local) {
    // Numbered by their places under a session of their own, so that no name is shared by accident.
    std::vector<Key> given;
    std::vector<std::pair<Key, Key>> hidden;
    for (const auto& column : local.variables().columns()) {
      if (!may_be_matched(*column.kind, options.candidates)) continue;
      for (const Key& key : column.keys) {
        hidden.emplace_back(key, Key{key.type, kArriving, given.size()});
        given.push_back(key);
      }
    }
    const Map<D> nameless = rename_keys(local, Renaming(std::move(hidden)));
    std::vector<std::pair<Key, Key>> out;
    for (const Match& match : associate(global, nameless, options).matches)
      out.emplace_back(given[match.b.id], match.a);
    return out;
  };
}

template std::function<std::vector<std::pair<Key, Key>>(const Map<2>&, const Map<2>&)>
associate_arrivals<2>(const AssociationOptions&);
template std::function<std::vector<std::pair<Key, Key>>(const Map<3>&, const Map<3>&)>
associate_arrivals<3>(const AssociationOptions&);

}  // namespace mapjoin
