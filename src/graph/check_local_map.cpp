#include "mapjoin/graph/check_local_map.h"

#include <fmt/format.h>

#include <algorithm>

#include "mapjoin/graph/error.h"
#include "mapjoin/graph/index.h"

namespace mapjoin {

namespace {

constexpr double kInFrame = 1e-6;  // what may be lost by writing values as text

/// Values of the anchor's variables where they are terms; empty for those that are none.
template <int D>
std::vector<std::vector<double>> anchor_terms(const LocalMap<D>& map) {
  const std::vector<Key>& anchor = map.anchor.keys;
  std::vector<std::vector<double>> out(anchor.size());
  const double* x = map.values.data();
  for (std::size_t k = 0; k < map.keys.size(); x += map.kinds[k++]->value_size) {
    const auto found = std::find(anchor.begin(), anchor.end(), map.keys[k]);
    if (found == anchor.end()) continue;
    out[static_cast<std::size_t>(found - anchor.begin())].assign(x, x + map.kinds[k]->value_size);
  }
  return out;
}

/// Number of doubles of an anchor's variable that is no term.
template <int D>
std::size_t size_beside_terms(const Key& key) {
  for (const VariableKind<D>* kind : {&kind_of<PoseType<D>>(), &kind_of<PointType<D>>()}) {
    if (kind->tag == key.type) return at(kind->value_size);
  }
  throw InputError(
      fmt::format("{} is in the anchor of a local map but not among its terms, and nothing else "
                  "says what a '{}' is: add it as a term, with zero information where it is pinned",
                  to_string(key), key.type.text()));
}

/// Values that are not where their anchor says would be compared in a wrong frame. (A pose is
/// pinned whole and no term: it is where the others are measured from.)
template <int D>
void check_frame(const LocalMap<D>& map, const std::string& name) {
  const AnchorKind<D>& kind = *map.anchor.kind;
  if (kind.tag == Tag("pose")) return;
  std::vector<std::vector<double>> values = anchor_terms(map);
  std::vector<std::vector<double>> pinned = values;
  std::vector<double*> to;
  for (std::size_t k = 0; k < pinned.size(); ++k) {
    if (pinned[k].empty()) pinned[k].assign(size_beside_terms<D>(map.anchor.keys[k]), 0.0);
    to.push_back(pinned[k].data());
  }
  kind.pin(to.data());
  std::vector<const double*> given;
  double size = 1.0;
  for (std::size_t k = 0; k < pinned.size(); ++k) {
    given.push_back(values[k].empty() ? pinned[k].data() : values[k].data());
    for (const double v : values[k]) size = std::max(size, std::abs(v));
  }
  const Rigid<D> into = kind.frame(given.data(), map.anchor.keys.data());
  if ((into.R - Mat<D, D>::Identity()).cwiseAbs().maxCoeff() < kInFrame &&
      into.t.cwiseAbs().maxCoeff() < kInFrame * size)
    return;
  throw InputError(name +
                   " is not written in the frame of its anchor: move its values into that frame");
}

}  // namespace

template <int D>
void check_anchor(const Anchor<D>& anchor) {
  if (anchor.kind == nullptr) {
    throw InputError(
        "an anchor needs a kind and as many keys as the kind asks for; build it with "
        "pose_anchor(key) or points_anchor(key, key)");
  }
  const AnchorKind<D>& kind = *anchor.kind;
  if (static_cast<int>(anchor.keys.size()) != kind.arity) {
    throw InputError(fmt::format("an anchor of kind '{}' in {}D needs {} key{}, not {}",
                                 kind.tag.text(), D, kind.arity, kind.arity == 1 ? "" : "s",
                                 anchor.keys.size()));
  }
  for (std::size_t k = 0; k < anchor.keys.size(); ++k) {
    const Key& key = anchor.keys[k];
    if (key.type != kind.types[k]) {
      throw InputError(fmt::format("anchor {}: {} is not of type '{}'", kind.tag.text(),
                                   to_string(key), kind.types[k].text()));
    }
    const auto end = anchor.keys.begin() + static_cast<std::ptrdiff_t>(k);
    if (std::find(anchor.keys.begin(), end, key) != end) {
      throw InputError(fmt::format("anchor {}: {} stands in it twice; name different variables",
                                   kind.tag.text(), to_string(key)));
    }
  }
}

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
  try {
    check_anchor(map.anchor);
  } catch (const InputError& error) {
    throw InputError(name() + ": " + error.what());
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
  check_frame(map, name());
}

#define MAPJOIN_INSTANTIATE(D)                                     \
  template void check_type<D>(const VariableKind<D>&, const Key&); \
  template void check_anchor<D>(const Anchor<D>&);                 \
  template void check_local_map<D>(const LocalMap<D>&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
