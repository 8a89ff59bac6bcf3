#include "mapjoin/graph/measurement_graph.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "mapjoin/graph/check_local_map.h"
#include "mapjoin/graph/disjoint_sets.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/graph/index.h"
#include "mapjoin/graph/key_numbering.h"
#include "mapjoin/graph/map.h"

namespace mapjoin {

namespace {

bool all_finite(const double* x, std::size_t n) {
  return std::all_of(x, x + n, [](double v) { return std::isfinite(v); });
}

template <class T>
void append(std::vector<T>& to, const std::vector<T>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

}  // namespace

template <int D>
std::size_t MeasurementGraph<D>::size() const {
  std::size_t n = submaps.size();
  for (const auto& column : relative) n += column.size();
  return n;
}

template <int D>
std::size_t MeasurementGraph<D>::residuals() const {
  std::size_t n = 0;
  for (const auto& column : relative) n += column.size() * at(column.kind->dim);
  for (const std::int32_t v : submaps.term_variable) n += at(variables.dim(v));
  return n;
}

template <int D>
CliqueList cliques(const MeasurementGraph<D>& graph) {
  CliqueList out;
  out.start.reserve(graph.size() + 1);
  for (const auto& column : graph.relative) {
    for (std::size_t k = 0; k < column.size(); ++k) {
      out.variables.push_back(column.from[k]);
      out.variables.push_back(column.to[k]);
      out.start.push_back(static_cast<std::int64_t>(out.variables.size()));
    }
  }
  const auto& maps = graph.submaps;
  for (std::size_t k = 0; k < maps.size(); ++k) {
    const auto first = static_cast<std::ptrdiff_t>(out.variables.size());
    out.variables.insert(out.variables.end(), maps.anchor_variables.begin() + maps.anchor_start[k],
                         maps.anchor_variables.begin() + maps.anchor_start[k + 1]);
    for (std::int64_t t = maps.term_start[k]; t < maps.term_start[k + 1]; ++t) {
      const std::int32_t v = maps.term_variable[static_cast<std::size_t>(t)];
      if (std::find(out.variables.begin() + first, out.variables.end(), v) == out.variables.end()) {
        out.variables.push_back(v);
      }
    }
    out.start.push_back(static_cast<std::int64_t>(out.variables.size()));
  }
  return out;
}

template <int D>
auto MeasurementGraphBuilder<D>::column(const VariableKind<D>& kind) -> Relative& {
  for (Relative& c : relative_) {
    if (c.kind->tag == kind.tag) return c;
  }
  relative_.push_back({&kind, {}, {}, {}, {}});
  return relative_.back();
}

template <int D>
void MeasurementGraphBuilder<D>::reserve(const VariableKind<D>& kind, std::size_t measurements) {
  Relative& c = column(kind);
  c.from.reserve(measurements);
  c.to.reserve(measurements);
  c.z.reserve(measurements * at(kind.value_size));
  c.info.reserve(measurements * at(kind.dim * kind.dim));
}

template <int D>
void MeasurementGraphBuilder<D>::add(const VariableKind<D>& kind, const Key& from, const Key& to,
                                     const double* z, const double* information) {
  if (from == to) {
    throw InputError(
        fmt::format("a measurement of {} from itself says nothing: remove it", to_string(from)));
  }
  if (from.type != Tag("pose")) {
    throw InputError(fmt::format("the measurement {} -> {} is not taken from a pose",
                                 to_string(from), to_string(to)));
  }
  check_type(kind, to);
  if (!all_finite(z, at(kind.value_size)) || !all_finite(information, at(kind.dim * kind.dim))) {
    throw InputError(fmt::format("the measurement {} -> {} holds a number that is not finite",
                                 to_string(from), to_string(to)));
  }
  Relative& c = column(kind);
  c.from.push_back(from);
  c.to.push_back(to);
  c.z.insert(c.z.end(), z, z + kind.value_size);
  c.info.insert(c.info.end(), information, information + kind.dim * kind.dim);
}

template <int D>
void MeasurementGraphBuilder<D>::add(const LocalMap<D>& local_map) {
  // Terms coupled by information stay together: union-find over the off-diagonal blocks.
  check_local_map(local_map);
  const SymmetricBlockMatrix& info = local_map.information;
  const int n = info.size();
  DisjointSets coupled(n);
  for (int j = 0; j < n; ++j) {
    for (std::int64_t s = info.begin(j) + 1; s < info.end(j); ++s) coupled.unite(info.row(s), j);
  }
  // Only a pose is where it is without a term: other anchors need theirs to say where the rest is.
  const bool from_pose = local_map.anchor.kind->tag == Tag("pose");
  std::vector<std::vector<int>> groups(at(n));
  for (int i = 0; i < n; ++i) groups[at(from_pose ? coupled.root(i) : 0)].push_back(i);
  std::vector<std::size_t> value_start(at(n) + 1, 0);
  for (int i = 0; i < n; ++i) {
    value_start[at(i) + 1] = value_start[at(i)] + at(local_map.kinds[at(i)]->value_size);
  }
  for (const std::vector<int>& group : groups) {
    if (group.empty()) continue;
    if (group.size() > 1 || !from_pose) {
      add_submap(local_map, group);
      continue;
    }
    const int i = group[0];
    add(*local_map.kinds[at(i)], local_map.anchor.keys[0], local_map.keys[at(i)],
        local_map.values.data() + value_start[at(i)], info.block(info.begin(i)));
  }
}

template <int D>
void MeasurementGraphBuilder<D>::add_submap(const LocalMap<D>& map, std::span<const int> terms) {
  std::vector<int> order(terms.begin(), terms.end());
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return map.keys[at(a)] < map.keys[at(b)]; });
  std::vector<int> place(map.keys.size(), -1);
  for (std::size_t k = 0; k < order.size(); ++k) place[at(order[k])] = static_cast<int>(k);
  std::vector<std::size_t> start(map.keys.size() + 1, 0);
  for (std::size_t i = 0; i < map.keys.size(); ++i)
    start[i + 1] = start[i] + at(map.kinds[i]->value_size);

  submaps_.anchors.push_back(map.anchor.kind);
  append(submap_keys_.anchor, map.anchor.keys);
  submaps_.anchor_start.push_back(static_cast<std::int64_t>(submap_keys_.anchor.size()));
  for (const int i : order) {
    const double* x = map.values.data() + start[at(i)];
    const int size = map.kinds[at(i)]->value_size;
    if (!all_finite(x, at(size))) {
      throw InputError(
          fmt::format("the value of {} in a local map is not finite", to_string(map.keys[at(i)])));
    }
    submaps_.term_value.push_back(static_cast<std::int64_t>(submaps_.values.size()));
    submaps_.values.insert(submaps_.values.end(), x, x + size);
    submap_keys_.terms.push_back(map.keys[at(i)]);
    submap_keys_.kinds.push_back(map.kinds[at(i)]);
  }
  submaps_.term_start.push_back(static_cast<std::int64_t>(submap_keys_.terms.size()));
  const SymmetricBlockMatrix& info = map.information;
  for (const int j : order) {
    for (std::int64_t s = info.begin(j); s < info.end(j); ++s) {
      const int i = info.row(s);
      const Eigen::Map<const Eigen::MatrixXd> block(info.block(s), info.dim(i), info.dim(j));
      if (!all_finite(block.data(), static_cast<std::size_t>(block.size()))) {
        throw InputError(fmt::format("the information of {} in a local map is not finite",
                                     to_string(map.keys[at(i)])));
      }
      const bool turned = place[at(i)] < place[at(j)];
      submaps_.block_row.push_back(turned ? place[at(j)] : place[at(i)]);
      submaps_.block_column.push_back(turned ? place[at(i)] : place[at(j)]);
      submaps_.block_value.push_back(static_cast<std::int64_t>(submaps_.information.size()));
      const Eigen::MatrixXd stored =
          turned ? Eigen::MatrixXd(block.transpose()) : Eigen::MatrixXd(block);
      submaps_.information.insert(submaps_.information.end(), stored.data(),
                                  stored.data() + stored.size());
    }
  }
  submaps_.block_start.push_back(static_cast<std::int64_t>(submaps_.block_row.size()));
}

template <int D>
void MeasurementGraphBuilder<D>::add(const MeasurementGraph<D>& graph) {
  for (const auto& from : graph.relative) {
    Relative& to = column(*from.kind);
    for (const std::int32_t v : from.from) to.from.push_back(graph.variables.key(v));
    for (const std::int32_t v : from.to) to.to.push_back(graph.variables.key(v));
    append(to.z, from.z);
    append(to.info, from.info);
  }
  const auto& maps = graph.submaps;
  const auto shift = [](std::vector<std::int64_t>& to, const std::vector<std::int64_t>& from,
                        std::size_t by, std::size_t skip) {
    for (std::size_t k = skip; k < from.size(); ++k)
      to.push_back(from[k] + static_cast<std::int64_t>(by));
  };
  shift(submaps_.anchor_start, maps.anchor_start, submap_keys_.anchor.size(), 1);
  shift(submaps_.term_start, maps.term_start, submap_keys_.terms.size(), 1);
  shift(submaps_.block_start, maps.block_start, submaps_.block_row.size(), 1);
  shift(submaps_.term_value, maps.term_value, submaps_.values.size(), 0);
  shift(submaps_.block_value, maps.block_value, submaps_.information.size(), 0);
  for (const std::int32_t v : maps.anchor_variables)
    submap_keys_.anchor.push_back(graph.variables.key(v));
  for (const std::int32_t v : maps.term_variable) {
    submap_keys_.terms.push_back(graph.variables.key(v));
    submap_keys_.kinds.push_back(&graph.variables.kind(v));
  }
  append(submaps_.anchors, maps.anchors);
  append(submaps_.values, maps.values);
  append(submaps_.block_row, maps.block_row);
  append(submaps_.block_column, maps.block_column);
  append(submaps_.information, maps.information);
}

template <int D>
MeasurementGraph<D> MeasurementGraphBuilder<D>::build() && {
  KeyNumbering<D> numbering;
  for (const Relative& c : relative_) {
    numbering.add(kind_of<PoseType<D>>(), c.from);
    numbering.add(*c.kind, c.to);
  }
  for (std::size_t k = 0; k < submap_keys_.terms.size(); ++k) {
    numbering.add(*submap_keys_.kinds[k], {&submap_keys_.terms[k], 1});
  }
  for (const Key& key : submap_keys_.anchor) {
    const VariableKind<D>* kind = &kind_of<PoseType<D>>();
    if (key.type != kind->tag) kind = &kind_of<PointType<D>>();
    // Of a type of the user's own: then it is a term, see check_local_map.
    for (std::size_t k = 0; k < submap_keys_.terms.size() && kind->tag != key.type; ++k) {
      if (submap_keys_.terms[k].type == key.type) kind = submap_keys_.kinds[k];
    }
    numbering.add(*kind, {&key, 1});
  }
  MeasurementGraph<D> graph;
  graph.variables = numbering.number();
  std::sort(relative_.begin(), relative_.end(),
            [](const Relative& a, const Relative& b) { return a.kind->tag < b.kind->tag; });
  for (Relative& c : relative_) {
    if (c.from.empty()) continue;
    RelativeMeasurements<D> out;
    out.kind = c.kind;
    out.from = numbering.numbers(c.from);
    out.to = numbering.numbers(c.to);
    out.z = std::move(c.z);
    out.info = std::move(c.info);
    graph.relative.push_back(std::move(out));
    c = {};
  }
  graph.submaps = std::move(submaps_);
  graph.submaps.anchor_variables = numbering.numbers(submap_keys_.anchor);
  graph.submaps.term_variable = numbering.numbers(submap_keys_.terms);
  return graph;
}

template <int D>
MeasurementGraph<D> subgraph(const MeasurementGraph<D>& graph,
                             std::span<const std::int64_t> observations) {
  MeasurementGraph<D> out;
  std::vector<int> place(at(graph.variables.size()), -1);
  const CliqueList all = cliques(graph);
  for (const std::int64_t k : observations) {
    for (std::int64_t v = all.start[static_cast<std::size_t>(k)];
         v < all.start[static_cast<std::size_t>(k) + 1]; ++v) {
      place[at(all.variables[static_cast<std::size_t>(v)])] = 0;
    }
  }
  std::vector<int> kept;
  for (int i = 0; i < graph.variables.size(); ++i) {
    if (place[at(i)] < 0) continue;
    place[at(i)] = static_cast<int>(kept.size());
    kept.push_back(i);
  }
  out.variables = subset(graph.variables, kept);
  std::size_t next = 0;
  std::int64_t first = 0;
  for (const auto& c : graph.relative) {
    RelativeMeasurements<D> part;
    part.kind = c.kind;
    const auto values = at(c.kind->value_size);
    const auto infos = at(c.kind->dim * c.kind->dim);
    for (; next < observations.size() &&
           observations[next] < first + static_cast<std::int64_t>(c.size());
         ++next) {
      const auto k = static_cast<std::size_t>(observations[next] - first);
      part.from.push_back(place[at(c.from[k])]);
      part.to.push_back(place[at(c.to[k])]);
      part.z.insert(part.z.end(), c.z.begin() + static_cast<std::ptrdiff_t>(k * values),
                    c.z.begin() + static_cast<std::ptrdiff_t>((k + 1) * values));
      part.info.insert(part.info.end(), c.info.begin() + static_cast<std::ptrdiff_t>(k * infos),
                       c.info.begin() + static_cast<std::ptrdiff_t>((k + 1) * infos));
    }
    first += static_cast<std::int64_t>(c.size());
    if (part.size() > 0) out.relative.push_back(std::move(part));
  }
  const auto& from = graph.submaps;
  auto& to = out.submaps;
  for (; next < observations.size(); ++next) {
    const auto k = static_cast<std::size_t>(observations[next] - first);
    to.anchors.push_back(from.anchors[k]);
    for (auto a = static_cast<std::size_t>(from.anchor_start[k]);
         a < static_cast<std::size_t>(from.anchor_start[k + 1]); ++a) {
      to.anchor_variables.push_back(place[at(from.anchor_variables[a])]);
    }
    to.anchor_start.push_back(static_cast<std::int64_t>(to.anchor_variables.size()));
    const auto t0 = static_cast<std::size_t>(from.term_start[k]);
    for (auto t = t0; t < static_cast<std::size_t>(from.term_start[k + 1]); ++t) {
      const int v = from.term_variable[t];
      to.term_variable.push_back(place[at(v)]);
      to.term_value.push_back(static_cast<std::int64_t>(to.values.size()));
      const auto x = from.values.begin() + from.term_value[t];
      to.values.insert(to.values.end(), x, x + graph.variables.kind(v).value_size);
    }
    to.term_start.push_back(static_cast<std::int64_t>(to.term_variable.size()));
    for (auto b = static_cast<std::size_t>(from.block_start[k]);
         b < static_cast<std::size_t>(from.block_start[k + 1]); ++b) {
      to.block_row.push_back(from.block_row[b]);
      to.block_column.push_back(from.block_column[b]);
      to.block_value.push_back(static_cast<std::int64_t>(to.information.size()));
      const int rows = graph.variables.dim(from.term_variable[t0 + at(from.block_row[b])]);
      const int cols = graph.variables.dim(from.term_variable[t0 + at(from.block_column[b])]);
      const auto x = from.information.begin() + from.block_value[b];
      to.information.insert(to.information.end(), x, x + rows * cols);
    }
    to.block_start.push_back(static_cast<std::int64_t>(to.block_row.size()));
  }
  return out;
}

template <int D>
std::vector<MeasurementGraph<D>> connected_components(const MeasurementGraph<D>& graph) {
  const CliqueList all = cliques(graph);
  DisjointSets linked(graph.variables.size());
  for (std::size_t k = 0; k < all.size(); ++k) {
    const auto first = static_cast<std::size_t>(all.start[k]);
    for (auto v = first + 1; v < static_cast<std::size_t>(all.start[k + 1]); ++v)
      linked.unite(all.variables[first], all.variables[v]);
  }
  std::vector<int> number(at(linked.size()), -1);
  std::vector<std::vector<std::int64_t>> members;
  for (int i = 0; i < graph.variables.size(); ++i) {
    if (linked.root(i) == i) {
      number[at(i)] = static_cast<int>(members.size());
      members.emplace_back();
    }
  }
  std::vector<MeasurementGraph<D>> out;
  if (members.size() == 1) {
    out.push_back(graph);
    return out;
  }
  for (std::size_t k = 0; k < all.size(); ++k) {
    const int v = all.variables[static_cast<std::size_t>(all.start[k])];
    members[at(number[at(linked.root(v))])].push_back(static_cast<std::int64_t>(k));
  }
  for (const auto& observations : members) out.push_back(subgraph(graph, observations));
  return out;
}

#define MAPJOIN_INSTANTIATE(D)                                             \
  template struct MeasurementGraph<D>;                                     \
  template class MeasurementGraphBuilder<D>;                               \
  template CliqueList cliques<D>(const MeasurementGraph<D>&);              \
  template MeasurementGraph<D> subgraph<D>(const MeasurementGraph<D>&,     \
                                           std::span<const std::int64_t>); \
  template std::vector<MeasurementGraph<D>> connected_components<D>(const MeasurementGraph<D>&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
