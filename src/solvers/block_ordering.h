// Fill-reducing elimination orders of block variables.
//
// A least-squares problem over blocks (poses, points) is given by its *cliques*: each measurement
// couples the few variables it touches. Two variables are neighbours when some clique holds both.
// Eliminating a variable makes all its remaining neighbours one clique; a good order keeps those
// cliques small.
//
// Ordering the block graph instead of the scalar matrix gives the same quality (the rows of one
// block always have the same pattern) on a graph 3 times (2D poses) or 6 times (3D poses) smaller,
// with 9 to 36 times fewer edges.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mapjoin/solvers/block_graph.h"
#include "mapjoin/solvers/worker_pool.h"

namespace mapjoin {

enum class OrderingMethod {
  kAutomatic,         ///< chains of poses first; the rest, if large, by nested dissection, else by
                      ///< minimum degree
  kMinimumDegree,     ///< AMD: fastest, and best for small graphs
  kNestedDissection,  ///< less fill on large graphs, wider trees for threads (nested_dissection.h)
  kMetis,             ///< METIS's own: as good, five times slower; to compare with
  kNatural,           ///< variable 0 first: for teaching and tests
};

struct OrderingOptions {
  OrderingMethod method = OrderingMethod::kAutomatic;
  int seed = 0;  ///< of METIS; equal seeds give equal orders
};

/// A minimum degree order in which all variables with late[v] == 0 come before those with 1 (CAMD).
/// Deterministic. Errors as block_graph.
std::vector<std::int32_t> order_blocks_in_two(std::span<const char> late, Cliques cliques);

/// Returns `order`: order[k] is the variable eliminated k-th. `dims` (one entry per variable, at
/// least 1) weigh the variables for METIS. Deterministic, and the same for any number of threads;
/// without a pool, one. Errors as block_graph; Error when METIS fails.
std::vector<std::int32_t> order_blocks(std::span<const std::int32_t> dims, const BlockGraph& graph,
                                       const OrderingOptions& options = {},
                                       WorkerPool* pool = nullptr);
std::vector<std::int32_t> order_blocks(std::span<const std::int32_t> dims, Cliques cliques,
                                       const OrderingOptions& options = {},
                                       WorkerPool* pool = nullptr);

}  // namespace mapjoin
