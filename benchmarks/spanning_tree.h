#pragma once

#include <vector>

#include "mapjoin/graph/measurement_graph.h"

namespace mapjoin::benchmarks {

/// Initial values as solvers that need some are usually given them.
template <int D>
struct Start {
  std::vector<Rigid<D>> poses;  ///< in the order of the graph's pose column
  std::vector<Vec<D>> points;   ///< likewise; a point stands where its first observer sees it
  bool complete = false;        ///< every variable has been reached
};

/// Poses chained along a breadth-first spanning tree of the measurements between poses, from the
/// lowest pose on. O(measurements). Relative measurements of poses and points only.
template <int D>
Start<D> spanning_tree_start(const MeasurementGraph<D>& graph);

/// The measurements of poses, or of points; null where there are none.
template <int D>
const RelativeMeasurements<D>* measurements_of(const MeasurementGraph<D>& graph, Tag type);

/// Place of a variable within its column.
template <int D>
std::size_t place_of(const MeasurementGraph<D>& graph, Tag type, int variable) {
  return static_cast<std::size_t>(variable -
                                  graph.variables.column(graph.variables.find_column(type)).first);
}

}  // namespace mapjoin::benchmarks
