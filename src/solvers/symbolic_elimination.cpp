#include "mapjoin/solvers/symbolic_elimination.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <string>

#include "mapjoin/graph/error.h"

namespace mapjoin {
namespace {

using Index = std::int32_t;

class SymbolicElimination {
 public:
  SymbolicElimination(std::span<const Index> dims, const BlockGraph& graph,
                      std::span<const Index> order, std::span<const Index> position,
                      Index eliminated)
      : dims_(dims),
        graph_(graph),
        order_(order),
        position_(position),
        eliminated_(eliminated),
        of_(order.size()),
        first_child_(order.size(), -1),
        mark_(order.size(), 0),
        more_(order.size() + 1) {
    nodes_.reserve(order.size());
    entries_.reserve(graph.neighbours.size());
  }

  SupernodeTree run() && {
    for (Index p = 0; p < eliminated_; ++p) eliminate(p);
    for (Index p = eliminated_; p < static_cast<Index>(order_.size()); ++p) add_node(p);
    return numbered_by_last();
  }

 private:
  struct Node {
    std::int64_t start, end;  // of its pattern in entries_; what is above `last` is left of it
    Index last;
    Index parent = -1;   // position of the first of what is left
    Index sibling = -1;  // the next node with the same
    Index pivot_dim, update_dim = 0, update_blocks = 0;
  };

  Index dim_at(Index p) const { return dims_[order_[p]]; }

  void eliminate(Index p) {
    Index largest = -1;
    for (Index c = first_child_[p]; c >= 0; c = nodes_[c].sibling) {
      if (largest < 0 || nodes_[c].update_blocks > nodes_[largest].update_blocks) largest = c;
    }
    mark_pattern(largest);
    const std::span<const Index> more = what_is_not_marked(p, largest);
    if (largest >= 0 && more.empty()) {
      join(p, largest);
    } else {
      start_node(p, largest, more);
    }
  }

  void mark_pattern(Index node) {
    if (node >= 0 && node == marked_) return;  // still
    ++stamp_;
    if (node < 0) return;
    Index* const mark = mark_.data();
    const Index stamp = stamp_;
    for (const Index u : pattern(node)) mark[u] = stamp;
  }

  /// Of the later variables that p is coupled with; marks it.
  std::span<const Index> what_is_not_marked(Index p, Index largest_child) {
    Index* const mark = mark_.data();
    Index* end = more_.data();
    const Index stamp = stamp_;
    const auto take = [&](Index u) {  // earlier ones are marked in vain: nobody asks again
      *end = u;
      end += u > p && mark[u] != stamp ? 1 : 0;
      mark[u] = stamp;
    };
    for (const Index v : graph_[order_[p]]) take(position_[v]);
    for (Index c = first_child_[p]; c >= 0; c = nodes_[c].sibling) {
      if (c == largest_child) continue;
      for (const Index u : pattern(c)) take(u);
    }
    return {more_.data(), end};
  }

  Node& add_node(Index p) {
    of_[p] = static_cast<Index>(nodes_.size());
    const auto start = static_cast<std::int64_t>(entries_.size());
    return nodes_.emplace_back(
        Node{.start = start, .end = start, .last = p, .pivot_dim = dim_at(p)});
  }

  /// With what p takes over from a child, unless that is -1, and with more.
  void start_node(Index p, Index child, std::span<const Index> more) {
    Node& node = add_node(p);
    marked_ = of_[p];
    if (child >= 0) {
      const Node& from = nodes_[child];
      entries_.resize(entries_.size() + static_cast<std::size_t>(from.update_blocks));
      Index* to = entries_.data() + node.start;
      for (const Index u : pattern(child)) {
        *to = u;
        to += u > p ? 1 : 0;
      }
      entries_.pop_back();  // p was one of them
      node.update_dim = from.update_dim - dim_at(p);
    }
    entries_.insert(entries_.end(), more.begin(), more.end());
    for (const Index u : more) node.update_dim += dim_at(u);
    node.end = static_cast<std::int64_t>(entries_.size());
    node.update_blocks = static_cast<Index>(node.end - node.start);
    hang_up(of_[p]);
  }

  void join(Index p, Index child) {
    Node& node = nodes_[child];
    marked_ = child;
    of_[p] = child;
    node.last = p;
    node.pivot_dim += dim_at(p);
    node.update_dim -= dim_at(p);
    --node.update_blocks;
    hang_up(child);
  }

  void hang_up(Index number) {
    Node& node = nodes_[number];
    Index first = std::numeric_limits<Index>::max();
    for (const Index u : pattern(number)) first = u > node.last && u < first ? u : first;
    node.parent = first < eliminated_ ? first : -1;
    if (node.parent < 0) return;
    node.sibling = first_child_[first];
    first_child_[first] = number;
  }

  std::span<const Index> pattern(Index node) const {
    return {entries_.data() + nodes_[node].start, entries_.data() + nodes_[node].end};
  }

  /// So that children come before parents.
  SupernodeTree numbered_by_last() {
    std::vector<Index> number(nodes_.size());
    SupernodeTree tree;
    for (auto* const list :
         {&tree.parent, &tree.last, &tree.pivot_dim, &tree.update_dim, &tree.update_blocks})
      list->reserve(nodes_.size());
    tree.start.reserve(nodes_.size());
    tree.end.reserve(nodes_.size());
    for (Index p = 0; p < static_cast<Index>(order_.size()); ++p) {
      const Node& node = nodes_[of_[p]];
      if (node.last != p) continue;
      number[of_[p]] = tree.size();
      tree.parent.push_back(node.parent);
      tree.last.push_back(p);
      tree.pivot_dim.push_back(node.pivot_dim);
      tree.update_dim.push_back(node.update_dim);
      tree.update_blocks.push_back(node.update_blocks);
      tree.start.push_back(node.start);
      tree.end.push_back(node.end);
    }
    for (Index& s : of_) s = number[s];
    for (Index& p : tree.parent) p = p < 0 ? -1 : of_[p];
    tree.of = std::move(of_);
    tree.entries = std::move(entries_);
    return tree;
  }

  std::span<const Index> dims_;
  const BlockGraph& graph_;
  std::span<const Index> order_, position_;
  Index eliminated_;
  std::vector<Index> of_;           // per position
  std::vector<Index> first_child_;  // per position: the first node with that parent
  std::vector<Index> mark_;         // per position: stamp_ where it is in the pattern looked at
  std::vector<Index> more_;
  std::vector<Node> nodes_;
  std::vector<Index> entries_;
  Index stamp_ = 0;
  Index marked_ = -1;  // the node whose pattern is marked
};

}  // namespace

SupernodeTree eliminate_symbolically(std::span<const Index> dims, const BlockGraph& graph,
                                     std::span<const Index> order, std::span<const Index> position,
                                     Index eliminated) {
  if (eliminated < 0) eliminated = static_cast<Index>(order.size());
  return SymbolicElimination(dims, graph, order, position, eliminated).run();
}

BlockGraph star_graph(std::span<const Index> position, Cliques cliques) {
  std::vector<Index> owner(static_cast<std::size_t>(cliques.size()), -1);
  std::vector<std::int64_t> start(position.size() + 1, 0);
  for (std::int64_t k = 0; k < cliques.size(); ++k) {
    for (const Index v : cliques[k]) {
      if (owner[k] < 0 || position[v] < position[owner[k]]) owner[k] = v;
    }
    if (owner[k] >= 0) start[owner[k]] += static_cast<std::int64_t>(cliques[k].size()) - 1;
  }
  std::exclusive_scan(start.begin(), start.end(), start.begin(), std::int64_t{0});
  if (start.back() > std::numeric_limits<Index>::max())
    throw InputError("star_graph: more than 2^31 links");
  BlockGraph graph;
  graph.start.assign(start.begin(), start.end());
  graph.neighbours.resize(static_cast<std::size_t>(start.back()));
  for (std::int64_t k = 0; k < cliques.size(); ++k) {
    for (const Index v : cliques[k]) {
      if (v != owner[k]) graph.neighbours[start[owner[k]]++] = v;
    }
  }
  return graph;
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

double elimination_flops(std::span<const Index> dims, const BlockGraph& graph,
                         std::span<const Index> order) {
  const SupernodeTree tree = eliminate_symbolically(dims, graph, order, inverse_permutation(order));
  double flops = 0.0;
  for (Index s = 0; s < tree.size(); ++s) {
    for (Index p = 0; p < tree.pivot_dim[s]; ++p) {
      const double rows = tree.pivot_dim[s] + tree.update_dim[s] - p;
      flops += rows * rows;
    }
  }
  return flops;
}

}  // namespace mapjoin
