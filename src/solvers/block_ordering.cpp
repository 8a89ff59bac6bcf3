#include "mapjoin/solvers/block_ordering.h"

#include <metis.h>

#include <numeric>
#include <string>

#include "mapjoin/graph/error.h"
#include "mapjoin/solvers/elimination_tree.h"
#include "mapjoin/solvers/minimum_degree.h"
#include "mapjoin/solvers/nested_dissection.h"

namespace mapjoin {
namespace {

using Index = std::int32_t;

/// Dissection takes about as long as this many operations of factorizing for every variable and
/// neighbour in the graph. Where minimum degree's order makes more work, it is worth its time: what
/// it saves, a join and its refinement save several times.
constexpr double kDissectionFlops = 4e3;
/// Variables, chains aside, from which nobody asks minimum degree: its order would make more work.
constexpr Index kLargeGraph = 16000;

std::vector<Index> metis_order(std::span<const Index> dims, BlockGraph graph, int seed) {
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

/// Chains first, then the rest by nested dissection.
std::vector<Index> dissect(const ReducedGraph& reduced, int seed, WorkerPool* pool) {
  WorkerPool alone;
  std::vector<Index> order = reduced.eliminated;
  for (const Index v : nested_dissection(reduced.graph, seed, pool != nullptr ? *pool : alone))
    order.push_back(reduced.variable[static_cast<std::size_t>(v)]);
  return order;
}

std::vector<Index> automatic_order(std::span<const Index> dims, Cliques cliques, BlockGraph graph,
                                   int seed, WorkerPool* pool) {
  const double entries = static_cast<double>(graph.size()) + graph.start.back();
  const double block =
      std::accumulate(dims.begin(), dims.end(), 0.0) / static_cast<double>(dims.size());
  const ReducedGraph reduced = eliminate_chains(graph);
  if (reduced.graph.size() < kLargeGraph) {
    MinimumDegreeOrder quick = minimum_degree(std::move(graph));
    const double flops = 2.0 * quick.multiplications * block * block * block;
    if (flops < kDissectionFlops * entries) return std::move(quick.order);
    std::vector<Index> dissected = dissect(reduced, seed, pool);
    return elimination_flops(dims, cliques, dissected) <
                   elimination_flops(dims, cliques, quick.order)
               ? std::move(dissected)
               : std::move(quick.order);
  }
  return dissect(reduced, seed, pool);
}

}  // namespace

std::vector<std::int32_t> order_blocks_in_two(std::span<const char> late, Cliques cliques) {
  if (late.empty()) return {};
  return minimum_degree_in_two(late, block_graph(static_cast<Index>(late.size()), cliques));
}

std::vector<std::int32_t> order_blocks(std::span<const std::int32_t> dims, Cliques cliques,
                                       const OrderingOptions& options, WorkerPool* pool) {
  if (dims.empty()) return {};
  if (options.method == OrderingMethod::kNatural) {
    std::vector<Index> order(dims.size());
    std::iota(order.begin(), order.end(), 0);
    return order;
  }
  BlockGraph graph = block_graph(static_cast<Index>(dims.size()), cliques);
  switch (options.method) {
    case OrderingMethod::kMetis:
      return metis_order(dims, std::move(graph), options.seed);
    case OrderingMethod::kNestedDissection:
      return dissect(eliminate_chains(std::move(graph)), options.seed, pool);
    case OrderingMethod::kMinimumDegree:
      return minimum_degree(std::move(graph)).order;
    default:
      break;
  }
  return automatic_order(dims, cliques, std::move(graph), options.seed, pool);
}

}  // namespace mapjoin
