#include "mapjoin/solvers/block_ordering.h"

#include <amd.h>
#include <camd.h>

// After these: METIS's header defines plain macros.
#include <metis.h>

#include <limits>
#include <numeric>
#include <string>

#include "mapjoin/graph/error.h"
#include "mapjoin/solvers/elimination_tree.h"

namespace mapjoin {
namespace {

using Index = std::int32_t;

/// METIS takes about as long as this many operations of factorizing for every variable and
/// neighbour in the graph. It is asked for a second order where minimum degree's makes more work
/// than that: what it can save, a join and its refinement save several times.
constexpr double kDissectionFlops = 4e4;

// Keeps the first of equal entries in each row and closes the gaps, in place.
void remove_duplicates(BlockGraph& graph) {
  const auto variables = static_cast<Index>(graph.start.size()) - 1;
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

struct MinimumDegreeOrder {
  std::vector<Index> order;
  double multiplications = 0;  ///< of blocks, at most, that elimination will take
};

// amd_2 is AMD without the checks and copies of amd_order; it destroys the graph it is given.
MinimumDegreeOrder minimum_degree(BlockGraph graph) {
  const auto n = static_cast<Index>(graph.start.size()) - 1;
  const Index entries = graph.start[n];
  const std::int64_t space = std::int64_t{entries} + entries / 5 + n + 1;
  if (space > std::numeric_limits<Index>::max())
    throw InputError("order_blocks: the block graph is too large");
  graph.neighbours.resize(static_cast<std::size_t>(space));

  std::vector<Index> work(static_cast<std::size_t>(n) * 8);
  const auto row = [&](int k) {
    return work.data() + static_cast<std::size_t>(k) * static_cast<std::size_t>(n);
  };
  Index* const length = row(0);
  for (Index v = 0; v < n; ++v) length[v] = graph.start[v + 1] - graph.start[v];
  std::vector<Index> order(static_cast<std::size_t>(n));
  double control[AMD_CONTROL];
  double info[AMD_INFO];
  amd_defaults(control);
  amd_2(n, graph.start.data(), graph.neighbours.data(), length, static_cast<Index>(space), entries,
        row(1), row(2), order.data(), row(3), row(4), row(5), row(6), control, info);
  return {std::move(order), info[AMD_NMULTSUBS_LDL]};
}

std::vector<Index> nested_dissection(std::span<const Index> dims, BlockGraph graph, int seed) {
  static_assert(sizeof(idx_t) == sizeof(Index), "mapjoin expects METIS with 32-bit indices");
  auto n = static_cast<idx_t>(dims.size());
  std::vector<idx_t> weights(dims.begin(), dims.end());
  std::vector<idx_t> order(dims.size());
  std::vector<idx_t> position(dims.size());
  idx_t options[METIS_NOPTIONS];
  METIS_SetDefaultOptions(options);
  options[METIS_OPTION_SEED] = seed;
  const int status = METIS_NodeND(&n, graph.start.data(), graph.neighbours.data(), weights.data(),
                                  options, order.data(), position.data());
  if (status != METIS_OK)
    throw Error("order_blocks: METIS_NodeND failed, code " + std::to_string(status));
  return order;
}

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

std::vector<std::int32_t> order_blocks_in_two(std::span<const char> late, Cliques cliques) {
  const auto n = static_cast<Index>(late.size());
  if (n == 0) return {};
  BlockGraph graph = block_graph(n, cliques);
  // CAMD takes sorted or unsorted columns, each pair in both.
  std::vector<Index> group(late.begin(), late.end());
  std::vector<Index> order(late.size());
  const int status = camd_order(n, graph.start.data(), graph.neighbours.data(), order.data(),
                                nullptr, nullptr, group.data());
  if (status != CAMD_OK && status != CAMD_OK_BUT_JUMBLED)
    throw Error("order_blocks_in_two: CAMD failed, code " + std::to_string(status));
  return order;
}

std::vector<std::int32_t> order_blocks(std::span<const std::int32_t> dims, Cliques cliques,
                                       const OrderingOptions& options) {
  if (dims.empty()) return {};
  if (options.method == OrderingMethod::kNatural) {
    std::vector<Index> order(dims.size());
    std::iota(order.begin(), order.end(), 0);
    return order;
  }
  BlockGraph graph = block_graph(static_cast<Index>(dims.size()), cliques);
  if (options.method == OrderingMethod::kNestedDissection)
    return nested_dissection(dims, std::move(graph), options.seed);
  if (options.method == OrderingMethod::kMinimumDegree)
    return minimum_degree(std::move(graph)).order;

  const double entries = static_cast<double>(dims.size() + graph.neighbours.size());
  const double block =
      std::accumulate(dims.begin(), dims.end(), 0.0) / static_cast<double>(dims.size());
  MinimumDegreeOrder quick = minimum_degree(std::move(graph));
  const double flops = 2.0 * quick.multiplications * block * block * block;
  if (flops < kDissectionFlops * entries) return std::move(quick.order);
  // The first order has used the graph up: seldom is a second one worth a copy.
  std::vector<Index> dissected =
      nested_dissection(dims, block_graph(static_cast<Index>(dims.size()), cliques), options.seed);
  return elimination_flops(dims, cliques, dissected) < elimination_flops(dims, cliques, quick.order)
             ? std::move(dissected)
             : std::move(quick.order);
}

}  // namespace mapjoin
