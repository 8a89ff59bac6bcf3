#include "mapjoin/joining/refine.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "mapjoin/graph/error.h"
#include "mapjoin/graph/whole_piece.h"
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
  run_chunks(piece.size(), kChunk, loop_on(pool),
             [&](int first, int last) { retract(graph.variables, piece, step, first, last); });
}

/// What is tried, one after the other, until a step is the last. A near chord is one that hardly
/// promises anything: for where nothing else is known of the rate.
enum class Kind { kNearChord, kChord, kCorrection, kWhole };

/// How much slower than after whole steps promises fall after those of a kind.
double lag(Kind kind) {
  return kind == Kind::kWhole ? 1.0 : kind == Kind::kCorrection ? 10.0 : 4.0;
}

/// What a step leaves above the minimum; see refine.
double remainder(double decrease, double promised, double promised_before, Kind kind) {
  const double rate = lag(kind) * promised / promised_before;  // m^2
  if (promised_before <= 0.0 || rate >= 1.0) return std::numeric_limits<double>::infinity();
  return std::max(std::abs(decrease - promised), promised * rate) / (1.0 - std::sqrt(rate));
}

/// One run of refine: where it is, and what the factor at hand is good for.
template <int D>
class Refinement {
 public:
  Refinement(const MeasurementGraph<D>& graph, Piece<D>& piece, ObservationSystem<D>& system,
             FrontalCholesky& cholesky, WorkerPool& pool, double tolerance, LastSolve last_solve)
      : graph_(graph),
        piece_(piece),
        system_(system),
        cholesky_(cholesky),
        pool_(pool),
        tolerance_(tolerance),
        promised_before_(last_solve.promised),
        then_(std::move(last_solve.values)) {
    next_ = after_whole(last_solve.chi2 - last_solve.promised);
    // Joins end near the minimum, however far they came.
    if (next_ == Kind::kWhole && promised_before_ >= 0.0) next_ = Kind::kNearChord;
  }

  RefineResult run(int most_solves, const ProgressCallback& progress) {
    bool more = true;
    while (more && result_.solves < most_solves) {
      if (progress && !progress({"refine", static_cast<double>(result_.solves) / most_solves}))
        throw CancelledError("cancelled while refining");
      more = advance();
    }
    return result_;
  }

 private:
  using Step = typename ObservationSystem<D>::Step;

  /// After a step that promised more than this of chi2, much is no longer as it was.
  Kind after_whole(double chi2) {
    constexpr double kSmallStep = 0.5;
    chi2_expected_ = chi2;
    return promised_before_ >= 0.0 && promised_before_ <= kSmallStep * chi2 ? Kind::kChord
                                                                            : Kind::kWhole;
  }

  /// The next step, into d_. One that cannot be the last, because of what it promises, is none.
  Step find_step() {
    constexpr double kChordReach = 20.0;  // of the tolerance
    const double enough = tolerance_ * chi2_expected_;
    if (next_ == Kind::kNearChord || next_ == Kind::kChord) {
      const double most = next_ == Kind::kChord ? kChordReach * enough : enough;
      if (const auto step = system_.solve_again(piece_, cholesky_, pool_, most, d_)) return *step;
      next_ = next_ == Kind::kChord ? Kind::kCorrection : Kind::kWhole;
    }
    if (next_ == Kind::kCorrection && !then_.empty()) {
      const double most = std::sqrt(enough * promised_before_ / lag(next_));  // see remainder
      if (const auto step = system_.correct(then_, piece_, cholesky_, pool_, most, d_))
        return *step;
    }
    next_ = Kind::kWhole;
    ++result_.factorizations;
    return solve(graph_, piece_, system_, cholesky_, pool_, d_);
  }

  /// Takes d_, but not where chi2 would increase. \returns whether it did.
  bool take(double chi2_now) {
    take_step(graph_, piece_, d_, pool_);
    result_.chi2 = system_.chi2(piece_, pool_);
    if (result_.chi2 <= chi2_now) return true;
    piece_.data = before_;
    result_.chi2 = chi2_now;
    return false;
  }

  /// \returns whether more steps are needed.
  bool advance() {
    constexpr int kHalvings = 30;
    constexpr double kRounding = 1e-14;  // of chi2: an exact fit ends at rounding errors
    constexpr double kNothing = 0.01;  // of the tolerance: so small a promise needs no second look
    const Step step = find_step();
    const bool old_factor = next_ != Kind::kWhole;
    if (result_.solves++ == 0) result_.chi2_before = step.chi2;
    const double promised = step.predicted_decrease;
    const double enough = std::max(tolerance_ * step.chi2, kRounding);
    const bool last = promised <= std::max(kNothing * enough, kRounding);
    before_ = piece_.data;
    double length = 1.0;
    // What comes next knows better than half a step by the old factor; and at the rounding level of
    // chi2 nothing is left to gain.
    for (int halving = 0; !take(step.chi2) && !old_factor && !last && halving < kHalvings;
         ++halving) {
      length *= 0.5;
      d_ *= 0.5;
      if (halving == 0) ++result_.shortened;
    }
    const double decrease = step.chi2 - result_.chi2;
    const bool whole = length == 1.0;
    if (last || (whole && remainder(decrease, promised, promised_before_, next_) <= enough)) {
      result_.minimum = true;
      return false;
    }
    if (length < 1e-8) return false;
    if (old_factor) {
      next_ = after_old_factor(decrease, promised);
      return true;
    }
    promised_before_ = whole ? promised : -1.0;
    then_.swap(before_);
    next_ = after_whole(result_.chi2);
    return true;
  }

  /// Where a chord step was not taken the piece is still where the last whole step led, which a
  /// correction is for; elsewhere what that asks for is not the optimum.
  Kind after_old_factor(double decrease, double promised) {
    constexpr double kChordMiss = 0.1;  // of its promise: one that misses more is the last of them
    if (next_ == Kind::kCorrection) return Kind::kWhole;
    if (decrease <= 0.0) return Kind::kCorrection;
    then_.clear();
    chi2_expected_ = result_.chi2;
    // What is known of the rate stays what the last whole solve said, but for a good step.
    if (std::abs(decrease - promised) > kChordMiss * promised) return Kind::kWhole;
    promised_before_ = promised;
    return Kind::kChord;
  }

  const MeasurementGraph<D>& graph_;
  Piece<D>& piece_;
  ObservationSystem<D>& system_;
  FrontalCholesky& cholesky_;
  WorkerPool& pool_;
  const double tolerance_;
  double promised_before_;      // by the last step that counts for the rate
  double chi2_expected_ = 0.0;  // before the next
  Kind next_ = Kind::kWhole;
  Eigen::VectorXd d_;
  std::vector<std::vector<double>> then_;    // values before the last whole step, if it led here
  std::vector<std::vector<double>> before_;  // and before the step at hand
  RefineResult result_;
};

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
                    const ProgressCallback& progress, LastSolve last_solve) {
  return Refinement<D>(graph, piece, system, cholesky, pool, tolerance, std::move(last_solve))
      .run(most_solves, progress);
}

template <int D>
RefineResult refine_from(const MeasurementGraph<D>& graph, const Values<D>& values, int most_solves,
                         double tolerance) {
  Piece<D> piece = whole_piece(graph, values);
  Places places(graph.variables.size());
  ObservationSystem<D> system(graph, piece, {}, places);
  FrontalCholesky cholesky;
  WorkerPool pool;
  return refine(graph, piece, system, cholesky, pool, most_solves, tolerance, {});
}

#define MAPJOIN_INSTANTIATE(D)                                                                     \
  template RefineResult refine<D>(const MeasurementGraph<D>&, Piece<D>&, ObservationSystem<D>&,    \
                                  FrontalCholesky&, WorkerPool&, int, double,                      \
                                  const ProgressCallback&, LastSolve);                             \
  template RefineResult refine_from<D>(const MeasurementGraph<D>&, const Values<D>&, int, double); \
  template ObservationSystem<D>::Step linear_step<D>(const MeasurementGraph<D>&, Piece<D>&,        \
                                                     ObservationSystem<D>&, FrontalCholesky&,      \
                                                     WorkerPool&);                                 \
  template void linear_step_if_determined<D>(const MeasurementGraph<D>&, Piece<D>&,                \
                                             ObservationSystem<D>&, FrontalCholesky&,              \
                                             WorkerPool&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
