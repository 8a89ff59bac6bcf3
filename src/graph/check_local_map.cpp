#include "mapjoin/graph/check_local_map.h"

#include <fmt/format.h>

#include "mapjoin/graph/error.h"

namespace mapjoin {

namespace {

std::size_t at(int n) { return static_cast<std::size_t>(n); }

}  // namespace

template <int D>
void check_type(const VariableKind<D>& kind, const Key& key) {
  if (key.type == kind.tag) return;
  throw InputError(fmt::format("{} is given a value of type '{}': use a key of that type",
                               to_string(key), kind.tag.text()));
}

template <int D>
void check_local_map(const LocalMap<D>& map) {
  const auto name = [&] {
    return map.anchor.keys.empty() ? "a local map without an anchor"
                                   : "the local map at " + to_string(map.anchor.keys[0]);
  };
  if (map.anchor.kind == nullptr || map.anchor.keys.size() != at(map.anchor.kind->arity)) {
    throw InputError(name() + " needs an anchor with a kind and as many keys as the kind asks for");
  }
  std::size_t values = 0;
  for (const VariableKind<D>* kind : map.kinds) values += at(kind->value_size);
  if (map.kinds.size() != map.keys.size() || map.values.size() != values) {
    throw InputError(name() + ": its keys, kinds and values do not belong together; use add_term");
  }
  for (std::size_t k = 0; k < map.keys.size(); ++k) check_type(*map.kinds[k], map.keys[k]);
  const SymmetricBlockMatrix& info = map.information;
  bool same = info.size() == static_cast<int>(map.keys.size());
  for (int i = 0; same && i < info.size(); ++i) same = info.dim(i) == map.kinds[at(i)]->dim;
  if (!same) {
    throw InputError(
        fmt::format("{} has {} terms, and its information is not of their sizes: one block a term",
                    name(), map.keys.size()));
  }
}

#define MAPJOIN_INSTANTIATE(D)                                     \
  template void check_type<D>(const VariableKind<D>&, const Key&); \
  template void check_local_map<D>(const LocalMap<D>&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
