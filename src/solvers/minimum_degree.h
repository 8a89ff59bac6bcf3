// Elimination orders by approximate minimum degree (AMD, CAMD).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mapjoin/solvers/block_graph.h"

namespace mapjoin {

struct MinimumDegreeOrder {
  std::vector<std::int32_t> order;
  double multiplications = 0;  ///< of blocks, at most, that elimination will take
};

/// Deterministic. Takes the graph to pieces. Throws InputError beyond about 2^31 pairs.
MinimumDegreeOrder minimum_degree(BlockGraph graph);

/// The same with all variables with late[v] == 0 before those with 1.
std::vector<std::int32_t> minimum_degree_in_two(std::span<const char> late, BlockGraph graph);

}  // namespace mapjoin
