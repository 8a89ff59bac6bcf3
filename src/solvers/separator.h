// Parting a graph in two about equal halves by few vertices.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mapjoin/solvers/clusters.h"
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
  /// O(neighbours). `clusters` are those of this graph, or empty: then they are made, and left
  /// there for parts of the graph (clusters_of_part) that are large_enough_for_clusters.
  std::span<const Side> find(const BlockGraph& graph, Clusters& clusters, int seed);

 private:
  bool part(Clusters& clusters, int seed);
  void widen(const BlockGraph& graph);

  std::vector<std::int32_t> part_;  ///< of each cluster: METIS's 0, 1, 2
  std::vector<std::int32_t> band_;  ///< variables at the cut
  std::vector<Side> side_;
  VertexCut cut_;
};

/// Would a graph of so many variables have as large clusters as any? If not, new ones serve better.
bool large_enough_for_clusters(std::int32_t variables);

}  // namespace mapjoin
