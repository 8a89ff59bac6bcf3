#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mapjoin/graph/measurement_graph.h"

namespace mapjoin {

/// Which maps are joined with which: data, made by a tree builder and walked by the joiner.
///
/// Nodes 0 .. leaves()-1 are leaves, which hold observations; the others are joins of their
/// children, each numbered higher than all of them. The last node is the root. Every observation
/// stands in exactly one leaf.
struct JoinTree {
  std::vector<std::int64_t> observations;    ///< leaf by leaf
  std::vector<std::int64_t> leaf_start{0};   ///< per leaf, into observations
  std::vector<std::int32_t> child_start{0};  ///< per join, into children
  std::vector<std::int32_t> children;

  int leaves() const { return static_cast<int>(leaf_start.size()) - 1; }
  int joins() const { return static_cast<int>(child_start.size()) - 1; }
  int nodes() const { return leaves() + joins(); }
  std::span<const std::int64_t> leaf(int node) const;
  std::span<const std::int32_t> children_of(int node) const;
  /// Nodes by height: all of level 0 can be done at once, then all of level 1, ...
  std::vector<std::vector<std::int32_t>> levels() const;

  void add_leaf(std::span<const std::int64_t> members);
  /// Only after the last leaf. \returns the node's number.
  int add_join(std::span<const std::int32_t> nodes);
};

/// The observations of a graph as local maps: all measurements taken from one pose are a
/// star-shaped local map; every submap is one, and those with the same first anchor variable count
/// as one. groups[k] are the observations of the k-th, ascending by anchor, or in the order of
/// `order`, first keys of anchors, where it names them.
template <int D>
std::vector<std::vector<std::int64_t>> local_maps_of(const MeasurementGraph<D>& graph,
                                                     std::span<const Key> order = {});

/// Pairs of neighbours by index, an odd one out going up unchanged (Linear SLAM section 5.2), or
/// `arity` at once.
JoinTree divide_and_conquer_tree(std::span<const std::vector<std::int64_t>> local_maps,
                                 int arity = 2);

/// Each local map onto all before it (section 5.1).
JoinTree sequential_tree(std::span<const std::vector<std::int64_t>> local_maps);

/// A tree from the graph's own structure: METIS bisects the graph of variables into about n /
/// leaf_variables parts, whose numbers then are the tree. A measurement between two poses lies in
/// the lower part, any other with its pose. Deterministic. Joins take `arity` (a power of two)
/// neighbours at once.
template <int D>
JoinTree graph_tree(const MeasurementGraph<D>& graph, int leaf_variables, int arity);

}  // namespace mapjoin
