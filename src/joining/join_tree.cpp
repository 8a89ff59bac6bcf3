#include "mapjoin/joining/join_tree.h"

#include <metis.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "mapjoin/graph/error.h"
#include "mapjoin/graph/index.h"
#include "mapjoin/solvers/block_ordering.h"
#include "mapjoin/solvers/metis_turn.h"

namespace mapjoin {

namespace {

/// Joins `nodes` level by level, `arity` neighbours at once, until one is left.
void join_levels(JoinTree& tree, std::vector<std::int32_t> nodes, int arity) {
  while (nodes.size() > 1) {
    std::vector<std::int32_t> above;
    for (std::size_t k = 0; k < nodes.size(); k += at(arity)) {
      const auto group = std::span(nodes).subspan(k, std::min(at(arity), nodes.size() - k));
      above.push_back(group.size() == 1 ? group[0] : tree.add_join(group));
    }
    nodes = std::move(above);
  }
}

}  // namespace

std::span<const std::int64_t> JoinTree::leaf(int node) const {
  return std::span(observations)
      .subspan(at(leaf_start[at(node)]), at(leaf_start[at(node) + 1] - leaf_start[at(node)]));
}

std::span<const std::int32_t> JoinTree::children_of(int node) const {
  const std::size_t k = at(node - leaves());
  return std::span(children).subspan(at(child_start[k]), at(child_start[k + 1] - child_start[k]));
}

std::vector<std::vector<std::int32_t>> JoinTree::levels() const {
  std::vector<int> level(at(nodes()), 0);
  int top = 0;
  for (int n = leaves(); n < nodes(); ++n) {
    for (const std::int32_t c : children_of(n))
      level[at(n)] = std::max(level[at(n)], level[at(c)] + 1);
    top = std::max(top, level[at(n)]);
  }
  std::vector<std::vector<std::int32_t>> out(at(top) + 1);
  for (int n = 0; n < nodes(); ++n) out[at(level[at(n)])].push_back(n);
  return out;
}

void JoinTree::add_leaf(std::span<const std::int64_t> members) {
  observations.insert(observations.end(), members.begin(), members.end());
  leaf_start.push_back(static_cast<std::int64_t>(observations.size()));
}

int JoinTree::add_join(std::span<const std::int32_t> nodes) {
  children.insert(children.end(), nodes.begin(), nodes.end());
  child_start.push_back(static_cast<std::int32_t>(children.size()));
  return this->nodes() - 1;
}

template <int D>
std::vector<std::vector<std::int64_t>> local_maps_of(const MeasurementGraph<D>& graph,
                                                     std::span<const Key> order) {
  std::vector<std::vector<std::int64_t>> stars(at(graph.variables.size()));
  std::int64_t observation = 0;
  for (const auto& column : graph.relative) {
    for (const std::int32_t v : column.from) stars[at(v)].push_back(observation++);
  }
  const auto& maps = graph.submaps;
  for (std::size_t k = 0; k < maps.size(); ++k) {
    stars[at(maps.anchor_variables[at(maps.anchor_start[k])])].push_back(observation++);
  }
  std::vector<std::vector<std::int64_t>> out;
  for (const Key& key : order) {
    const auto v = graph.variables.find(key);
    if (v && !stars[at(*v)].empty()) out.push_back(std::exchange(stars[at(*v)], {}));
  }
  for (auto& star : stars) {
    if (!star.empty()) out.push_back(std::move(star));
  }
  return out;
}

JoinTree divide_and_conquer_tree(std::span<const std::vector<std::int64_t>> local_maps, int arity) {
  JoinTree tree;
  for (const auto& map : local_maps) tree.add_leaf(map);
  std::vector<std::int32_t> nodes(local_maps.size());
  std::iota(nodes.begin(), nodes.end(), 0);
  join_levels(tree, std::move(nodes), arity);
  return tree;
}

JoinTree sequential_tree(std::span<const std::vector<std::int64_t>> local_maps) {
  JoinTree tree;
  for (const auto& map : local_maps) tree.add_leaf(map);
  std::int32_t all = 0;
  for (std::size_t k = 1; k < local_maps.size(); ++k) {
    const std::int32_t pair[2] = {all, static_cast<std::int32_t>(k)};
    all = static_cast<std::int32_t>(tree.add_join(pair));
  }
  return tree;
}

namespace {

/// Edges between an anchor's first variable and everything seen from it, sparser than cliques and
/// as connected, with the trace of their information.
struct StarEdges {
  CliqueList ends;
  std::vector<double> stiffness;
};

template <int D>
StarEdges star_edges(const MeasurementGraph<D>& graph) {
  StarEdges out;
  const auto add = [&](std::int32_t a, std::int32_t b, double stiffness) {
    if (a == b) return;
    out.ends.variables.push_back(a);
    out.ends.variables.push_back(b);
    out.ends.start.push_back(static_cast<std::int64_t>(out.ends.variables.size()));
    out.stiffness.push_back(stiffness);
  };
  const auto trace = [](const double* block, int dim) {
    double sum = 0.0;
    for (int k = 0; k < dim; ++k) sum += block[k * (dim + 1)];
    return sum;
  };
  for (const auto& column : graph.relative) {
    const int dim = column.kind->dim;
    for (std::size_t k = 0; k < column.size(); ++k)
      add(column.from[k], column.to[k], trace(&column.info[k * at(dim * dim)], dim));
  }
  const auto& maps = graph.submaps;
  std::vector<double> diagonal;
  for (std::size_t k = 0; k < maps.size(); ++k) {
    const std::int32_t anchor = maps.anchor_variables[at(maps.anchor_start[k])];
    for (auto a = maps.anchor_start[k] + 1; a < maps.anchor_start[k + 1]; ++a)
      add(anchor, maps.anchor_variables[at(a)], 0.0);
    diagonal.assign(at(maps.term_start[k + 1] - maps.term_start[k]), 0.0);
    for (auto b = maps.block_start[k]; b < maps.block_start[k + 1]; ++b) {
      if (maps.block_row[at(b)] != maps.block_column[at(b)]) continue;
      const auto term = maps.block_row[at(b)];
      const std::int32_t v = maps.term_variable[at(maps.term_start[k] + term)];
      diagonal[at(term)] +=
          trace(&maps.information[at(maps.block_value[at(b)])], graph.variables.dim(v));
    }
    for (auto t = maps.term_start[k]; t < maps.term_start[k + 1]; ++t)
      add(anchor, maps.term_variable[at(t)], diagonal[at(t - maps.term_start[k])]);
  }
  return out;
}

/// What cutting an edge of `blocks` (rows ascending) costs METIS: the square root of its
/// information, the median being 4, from 1 to 100.
///
/// Maps that stiff edges hold together should be joined early: a summary that was closed while a
/// stiff neighbour was still missing carries what it learns later far from where it was linearised
/// (simu3d_870: chi2 290.4 instead of 5.5e8 with edges that weigh the same).
std::vector<idx_t> edge_weights(const BlockGraph& blocks, const StarEdges& edges) {
  std::vector<double> stiffness(at(blocks.start.back()), 0.0);
  for (std::size_t e = 0; e < edges.stiffness.size(); ++e) {
    for (const std::size_t side : {0u, 1u}) {
      const std::int32_t a = edges.ends.variables[2 * e + side];
      const std::int32_t b = edges.ends.variables[2 * e + 1 - side];
      const auto row = blocks.neighbours.begin();
      const auto found =
          std::lower_bound(row + blocks.start[at(a)], row + blocks.start[at(a) + 1], b);
      stiffness[at(found - row)] += edges.stiffness[e];
    }
  }
  std::vector<double> sorted = stiffness;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  std::vector<idx_t> weights(stiffness.size(), 1);
  if (sorted.empty() || *middle <= 0.0) return weights;
  for (std::size_t k = 0; k < stiffness.size(); ++k) {
    const double relative = std::sqrt(std::max(0.0, stiffness[k] / *middle));
    weights[k] = static_cast<idx_t>(std::lround(std::clamp(4.0 * relative, 1.0, 100.0)));
  }
  return weights;
}

/// part[v] in 0 .. parts-1 by recursive bisection: neighbouring numbers are neighbouring parts.
template <int D>
std::vector<idx_t> bisect(const MeasurementGraph<D>& graph, idx_t parts) {
  idx_t n = graph.variables.size();
  std::vector<idx_t> part(at(n), 0);
  if (parts < 2) return part;
  const StarEdges edges = star_edges(graph);
  BlockGraph blocks = block_graph(n, {edges.ends.start, edges.ends.variables});
  for (idx_t v = 0; v < n; ++v) {
    std::sort(blocks.neighbours.begin() + blocks.start[at(v)],
              blocks.neighbours.begin() + blocks.start[at(v) + 1]);
  }
  std::vector<idx_t> weights = edge_weights(blocks, edges);
  idx_t options[METIS_NOPTIONS];
  METIS_SetDefaultOptions(options);
  options[METIS_OPTION_SEED] = 1;
  options[METIS_OPTION_NUMBERING] = 0;
  static_assert(sizeof(idx_t) == sizeof(std::int32_t), "mapjoin wants METIS with 32-bit indices");
  idx_t constraints = 1;
  idx_t cut = 0;
  const MetisTurn turn;
  if (METIS_PartGraphRecursive(&n, &constraints, blocks.start.data(), blocks.neighbours.data(),
                               nullptr, nullptr, weights.data(), &parts, nullptr, nullptr, options,
                               &cut, part.data()) != METIS_OK) {
    throw Error("METIS could not partition the graph; join in index order instead (--tree order)");
  }
  return part;
}

}  // namespace

template <int D>
JoinTree graph_tree(const MeasurementGraph<D>& graph, int leaf_variables, int arity) {
  const double wanted = static_cast<double>(graph.variables.size()) / std::max(1, leaf_variables);
  const idx_t parts = wanted <= 1.0 ? 1 : static_cast<idx_t>(1) << std::lround(std::log2(wanted));
  const std::vector<idx_t> part = bisect(graph, parts);
  std::vector<std::vector<std::int64_t>> leaves(at(parts));
  std::int64_t observation = 0;
  for (const auto& column : graph.relative) {
    const bool poses = column.kind->tag == Tag("pose");
    for (std::size_t k = 0; k < column.size(); ++k) {
      const idx_t a = part[at(column.from[k])];
      leaves[at(poses ? std::min(a, part[at(column.to[k])]) : a)].push_back(observation++);
    }
  }
  const auto& maps = graph.submaps;
  for (std::size_t k = 0; k < maps.size(); ++k) {
    leaves[at(part[at(maps.anchor_variables[at(maps.anchor_start[k])])])].push_back(observation++);
  }
  JoinTree tree;
  std::vector<std::int32_t> nodes(at(parts), -1);
  for (idx_t p = 0; p < parts; ++p) {
    if (leaves[at(p)].empty()) continue;
    nodes[at(p)] = tree.leaves();
    tree.add_leaf(leaves[at(p)]);
  }
  while (nodes.size() > 1) {  // groups of `arity` part numbers are subtrees of the bisection
    std::vector<std::int32_t> above;
    for (std::size_t k = 0; k < nodes.size(); k += at(arity)) {
      std::vector<std::int32_t> group;
      for (std::size_t m = k; m < std::min(k + at(arity), nodes.size()); ++m) {
        if (nodes[m] >= 0) group.push_back(nodes[m]);
      }
      above.push_back(group.empty()       ? -1
                      : group.size() == 1 ? group[0]
                                          : static_cast<std::int32_t>(tree.add_join(group)));
    }
    nodes = std::move(above);
  }
  return tree;
}

#define MAPJOIN_INSTANTIATE(D)                                                                 \
  template std::vector<std::vector<std::int64_t>> local_maps_of<D>(const MeasurementGraph<D>&, \
                                                                   std::span<const Key>);      \
  template JoinTree graph_tree<D>(const MeasurementGraph<D>&, int, int);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
