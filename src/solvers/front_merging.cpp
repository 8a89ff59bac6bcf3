#include "mapjoin/solvers/front_merging.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace mapjoin {
namespace {

using Index = std::int32_t;

// The tree of supernodes while it is merged: `alive` ones are the fronts.
struct MergedTree {
  explicit MergedTree(const SupernodeTree& tree)
      : parent(tree.parent),
        pivot_dim(tree.pivot_dim),
        update_dim(tree.update_dim),
        alive(tree.parent.size(), 1) {}

  std::vector<Index> parent;
  std::vector<Index> pivot_dim;
  std::span<const Index> update_dim;
  std::vector<char> alive;

  Index size() const { return static_cast<Index>(parent.size()); }
};

// Bottom-up; each parent takes in, largest update set (fewest new zeros) first, the children that
// pay. `own_cost`, of each supernode, becomes that of each live one.
void merge_supernodes(MergedTree& tree, const FrontCostModel& cost, std::vector<double>& own_cost) {
  const Index size = tree.size();
  std::vector<Index> child_start(static_cast<std::size_t>(size) + 1, 0);
  for (const Index p : tree.parent) {
    if (p >= 0) ++child_start[p];
  }
  Index sum = 0;
  for (Index& start : child_start) sum += std::exchange(start, sum);
  std::vector<Index> children(static_cast<std::size_t>(sum));
  std::vector<Index> next(child_start.begin(), child_start.end() - 1);
  for (Index s = 0; s < size; ++s) {
    if (tree.parent[s] >= 0) children[next[tree.parent[s]]++] = s;
  }
  for (Index s = 0; s < size; ++s) {
    const auto begin = children.begin() + child_start[s];
    const auto end = children.begin() + child_start[s + 1];
    if (end - begin > 1) {
      std::sort(begin, end, [&](Index a, Index b) {
        return tree.update_dim[a] != tree.update_dim[b] ? tree.update_dim[a] > tree.update_dim[b]
                                                        : a < b;
      });
    }
    for (auto c = begin; c != end; ++c) {
      const double merged = cost(tree.pivot_dim[s] + tree.pivot_dim[*c], tree.update_dim[s]);
      if (merged > own_cost[s] + own_cost[*c]) continue;
      tree.pivot_dim[s] += tree.pivot_dim[*c];
      tree.alive[*c] = 0;
      own_cost[s] = merged;
    }
  }
  // Whoever hung below a merged supernode now hangs below the one that took it in; parents lie
  // above, so top-down.
  for (Index s = size - 1; s >= 0; --s) {
    const Index p = tree.parent[s];
    if (p >= 0 && !tree.alive[p]) tree.parent[s] = tree.parent[p];
  }
}

// Postorder of the live supernodes in which the child of the costliest subtree comes last.
std::vector<Index> heaviest_last_postorder(const MergedTree& tree,
                                           std::span<const double> own_cost) {
  const Index size = tree.size();
  std::vector<double> subtree(static_cast<std::size_t>(size), 0.0);
  std::vector<Index> heaviest(static_cast<std::size_t>(size), -1);
  for (Index s = 0; s < size; ++s) {
    if (!tree.alive[s]) continue;
    subtree[s] += own_cost[s];
    const Index p = tree.parent[s];
    if (p < 0) continue;
    subtree[p] += subtree[s];
    if (heaviest[p] < 0 || subtree[s] >= subtree[heaviest[p]]) heaviest[p] = s;
  }
  // Renumber so that the heaviest child has the largest index of its siblings: they swap places in
  // the sibling order.
  std::vector<Index> first_child(static_cast<std::size_t>(size), -1);
  std::vector<Index> sibling(static_cast<std::size_t>(size), -1);
  Index first_root = -1;
  const auto link = [&](Index s) {
    Index& head = tree.parent[s] < 0 ? first_root : first_child[tree.parent[s]];
    sibling[s] = head;
    head = s;
  };
  for (Index s = 0; s < size; ++s) {
    if (heaviest[s] >= 0) link(heaviest[s]);  // first linked is last visited
  }
  for (Index s = size - 1; s >= 0; --s) {
    if (tree.alive[s] && (tree.parent[s] < 0 || heaviest[tree.parent[s]] != s)) link(s);
  }
  std::vector<Index> order;
  order.reserve(static_cast<std::size_t>(size));
  Index node = first_root;
  while (node >= 0) {
    while (first_child[node] >= 0) node = first_child[node];
    order.push_back(node);
    while (sibling[node] < 0 && tree.parent[node] >= 0) order.push_back(node = tree.parent[node]);
    node = sibling[node];
  }
  return order;
}

}  // namespace

double FrontCostModel::operator()(double pivots, double updates) const {
  const double rows = kRowGroup * std::ceil((pivots + updates + 1) / kRowGroup);
  return per_front + per_pivot * pivots + per_pivot_row * pivots * rows +
         per_update_entry * updates * updates + front_flops(pivots, updates);
}

double front_flops(double pivots, double updates) {
  // Pivot k of p leaves m = p - k - 1 + q columns: one root, one division, m + 1 scalings, m (m +
  // 3) / 2 updates.
  const double p = pivots;
  const double n = pivots + updates;
  const double sum_m = p * n - p * (p + 1) / 2;
  const double sum_m2 = p * n * n - n * p * (p + 1) + p * (p + 1) * (2 * p + 1) / 6;
  return 3 * p + sum_m + (sum_m2 + 3 * sum_m);
}

FrontPartition partition_into_fronts(const SupernodeTree& supernodes,
                                     const MergingOptions& options) {
  MergedTree tree(supernodes);
  std::vector<double> own_cost(static_cast<std::size_t>(tree.size()));
  for (Index s = 0; s < tree.size(); ++s)
    own_cost[s] = options.cost(tree.pivot_dim[s], tree.update_dim[s]);
  if (options.merge_fronts) merge_supernodes(tree, options.cost, own_cost);

  FrontPartition result;
  result.supernode = heaviest_last_postorder(tree, own_cost);
  std::vector<Index> number(static_cast<std::size_t>(tree.size()), -1);
  for (std::size_t f = 0; f < result.supernode.size(); ++f)
    number[result.supernode[f]] = static_cast<Index>(f);
  result.parent.reserve(result.supernode.size());
  result.pivot_dim.reserve(result.supernode.size());
  for (const Index s : result.supernode) {
    result.parent.push_back(tree.parent[s] < 0 ? -1 : number[tree.parent[s]]);
    result.pivot_dim.push_back(tree.pivot_dim[s]);
  }
  // A supernode that was merged belongs to the front its (already lifted) parent belongs to.
  for (Index s = tree.size() - 1; s >= 0; --s) {
    if (!tree.alive[s]) number[s] = number[tree.parent[s]];
  }
  result.front_of.reserve(supernodes.of.size());
  for (const Index s : supernodes.of) result.front_of.push_back(number[s]);
  return result;
}

}  // namespace mapjoin
