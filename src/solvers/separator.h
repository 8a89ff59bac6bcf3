// Parting a graph in two about equal halves by few vertices.
#pragma once

#include <cstddef>
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
  /// Returns the side of each variable: no edge joins left and right. Empty where one half would
  /// be: a clique cannot be parted. Deterministic (but see metis_turn.h). Cost: about
  /// O(neighbours).
  std::span<const Side> find(const BlockGraph& graph, int seed);

 private:
  BlockGraph gather(const BlockGraph& graph, std::size_t size);
  void grow_clusters(const BlockGraph& graph, std::size_t size);
  bool part(BlockGraph& clusters, int seed);
  void widen(const BlockGraph& graph);

  std::vector<std::int32_t> cluster_;       ///< of each variable
  std::vector<std::int32_t> cluster_size_;  ///< variables of each cluster
  std::vector<std::int32_t> members_;       ///< of the cluster that grows, and of the band
  std::vector<std::int32_t> part_;          ///< of each cluster: METIS's 0, 1, 2
  std::vector<Side> side_;
  VertexCut cut_;
};

}  // namespace mapjoin
