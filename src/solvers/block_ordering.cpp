#include "mapjoin/solvers/block_ordering.h"

#include <metis.h>

#include <numeric>
#include <string>

#include "mapjoin/graph/error.h"
#include "mapjoin/solvers/metis_turn.h"
#include "mapjoin/solvers/minimum_degree.h"
#include "mapjoin/solvers/nested_dissection.h"
#include "mapjoin/solvers/symbolic_elimination.h"

namespace mapjoin {
namespace {

using Index = std::int32_t;

/// Dissection takes about as long as this many operations of factorizing for every variable and
/// neighbour in the graph. Where minimum degree's order makes more work, it is worth its time: what
/// it saves, a join and its refinement save several times.
constexpr double kDissectionFlops = 4e3;
/// Variables, chains aside, below which dissection has too few levels to do better than minimum
/// degree, and from which nobody asks minimum degree: its order would make more work.
constexpr Index kSmallGraph = 4000, kLargeGraph = 16000;

std::vector<Index> metis_order(std::span<const Index> dims, BlockGraph graph, int seed) {
  auto n = static_cast<idx_t>(dims.size());
  std::vector<idx_t> weights(dims.begin(), dims.end());
  std::vector<idx_t> order(dims.size());
  std::vector<idx_t> position(dims.size());
  idx_t options[METIS_NOPTIONS];
  METIS_SetDefaultOptions(options);
  options[METIS_OPTION_SEED] = seed;
  const MetisTurn turn;
  const int status = METIS_NodeND(&n, graph.start.data(), graph.neighbours.data(), weights.data(),
                                  options, order.data(), position.data());
  if (status != METIS_OK)
    throw Error("order_blocks: METIS_NodeND failed, code " + std::to_string(status));
  return order;
}

/// Chains first, then the rest in its order.
std::vector<Index> after_chains(const ReducedGraph& reduced, std::span<const Index> order) {
  std::vector<Index> out = reduced.eliminated;
  out.reserve(out.size() + order.size());
  for (const Index v : order) out.push_back(reduced.variable[static_cast<std::size_t>(v)]);
  return out;
}

std::vector<Index> dissect(const ReducedGraph& reduced, int seed, WorkerPool* pool) {
  WorkerPool alone;
  return after_chains(reduced,
                      nested_dissection(reduced.graph, seed, pool != nullptr ? *pool : alone));
}

std::vector<Index> automatic_order(std::span<const Index> dims, const BlockGraph& graph,
                                   const ReducedGraph& reduced, int seed, WorkerPool* pool) {
  if (reduced.graph.size() >= kLargeGraph ||
      (reduced.graph.size() >= kSmallGraph && has_hubs(reduced.graph)))
    return dissect(reduced, seed, pool);
  const MinimumDegreeOrder quick = minimum_degree(reduced.graph);
  std::vector<Index> order = after_chains(reduced, quick.order);
  if (reduced.graph.size() < kSmallGraph) return order;
  const double enough = kDissectionFlops * (static_cast<double>(reduced.graph.size()) +
                                            static_cast<double>(reduced.graph.start.back()));
  const double block =
      std::accumulate(dims.begin(), dims.end(), 0.0) / static_cast<double>(dims.size());
  if (2.0 * quick.multiplications * block * block * block < enough) return order;
  const double flops = elimination_flops(dims, graph, order);
  if (flops < enough) return order;
  std::vector<Index> dissected = dissect(reduced, seed, pool);
  return elimination_flops(dims, graph, dissected) < flops ? dissected : order;
}

}  // namespace

std::vector<std::int32_t> order_blocks_in_two(std::span<const char> late, Cliques cliques) {
  if (late.empty()) return {};
  return minimum_degree_in_two(late, block_graph(static_cast<Index>(late.size()), cliques));
}

std::vector<std::int32_t> order_blocks(std::span<const std::int32_t> dims, const BlockGraph& graph,
                                       const OrderingOptions& options, WorkerPool* pool) {
  if (dims.empty()) return {};
  if (options.method == OrderingMethod::kNatural) {
    std::vector<Index> order(dims.size());
    std::iota(order.begin(), order.end(), 0);
    return order;
  }
  if (options.method == OrderingMethod::kMetis) return metis_order(dims, graph, options.seed);
  if (options.method == OrderingMethod::kMinimumDegree) return minimum_degree(graph).order;
  const ReducedGraph reduced = eliminate_chains(graph);
  return options.method == OrderingMethod::kNestedDissection
             ? dissect(reduced, options.seed, pool)
             : automatic_order(dims, graph, reduced, options.seed, pool);
}

std::vector<std::int32_t> order_blocks(std::span<const std::int32_t> dims, Cliques cliques,
                                       const OrderingOptions& options, WorkerPool* pool) {
  return order_blocks(dims, block_graph(static_cast<Index>(dims.size()), cliques), options, pool);
}

}  // namespace mapjoin
