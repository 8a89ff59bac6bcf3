#include "mapjoin/joining/refine.h"

#include <fmt/format.h>

#include <algorithm>

#include "mapjoin/graph/error.h"

namespace mapjoin {

namespace {

template <int D>
[[noreturn]] void throw_singular(const MeasurementGraph<D>& graph, int variable) {
  throw SingularError(
      fmt::format("the measurements do not determine {}: too few of them, or all blind in the same "
                  "direction; add a measurement of it "
                  "or leave it out",
                  to_string(graph.variables.key(variable))));
}

template <int D>
typename ObservationSystem<D>::Step solve(const MeasurementGraph<D>& graph, const Piece<D>& piece,
                                          ObservationSystem<D>& system, FrontalCholesky& cholesky,
                                          WorkerPool& pool, Eigen::VectorXd& d) {
  const auto step = system.solve(piece, cholesky, pool, d);
  if (!step.ok()) throw_singular(graph, step.failed);
  if (!d.allFinite()) throw_singular(graph, piece.variables[0]);
  return step;
}

}  // namespace

template <int D>
typename ObservationSystem<D>::Step linear_step(const MeasurementGraph<D>& graph, Piece<D>& piece,
                                                ObservationSystem<D>& system,
                                                FrontalCholesky& cholesky, WorkerPool& pool) {
  Eigen::VectorXd d;
  const auto step = solve(graph, piece, system, cholesky, pool, d);
  retract(graph.variables, piece,
          std::span<const double>(d.data(), static_cast<std::size_t>(d.size())));
  return step;
}

template <int D>
void linear_step_if_determined(const MeasurementGraph<D>& graph, Piece<D>& piece,
                               ObservationSystem<D>& system, FrontalCholesky& cholesky,
                               WorkerPool& pool) {
  Eigen::VectorXd d;
  if (!system.solve(piece, cholesky, pool, d).ok() || !d.allFinite()) return;
  retract(graph.variables, piece,
          std::span<const double>(d.data(), static_cast<std::size_t>(d.size())));
}

template <int D>
RefineResult refine(const MeasurementGraph<D>& graph, Piece<D>& piece, ObservationSystem<D>& system,
                    FrontalCholesky& cholesky, WorkerPool& pool, int most_solves, double tolerance,
                    const ProgressCallback& progress) {
  constexpr int kHalvings = 30;
  constexpr double kRounding = 1e-14;  // of chi2: an exact fit ends at rounding errors
  RefineResult result;
  Eigen::VectorXd d;
  std::vector<std::vector<double>> before;
  while (result.solves < most_solves) {
    if (progress && !progress({"refine", static_cast<double>(result.solves) / most_solves})) {
      throw CancelledError("cancelled while refining");
    }
    const auto step = solve(graph, piece, system, cholesky, pool, d);
    ++result.solves;
    const bool last = step.predicted_decrease <= std::max(tolerance * step.chi2, kRounding);
    before = piece.data;
    double length = 1.0;
    for (int halving = 0;; ++halving) {
      retract(graph.variables, piece,
              std::span<const double>(d.data(), static_cast<std::size_t>(d.size())));
      result.chi2 = system.chi2(piece, pool);
      if (result.chi2 <= step.chi2) break;
      piece.data = before;
      result.chi2 = step.chi2;
      // At the rounding level of chi2 nothing is left to gain.
      if (halving == kHalvings || last) break;
      length *= 0.5;
      d *= 0.5;
      if (halving == 0) ++result.shortened;
    }
    if (last) {
      result.minimum = true;
      break;
    }
    if (length < 1e-8) break;
  }
  return result;
}

#define MAPJOIN_INSTANTIATE(D)                                                                  \
  template RefineResult refine<D>(const MeasurementGraph<D>&, Piece<D>&, ObservationSystem<D>&, \
                                  FrontalCholesky&, WorkerPool&, int, double,                   \
                                  const ProgressCallback&);                                     \
  template ObservationSystem<D>::Step linear_step<D>(const MeasurementGraph<D>&, Piece<D>&,     \
                                                     ObservationSystem<D>&, FrontalCholesky&,   \
                                                     WorkerPool&);                              \
  template void linear_step_if_determined<D>(const MeasurementGraph<D>&, Piece<D>&,             \
                                             ObservationSystem<D>&, FrontalCholesky&,           \
                                             WorkerPool&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
