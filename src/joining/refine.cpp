#include "mapjoin/joining/refine.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "mapjoin/graph/error.h"
#include "mapjoin/solvers/pool_loop.h"

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

/// x = x [+] d, on all threads.
template <int D>
void take_step(const MeasurementGraph<D>& graph, Piece<D>& piece, const Eigen::VectorXd& d,
               WorkerPool& pool) {
  constexpr int kChunk = 2048;  // variables
  const std::span<const double> step(d.data(), static_cast<std::size_t>(d.size()));
  const auto chunk = [&](int i) {
    retract(graph.variables, piece, step, i * kChunk, std::min((i + 1) * kChunk, piece.size()));
  };
  const int chunks = (piece.size() + kChunk - 1) / kChunk;
  run_loop(chunks, loop_on(pool), chunk);
}

/// Of chi2: after a step that promises no more the matrix may serve once more.
constexpr double kSmallStep = 0.5;
/// Of the tolerance: a chord step that promises more would not be the last.
constexpr double kChordReach = 30.0;

/// What a whole step leaves above the minimum; see refine.
double remainder(double decrease, double promised, double promised_before, bool chord) {
  const double rate = (chord ? 4.0 : 1.0) * promised / promised_before;  // m^2
  if (promised_before <= 0.0 || rate >= 1.0) return std::numeric_limits<double>::infinity();
  return std::max(std::abs(decrease - promised), promised * rate) / (1.0 - std::sqrt(rate));
}

}  // namespace

template <int D>
typename ObservationSystem<D>::Step linear_step(const MeasurementGraph<D>& graph, Piece<D>& piece,
                                                ObservationSystem<D>& system,
                                                FrontalCholesky& cholesky, WorkerPool& pool) {
  Eigen::VectorXd d;
  const auto step = solve(graph, piece, system, cholesky, pool, d);
  take_step(graph, piece, d, pool);
  return step;
}

template <int D>
void linear_step_if_determined(const MeasurementGraph<D>& graph, Piece<D>& piece,
                               ObservationSystem<D>& system, FrontalCholesky& cholesky,
                               WorkerPool& pool) {
  Eigen::VectorXd d;
  if (!system.solve(piece, cholesky, pool, d).ok() || !d.allFinite()) return;
  take_step(graph, piece, d, pool);
}

template <int D>
RefineResult refine(const MeasurementGraph<D>& graph, Piece<D>& piece, ObservationSystem<D>& system,
                    FrontalCholesky& cholesky, WorkerPool& pool, int most_solves, double tolerance,
                    const ProgressCallback& progress, const LastSolve& last_solve) {
  constexpr int kHalvings = 30;
  constexpr double kRounding = 1e-14;  // of chi2: an exact fit ends at rounding errors
  constexpr double kNothing = 0.01;    // of the tolerance: so small a promise needs no second look
  constexpr double kChordMiss = 0.1;   // of its promise: a chord step that misses more is the last
  RefineResult result;
  Eigen::VectorXd d;
  std::vector<std::vector<double>> before;
  double promised_before = last_solve.promised;
  const auto factor_serves_again = [&](double chi2) {
    return promised_before >= 0.0 && promised_before <= kSmallStep * chi2;
  };
  double chi2_expected = last_solve.chi2 - last_solve.promised;
  bool chord = factor_serves_again(chi2_expected);
  while (result.solves < most_solves) {
    if (progress && !progress({"refine", static_cast<double>(result.solves) / most_solves})) {
      throw CancelledError("cancelled while refining");
    }
    std::optional<typename ObservationSystem<D>::Step> again;
    if (chord) {
      const double most = kChordReach * tolerance * chi2_expected;
      again = system.solve_again(piece, cholesky, pool, most, d);
    }
    chord = again.has_value();
    const auto step = chord ? *again : solve(graph, piece, system, cholesky, pool, d);
    if (result.solves++ == 0) result.chi2_before = step.chi2;
    const double promised = step.predicted_decrease;
    const double enough = std::max(tolerance * step.chi2, kRounding);
    const bool last = promised <= std::max(kNothing * enough, kRounding);
    before = piece.data;
    double length = 1.0;
    for (int halving = 0;; ++halving) {
      take_step(graph, piece, d, pool);
      result.chi2 = system.chi2(piece, pool);
      if (result.chi2 <= step.chi2) break;
      piece.data = before;
      result.chi2 = step.chi2;
      if (chord) break;  // a whole solve knows better than half a step
      // At the rounding level of chi2 nothing is left to gain.
      if (halving == kHalvings || last) break;
      length *= 0.5;
      d *= 0.5;
      if (halving == 0) ++result.shortened;
    }
    chi2_expected = result.chi2;
    const bool whole = length == 1.0;
    if (last ||
        (whole && remainder(step.chi2 - result.chi2, promised, promised_before, chord) <= enough)) {
      result.minimum = true;
      break;
    }
    if (length < 1e-8) break;
    if (chord && std::abs(step.chi2 - result.chi2 - promised) > kChordMiss * promised) {
      chord = false;
      continue;  // what is known of the rate stays what the last whole solve said
    }
    promised_before = whole ? promised : -1.0;
    chord = chord || factor_serves_again(result.chi2);
  }
  return result;
}

#define MAPJOIN_INSTANTIATE(D)                                                                  \
  template RefineResult refine<D>(const MeasurementGraph<D>&, Piece<D>&, ObservationSystem<D>&, \
                                  FrontalCholesky&, WorkerPool&, int, double,                   \
                                  const ProgressCallback&, const LastSolve&);                   \
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
