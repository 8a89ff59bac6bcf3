// Clusters of neighbouring variables: a graph of some hundred vertices that stands for a large one.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "mapjoin/solvers/block_graph.h"

namespace mapjoin {

struct Clusters {
  std::vector<std::int32_t> of;    ///< the cluster of each variable
  std::vector<std::int32_t> size;  ///< variables of each cluster
  BlockGraph graph;                ///< clusters, and which of them have variables that meet

  bool empty() const { return size.empty(); }
};

/// Clusters of up to `size` variables, each grown breadth first; what is left between clusters
/// joins the smallest of them. Cost: O(neighbours).
Clusters grow_clusters(const BlockGraph& graph, std::size_t size);

/// The clusters of a part of a graph. number[v]: of variable v in the part; negative where it is
/// not in it. Cheaper than growing new ones. Clusters that only met in variables that are gone
/// still count as neighbours.
Clusters clusters_of_part(const Clusters& clusters, std::span<const std::int32_t> number);

}  // namespace mapjoin
