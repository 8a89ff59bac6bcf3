// Elimination orders by nested dissection, for large graphs and for threads.
#pragma once

#include <cstdint>
#include <vector>

#include "mapjoin/solvers/block_graph.h"
#include "mapjoin/solvers/worker_pool.h"

namespace mapjoin {

/// Parts the graph in two by a separator, each half again, down to parts of about a thousand
/// variables (four thousand among hubs), which minimum degree orders; separators come after what
/// they part. A few large separators at the top decide how much work elimination is (growing as n
/// to the power 1.5 in the plane, where minimum degree alone does worse), and halves can be
/// eliminated at the same time; within small parts minimum degree is better and quicker.
///
/// Returns `order`: order[k] is the variable eliminated k-th. The same for any number of threads.
/// Cost: about O(n log n), four times minimum degree.
std::vector<std::int32_t> nested_dissection(const BlockGraph& graph, int seed, WorkerPool& pool);

}  // namespace mapjoin
