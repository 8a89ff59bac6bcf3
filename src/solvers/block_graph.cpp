#include "mapjoin/solvers/block_graph.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <string>

#include "mapjoin/graph/error.h"

namespace mapjoin {
namespace {

using Index = std::int32_t;

// Keeps the first of equal entries in each row and closes the gaps, in place.
void remove_duplicates(BlockGraph& graph) {
  const Index variables = graph.size();
  std::vector<Index> seen_by(static_cast<std::size_t>(variables), -1);
  Index* const entries = graph.neighbours.data();
  Index end = 0;
  Index begin = 0;
  for (Index v = 0; v < variables; ++v) {
    const Index row_end = graph.start[v + 1];
    seen_by[v] = v;
    graph.start[v] = end;
    for (Index e = begin; e < row_end; ++e) {
      const Index u = entries[e];
      if (seen_by[u] == v) continue;
      seen_by[u] = v;
      entries[end++] = u;
    }
    begin = row_end;
  }
  graph.start[variables] = end;
  graph.neighbours.resize(static_cast<std::size_t>(end));
}

class ChainElimination {
 public:
  explicit ChainElimination(BlockGraph graph)
      : graph_(std::move(graph)), gone_(static_cast<std::size_t>(graph_.size()), false) {
    for (Index v = 0; v < graph_.size(); ++v)
      length_.push_back(graph_.start[v + 1] - graph_.start[v]);
  }

  ReducedGraph run() && {
    ReducedGraph out;
    std::vector<Index> again;  // variables that have lost a neighbour
    for (Index v = 0; v < graph_.size(); ++v) {
      again.push_back(v);
      while (!again.empty()) {
        const Index next = again.back();
        again.pop_back();
        if (!eliminate(next)) continue;
        out.eliminated.push_back(next);
        for (const Index u : row(next)) {
          if (u < v) again.push_back(u);
        }
      }
    }
    std::vector<Index> number(gone_.size(), -1);
    for (Index v = 0; v < graph_.size(); ++v) {
      if (gone_[v]) continue;
      number[v] = static_cast<Index>(out.variable.size());
      out.variable.push_back(v);
    }
    for (const Index v : out.variable) {
      for (const Index u : row(v)) out.graph.neighbours.push_back(number[u]);
      out.graph.end_row();
    }
    return out;
  }

 private:
  static constexpr Index kLongRow = 32;  // too long to be searched

  std::span<Index> row(Index v) {
    return std::span(graph_.neighbours)
        .subspan(static_cast<std::size_t>(graph_.start[v]), static_cast<std::size_t>(length_[v]));
  }

  bool eliminate(Index v) {
    if (gone_[v] || length_[v] > 2) return false;
    for (const Index u : row(v)) {
      if (length_[u] > kLongRow) return false;
    }
    gone_[v] = true;
    if (length_[v] == 2) {
      const Index a = row(v)[0];
      const Index b = row(v)[1];
      if (std::ranges::find(row(a), b) == row(a).end()) {
        *std::ranges::find(row(a), v) = b;
        *std::ranges::find(row(b), v) = a;
        return true;
      }
    }
    for (const Index u : row(v)) {
      *std::ranges::find(row(u), v) = row(u).back();
      --length_[u];
    }
    return true;
  }

  BlockGraph graph_;
  std::vector<Index> length_;  // of each row
  std::vector<bool> gone_;
};

}  // namespace

BlockGraph block_graph(std::int32_t variables, Cliques cliques) {
  std::vector<std::int64_t> start(static_cast<std::size_t>(variables) + 1, 0);
  for (std::int64_t k = 0; k < cliques.size(); ++k) {
    const auto clique = cliques[k];
    for (const Index v : clique) {
      if (v < 0 || v >= variables) {
        throw InputError("block_graph: clique " + std::to_string(k) + " names variable " +
                         std::to_string(v) + " of " + std::to_string(variables));
      }
      start[v] += static_cast<std::int64_t>(clique.size()) - 1;
    }
  }
  std::exclusive_scan(start.begin(), start.end(), start.begin(), std::int64_t{0});
  if (start.back() > std::numeric_limits<Index>::max()) {
    throw InputError("block_graph: more than 2^31 pairs of neighbours");
  }
  BlockGraph graph;
  graph.start.assign(start.begin(), start.end());
  graph.neighbours.reserve(
      static_cast<std::size_t>(start.back() + start.back() / 5 + variables + 1));
  graph.neighbours.resize(static_cast<std::size_t>(start.back()));
  std::vector<Index> next(graph.start.begin(), graph.start.end() - 1);
  for (std::int64_t k = 0; k < cliques.size(); ++k) {
    const auto clique = cliques[k];
    for (std::size_t i = 0; i < clique.size(); ++i) {
      for (std::size_t j = 0; j < clique.size(); ++j) {
        if (i != j) graph.neighbours[next[clique[i]]++] = clique[j];
      }
    }
  }
  remove_duplicates(graph);
  return graph;
}

BlockGraph part_of_graph(const BlockGraph& graph, std::span<const std::int32_t> number) {
  std::size_t rows = 0, entries = 0;
  for (Index v = 0; v < graph.size(); ++v) {
    if (number[v] < 0) continue;
    ++rows;
    entries += graph[v].size();
  }
  BlockGraph out;
  out.start.reserve(rows + 1);
  out.neighbours.resize(entries);
  Index* end = out.neighbours.data();
  for (Index v = 0; v < graph.size(); ++v) {
    if (number[v] < 0) continue;
    for (const Index u : graph[v]) {
      *end = number[u];
      end += number[u] >= 0 ? 1 : 0;
    }
    out.start.push_back(static_cast<Index>(end - out.neighbours.data()));
  }
  out.neighbours.resize(static_cast<std::size_t>(out.start.back()));
  return out;
}

bool has_hubs(const BlockGraph& graph) {
  constexpr std::int64_t kManyTimes = 3;  // the average number of neighbours
  constexpr std::int64_t kLargePart = 4;  // a quarter of all pairs of neighbours
  const std::int64_t pairs = graph.start.back();
  std::int64_t of_hubs = 0;
  for (Index v = 0; v < graph.size(); ++v) {
    const auto own = static_cast<std::int64_t>(graph[v].size());
    if (own * graph.size() > kManyTimes * pairs) of_hubs += own;
  }
  return kLargePart * of_hubs > pairs;
}

ReducedGraph eliminate_chains(BlockGraph graph) { return ChainElimination(std::move(graph)).run(); }

}  // namespace mapjoin
