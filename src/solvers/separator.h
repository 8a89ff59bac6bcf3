// Parting a graph in two about equal halves by few vertices.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mapjoin/solvers/vertex_cut.h"

namespace mapjoin {

/// Parts graphs. One object for many graphs keeps its memory.
///
/// Variables are first gathered in clusters; METIS finds a separator among these, a graph of some
/// hundred vertices or a thirtieth of all; what it says is laid on the variables, and within a wide
/// band about it the smallest cut is found. That takes a fraction of the time METIS needs for the
/// graph itself, and as its refinement only looks one vertex ahead, the cuts are no larger.
class SeparatorFinder {
 public:
  /// `weight` is what each variable adds to its half, at least 1. Returns the side of each
  /// variable: no edge joins left and right. Empty where one half would be: a clique cannot be
  /// parted. Deterministic (METIS draws random numbers from the C library's generator, which it
  /// seeds; other programs' draws at the same time would disturb that). Cost: about O(neighbours).
  std::span<const Side> find(const BlockGraph& graph, std::span<const std::int32_t> weight,
                             int seed);

 private:
  struct Clusters {
    BlockGraph graph;
    std::vector<std::int32_t> weight;
  };
  Clusters gather(const BlockGraph& graph, std::span<const std::int32_t> weight,
                  std::int64_t cluster_weight);
  void grow_clusters(const BlockGraph& graph, std::span<const std::int32_t> weight,
                     std::int64_t cluster_weight);
  bool part(Clusters& clusters, int seed);
  void widen(const BlockGraph& graph);

  std::vector<std::int32_t> cluster_;         ///< of each variable
  std::vector<std::int32_t> cluster_weight_;  ///< of each cluster
  std::vector<std::int32_t> members_;         ///< of the cluster that grows, and of the band
  std::vector<std::int32_t> part_;            ///< of each cluster: METIS's 0, 1, 2
  std::vector<Side> side_;
  VertexCut cut_;
};

}  // namespace mapjoin
