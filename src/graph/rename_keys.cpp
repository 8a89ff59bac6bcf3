#include "mapjoin/graph/rename_keys.h"

#include <fmt/format.h>

#include <algorithm>

#include "mapjoin/graph/error.h"
#include "mapjoin/graph/index.h"

namespace mapjoin {

namespace {

template <int D>
void rename_anchor(Anchor<D>& anchor, const Renaming& renaming) {
  for (Key& key : anchor.keys) key = renaming(key);
}

/// Local map k of a graph, as it was given but for the names.
template <int D>
LocalMap<D> renamed_submap(const MeasurementGraph<D>& graph, std::size_t k,
                           const Renaming& renaming) {
  const SubmapObservations<D>& maps = graph.submaps;
  LocalMap<D> out;
  out.anchor.kind = maps.anchors[k];
  for (auto a = maps.anchor_start[k]; a < maps.anchor_start[k + 1]; ++a)
    out.anchor.keys.push_back(renaming(graph.variables.key(maps.anchor_variables[at(a)])));
  std::vector<int> offsets{0};
  for (auto t = maps.term_start[k]; t < maps.term_start[k + 1]; ++t) {
    const int v = maps.term_variable[at(t)];
    const VariableKind<D>& kind = graph.variables.kind(v);
    const auto x = maps.values.begin() + maps.term_value[at(t)];
    out.kinds.push_back(&kind);
    out.keys.push_back(renaming(graph.variables.key(v)));
    out.values.insert(out.values.end(), x, x + kind.value_size);
    offsets.push_back(offsets.back() + kind.dim);
  }
  std::vector<std::pair<int, int>> pattern;
  for (auto b = maps.block_start[k]; b < maps.block_start[k + 1]; ++b)
    pattern.emplace_back(maps.block_row[at(b)], maps.block_column[at(b)]);
  out.information = SymmetricBlockMatrix(offsets, pattern);
  for (auto b = maps.block_start[k]; b < maps.block_start[k + 1]; ++b) {
    const int i = maps.block_row[at(b)];
    const int j = maps.block_column[at(b)];
    out.information.add(
        i, j,
        Eigen::Map<const Eigen::MatrixXd>(maps.information.data() + maps.block_value[at(b)],
                                          out.information.dim(i), out.information.dim(j)));
  }
  return out;
}

/// The information in the order of the new keys: variable i becomes place[i].
SymmetricBlockMatrix permuted(const SymmetricBlockMatrix& information,
                              const std::vector<int>& place, std::vector<int> offsets) {
  if (information.size() == 0) return {};
  std::vector<std::pair<int, int>> pattern;
  for (int j = 0; j < information.size(); ++j) {
    for (std::int64_t s = information.begin(j); s < information.end(j); ++s)
      pattern.emplace_back(place[at(information.row(s))], place[at(j)]);
  }
  SymmetricBlockMatrix out(std::move(offsets), pattern);
  for (int j = 0; j < information.size(); ++j) {
    for (std::int64_t s = information.begin(j); s < information.end(j); ++s) {
      const int i = information.row(s);
      out.add(place[at(i)], place[at(j)],
              Eigen::Map<const Eigen::MatrixXd>(information.block(s), information.dim(i),
                                                information.dim(j)));
    }
  }
  return out;
}

}  // namespace

Renaming::Renaming(std::vector<std::pair<Key, Key>> names) : names_(std::move(names)) {
  std::sort(names_.begin(), names_.end());
  names_.erase(std::unique(names_.begin(), names_.end()), names_.end());
  for (std::size_t k = 0; k < names_.size(); ++k) {
    const auto& [old, now] = names_[k];
    if (old.type != now.type)
      throw InputError(fmt::format("{} cannot be renamed to {}, which is of another type",
                                   to_string(old), to_string(now)));
    if (k > 0 && names_[k - 1].first == old)
      throw InputError(fmt::format("{} is renamed both to {} and to {}: give it one name",
                                   to_string(old), to_string(names_[k - 1].second),
                                   to_string(now)));
  }
}

Key Renaming::operator()(const Key& key) const {
  const auto found =
      std::lower_bound(names_.begin(), names_.end(), key,
                       [](const auto& name, const Key& wanted) { return name.first < wanted; });
  return found != names_.end() && found->first == key ? found->second : key;
}

template <int D>
Map<D> rename_keys(const Map<D>& map, const Renaming& renaming) {
  const VariableSet<D>& variables = map.variables();
  ValuesBuilder<D> builder;
  std::vector<std::pair<Key, Key>> back;
  for (int i = 0; i < variables.size(); ++i) {
    const Key now = renaming(variables.key(i));
    builder.add(variables.kind(i), now, map.values.value(i));
    back.emplace_back(now, variables.key(i));
  }
  std::sort(back.begin(), back.end());
  for (std::size_t k = 1; k < back.size(); ++k) {
    if (back[k].first == back[k - 1].first)
      throw InputError(fmt::format("{} and {} of one map would both become {}",
                                   to_string(back[k - 1].second), to_string(back[k].second),
                                   to_string(back[k].first)));
  }
  Map<D> out;
  out.values = std::move(builder).build();
  std::vector<int> place;
  for (int i = 0; i < variables.size(); ++i)
    place.push_back(out.variables().require(renaming(variables.key(i)), "renaming"));
  out.information = permuted(map.information, place, out.variables().offsets());
  out.anchor = map.anchor;
  out.solved_in = map.solved_in;
  rename_anchor(out.anchor, renaming);
  rename_anchor(out.solved_in, renaming);
  if (map.observations != nullptr)
    out.observations =
        std::make_shared<const MeasurementGraph<D>>(rename_keys(*map.observations, renaming));
  return out;
}

template <int D>
LocalMap<D> rename_keys(LocalMap<D> map, const Renaming& renaming) {
  for (Key& key : map.keys) key = renaming(key);
  rename_anchor(map.anchor, renaming);
  return map;
}

template <int D>
MeasurementGraph<D> rename_keys(const MeasurementGraph<D>& graph, const Renaming& renaming) {
  MeasurementGraphBuilder<D> builder;
  for (const RelativeMeasurements<D>& column : graph.relative) {
    const auto values = at(column.kind->value_size);
    const auto entries = at(column.kind->dim) * at(column.kind->dim);
    builder.reserve(*column.kind, column.size());
    for (std::size_t k = 0; k < column.size(); ++k) {
      builder.add(*column.kind, renaming(graph.variables.key(column.from[k])),
                  renaming(graph.variables.key(column.to[k])), column.z.data() + k * values,
                  column.info.data() + k * entries);
    }
  }
  for (std::size_t k = 0; k < graph.submaps.size(); ++k)
    builder.add(renamed_submap(graph, k, renaming));
  return std::move(builder).build();
}

#define MAPJOIN_INSTANTIATE(D)                                       \
  template Map<D> rename_keys<D>(const Map<D>&, const Renaming&);    \
  template LocalMap<D> rename_keys<D>(LocalMap<D>, const Renaming&); \
  template MeasurementGraph<D> rename_keys<D>(const MeasurementGraph<D>&, const Renaming&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
