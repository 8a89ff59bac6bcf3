// The graph that elimination orders are found on: variables, and which of them meet in a clique.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace mapjoin {

/// Clique k touches the variables vars[start[k]] .. vars[start[k + 1] - 1], all different. A view:
/// owns nothing.
struct Cliques {
  std::span<const std::int64_t> start;  ///< size() + 1 entries, start[0] == 0
  std::span<const std::int32_t> vars;

  std::int64_t size() const {
    return start.empty() ? 0 : static_cast<std::int64_t>(start.size()) - 1;
  }
  std::span<const std::int32_t> operator[](std::int64_t k) const {
    return vars.subspan(static_cast<std::size_t>(start[k]),
                        static_cast<std::size_t>(start[k + 1] - start[k]));
  }
};

/// The block graph: row v of `neighbours` lists every variable that shares a clique with v, each
/// once, v itself not.
struct BlockGraph {
  std::vector<std::int32_t> start{0};    ///< variables + 1 entries
  std::vector<std::int32_t> neighbours;  ///< start.back() entries; may have spare capacity

  std::int32_t size() const { return static_cast<std::int32_t>(start.size()) - 1; }
  std::span<const std::int32_t> operator[](std::int32_t v) const {
    return std::span(neighbours)
        .subspan(static_cast<std::size_t>(start[v]),
                 static_cast<std::size_t>(start[v + 1] - start[v]));
  }
  /// Ends the row that was being written to `neighbours`.
  void end_row() { start.push_back(static_cast<std::int32_t>(neighbours.size())); }
};

/// Cost: the sum of the squared clique sizes. Throws InputError beyond 2^31 pairs
/// and for a variable that does not exist.
BlockGraph block_graph(std::int32_t variables, Cliques cliques);

/// The part of a graph that some variables make. number[v]: of variable v in the part, ascending in
/// v; negative where it is not in it. Cost: O(their neighbours).
BlockGraph part_of_graph(const BlockGraph& graph, std::span<const std::int32_t> number);

/// Do variables with very many neighbours, as features are that many poses see, make a large part
/// of the graph? O(variables).
bool has_hubs(const BlockGraph& graph);

/// Takes out variables that have at most two neighbours, one after the other: eliminating one makes
/// no neighbour more than there was, only links its two. Chains of poses go, loops stay.
struct ReducedGraph {
  BlockGraph graph;
  std::vector<std::int32_t> variable;    ///< of the input, per variable of `graph`, ascending
  std::vector<std::int32_t> eliminated;  ///< variables of the input, in this order
};

/// Cost: O(variables + neighbours). Neighbours that have many themselves are let be.
ReducedGraph eliminate_chains(BlockGraph graph);

}  // namespace mapjoin
