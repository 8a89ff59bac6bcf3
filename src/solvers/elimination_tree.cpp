#include "mapjoin/solvers/elimination_tree.h"

#include <numeric>
#include <string>

#include "mapjoin/graph/error.h"
#include "mapjoin/solvers/pool_loop.h"

namespace mapjoin {
namespace {

using Index = std::int32_t;

template <class T>
void counts_to_starts(std::vector<T>& counts) {
  std::exclusive_scan(counts.begin(), counts.end(), counts.begin(), T{0});
}

Index earliest(std::span<const Index> clique, std::span<const Index> position) {
  Index first = -1;
  for (const Index v : clique) {
    if (first < 0 || position[v] < position[first]) first = v;
  }
  return first;
}

template <class Visit>
void for_each_coupling(Cliques cliques, std::span<const Index> owners, Visit visit) {
  for (std::int64_t k = 0; k < cliques.size(); ++k) {
    for (const Index v : cliques[k]) {
      if (v != owners[k]) visit(owners[k], v);
    }
  }
}

// Root of the set that holds `node`, in a forest of parent links that are halved on the way up.
Index find_root(std::vector<Index>& ancestor, Index node) {
  while (ancestor[node] != node) {
    ancestor[node] = ancestor[ancestor[node]];
    node = ancestor[node];
  }
  return node;
}

}  // namespace

Stars clique_stars(std::span<const std::int32_t> position, Cliques cliques, WorkerPool* pool) {
  Stars stars;
  stars.owner.resize(static_cast<std::size_t>(cliques.size()));
  for (std::int64_t k = 0; k < cliques.size(); ++k) stars.owner[k] = earliest(cliques[k], position);
  const auto list = [&](std::vector<std::int64_t>& start, std::vector<Index>& entries,
                        bool of_owner) {
    start.assign(position.size() + 1, 0);
    for_each_coupling(cliques, stars.owner,
                      [&](Index owner, Index v) { ++start[of_owner ? owner : v]; });
    counts_to_starts(start);
    entries.resize(static_cast<std::size_t>(start.back()));
    std::vector<std::int64_t> next(start.begin(), start.end() - 1);
    for_each_coupling(cliques, stars.owner, [&](Index owner, Index v) {
      entries[next[of_owner ? owner : v]++] = of_owner ? v : owner;
    });
  };
  run_both(
      pool, [&] { list(stars.later_start, stars.later, true); },
      [&] { list(stars.earlier_start, stars.earlier, false); });
  return stars;
}

std::vector<std::int32_t> elimination_tree(std::span<const std::int32_t> order,
                                           std::span<const std::int32_t> position,
                                           const Stars& stars) {
  const auto n = static_cast<Index>(order.size());
  std::vector<Index> parent(order.size(), -1);
  std::vector<Index> ancestor(order.size(), -1);  // a shortcut upwards, at most to the current node
  for (Index i = 0; i < n; ++i) {
    const Index v = order[i];
    for (std::int64_t e = stars.earlier_start[v]; e < stars.earlier_start[v + 1]; ++e) {
      Index node = position[stars.earlier[e]];
      while (node != -1 && node < i) {
        const Index up = ancestor[node];
        ancestor[node] = i;
        if (up == -1) parent[node] = i;
        node = up;
      }
    }
  }
  return parent;
}

std::vector<std::int32_t> postorder(std::span<const std::int32_t> parent) {
  const auto n = static_cast<Index>(parent.size());
  std::vector<Index> first_child(parent.size(), -1);
  std::vector<Index> next_sibling(parent.size(), -1);
  Index first_root = -1;
  for (Index i = n - 1; i >= 0; --i) {
    Index& head = parent[i] < 0 ? first_root : first_child[parent[i]];
    next_sibling[i] = head;
    head = i;
  }
  std::vector<Index> result;
  result.reserve(parent.size());
  Index node = first_root;
  while (node >= 0) {
    while (first_child[node] >= 0) node = first_child[node];
    result.push_back(node);
    // Up, until a node with a sibling still to visit; a node is written after its last child.
    while (next_sibling[node] < 0 && parent[node] >= 0) {
      node = parent[node];
      result.push_back(node);
    }
    node = next_sibling[node];
  }
  return result;
}

std::vector<Index> inverse_permutation(std::span<const Index> permutation) {
  std::vector<Index> result(permutation.size(), -1);
  for (std::size_t i = 0; i < permutation.size(); ++i) {
    const Index v = permutation[i];
    if (v < 0 || v >= static_cast<Index>(permutation.size()) || result[v] >= 0) {
      throw InputError("analyze: the order is not a permutation at position " + std::to_string(i));
    }
    result[v] = static_cast<Index>(i);
  }
  return result;
}

void apply_postorder(std::vector<Index>& order, std::vector<Index>& position,
                     std::vector<Index>& parent) {
  const std::vector<Index> post = postorder(parent);
  const std::vector<Index> old_order = order;
  const std::vector<Index> old_parent = parent;
  const std::vector<Index> renumbered = inverse_permutation(post);
  for (std::size_t k = 0; k < post.size(); ++k) {
    order[k] = old_order[post[k]];
    position[order[k]] = static_cast<Index>(k);
    parent[k] = old_parent[post[k]] < 0 ? -1 : renumbered[old_parent[post[k]]];
  }
}

std::vector<ColumnCount> column_counts(std::span<const std::int32_t> column_dim,
                                       std::span<const std::int32_t> order,
                                       std::span<const std::int32_t> position,
                                       std::span<const std::int32_t> parent, const Stars& stars) {
  const auto n = static_cast<Index>(order.size());
  std::vector<ColumnCount> count(order.size());
  const auto add = [&](Index at, Index row, int sign) {
    count[at].scalars += sign * column_dim[row];
    count[at].blocks += sign;
  };
  // Row i's subtree is the set of columns with an entry in row i. Its weight is put on its leaves
  // and taken off where two branches meet and above i; summing up the tree then gives, at column j,
  // the weight of the rows whose subtree holds j.
  std::vector<Index> first_descendant(order.size(), -1);
  for (Index j = 0; j < n; ++j) {
    if (first_descendant[j] < 0) {
      first_descendant[j] = j;
      add(j, j, 1);
    }
    if (parent[j] < 0) continue;
    if (first_descendant[parent[j]] < 0) first_descendant[parent[j]] = first_descendant[j];
    add(parent[j], j, -1);
  }
  std::vector<Index> last_first(order.size(), -1);  // per row: first descendant of the latest leaf
  std::vector<Index> last_leaf(order.size(), -1);
  std::vector<Index> ancestor(order.size());
  std::iota(ancestor.begin(), ancestor.end(), 0);
  for (Index j = 0; j < n; ++j) {
    const Index v = order[j];
    for (std::int64_t e = stars.later_start[v]; e < stars.later_start[v + 1]; ++e) {
      const Index i = position[stars.later[e]];
      if (first_descendant[j] <= last_first[i]) continue;  // j is not a leaf of row i's subtree
      last_first[i] = first_descendant[j];
      add(j, i, 1);
      // In a forest that was cut, the branches may be of different trees, which never meet.
      const Index meet = last_leaf[i] < 0 ? -1 : find_root(ancestor, last_leaf[i]);
      if (meet >= j) add(meet, i, -1);
      last_leaf[i] = j;
    }
    if (parent[j] >= 0) ancestor[j] = parent[j];
  }
  for (Index j = 0; j < n; ++j) {
    if (parent[j] < 0) continue;
    count[parent[j]].scalars += count[j].scalars;
    count[parent[j]].blocks += count[j].blocks;
  }
  return count;
}

double elimination_flops(std::span<const std::int32_t> dims, Cliques cliques,
                         std::span<const std::int32_t> order) {
  std::vector<std::int32_t> postordered(order.begin(), order.end());
  std::vector<std::int32_t> position = inverse_permutation(order);
  const Stars stars = clique_stars(position, cliques);
  std::vector<std::int32_t> parent = elimination_tree(order, position, stars);
  apply_postorder(postordered, position, parent);
  std::vector<Index> column_dim(postordered.size());
  for (std::size_t k = 0; k < column_dim.size(); ++k) column_dim[k] = dims[postordered[k]];
  const auto count = column_counts(column_dim, postordered, position, parent, stars);
  double flops = 0.0;
  for (std::size_t k = 0; k < count.size(); ++k) {
    for (int c = 0; c < column_dim[k]; ++c) {
      const double rows = count[k].scalars - c;
      flops += rows * rows;
    }
  }
  return flops;
}

}  // namespace mapjoin
