#pragma once

#include <string>

#include "benchmarks/measure.h"
#include "mapjoin/graph/measurement_graph.h"

namespace mapjoin::benchmarks {

/// Phases of a run, in the order in which they are returned.
inline constexpr const char* kCeresPhases[] = {"initial values and problem", "solve"};

struct CeresRun {
  double chi2 = 0.0;
  int iterations = 0;
  Measured measured;
};

/// Why Ceres cannot be run on these measurements, in words; empty where it can. It is run on
/// relative measurements of poses and points that one spanning tree reaches.
template <int D>
std::string why_not_ceres(const MeasurementGraph<D>& graph);

/// The same least squares problem as one would write it for Ceres: a parameter block for each pose
/// (in the plane x, y, heading; in space a position and a unit quaternion on its manifold) and
/// point, derivatives by automatic differentiation, Levenberg-Marquardt with
/// SPARSE_NORMAL_CHOLESKY, the lowest pose held, started from a breadth-first spanning tree.
///
/// Stops as soon as chi2 is at most `enough`, which is kinder than any rule that does not know the
/// optimum; or when Ceres finds no further decrease; or after `limit` seconds.
template <int D>
CeresRun run_ceres(const MeasurementGraph<D>& graph, int threads, double enough, double limit);

}  // namespace mapjoin::benchmarks
