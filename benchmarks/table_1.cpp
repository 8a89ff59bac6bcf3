// Table 1 of Linear SLAM, measured: linear and nonlinear joining of n local maps, sequentially and
// by divide and conquer, in units of one full nonlinear solve (from odometry, wherever it ends);
// beside the paper's predictions (25)-(28).
//
//   mapjoin_table_1 GRAPH.g2o [n ...]
#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <exception>
#include <string>
#include <vector>

#include "benchmarks/measure.h"
#include "benchmarks/nonlinear_joining.h"
#include "mapjoin/building/build.h"
#include "mapjoin/evaluation/evaluate.h"
#include "mapjoin/io/g2o.h"
#include "mapjoin/joining/join_all.h"

namespace {

using namespace mapjoin;
using namespace mapjoin::benchmarks;

constexpr double kIterations = 10.0;  // the m of the paper

/// What the paper predicts of joining n maps, relative to the full problem.
double predicted(double observations, double states, int n, bool sequential, bool linear) {
  const double m = linear ? 1.0 : kIterations;
  const auto solve = [&](double part) { return m * (part * states + std::pow(part * states, 3)); };
  double sum = 0.0;
  if (sequential) {
    for (int i = 2; i <= n; ++i) sum += solve(static_cast<double>(i) / n);
  } else {
    sum = solve(1.0);
    const int levels = static_cast<int>(std::ceil(std::log2(n)));
    for (int k = 1; k < levels; ++k)
      sum += solve(std::pow(2.0, k) / n) * std::floor(n / std::pow(2.0, k));
  }
  return sum / (kIterations * (observations + std::pow(states, 3)));
}

template <class Work>
double seconds_of(const Work& work) {
  const Laps watch;
  work();
  return watch.now();
}

template <int D>
void linear(const std::vector<Map<D>>& maps, bool sequential, Values<D>& out) {
  JoinOptions options;
  options.mode = Mode::kSummary;
  options.tree = TreeShape::kOrder;
  options.strategy = sequential ? Strategy::kSequential : Strategy::kDivideAndConquer;
  options.information = false;
  out = join_all(std::span<const Map<D>>(maps), {}, options).maps.at(0).values;
}

template <int D>
void table(const MeasurementGraph<D>& graph, const std::vector<int>& counts) {
  const RawLog<D> log = raw_log(graph);
  const auto segments = [&](int n) {
    return segment(log, {SegmentRule::By::kMaps, static_cast<double>(n)});
  };
  const BuiltMaps<D> full = build_local_maps(log, segments(1));
  fmt::print("one full nonlinear solve: {:.2f} s, {} iterations, chi2 {:.4f}\n\n", full.seconds,
             full.most_iterations, full.chi2);
  fmt::print(
      "| n | building | joining | strategy | seconds | of the full solve | predicted | iterations "
      "a "
      "join | RMSE of poses to the optimum, m |\n|---|---|---|---|---|---|---|---|---|\n");
  const Values<D> optimum = join_all(graph, {}).maps.at(0).values;
  const double observations = static_cast<double>(graph.size());
  const double states = graph.variables.size();
  for (const int n : counts) {
    const BuiltMaps<D> built = build_local_maps(log, segments(n));
    for (const bool is_linear : {true, false}) {
      for (const bool sequential : {true, false}) {
        Values<D> joined;
        NonlinearJoining cost;
        const double seconds = seconds_of([&] {
          if (is_linear) {
            linear(built.maps, sequential, joined);
          } else {
            joined =
                join_all_nonlinearly(std::span<const Map<D>>(built.maps), sequential, cost).values;
          }
        });
        const double a_join =
            is_linear ? 1.0 : static_cast<double>(cost.iterations) / std::max(1, cost.joins);
        fmt::print("| {} | {:.4f} | {} | {} | {:.3f} | {:.4f} | {:.4f} | {:.1f} | {:.6f} |\n", n,
                   built.seconds / full.seconds, is_linear ? "linear" : "nonlinear",
                   sequential ? "sequential" : "divide and conquer", seconds,
                   seconds / full.seconds,
                   predicted(observations, states, n, sequential, is_linear), a_join,
                   deviation(joined, optimum).pose_rmse);
        std::fflush(stdout);
      }
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    fmt::print(stderr, "usage: mapjoin_table_1 GRAPH.g2o [n ...]\n");
    return 2;
  }
  try {
    std::vector<int> counts;
    for (int k = 2; k < argc; ++k) {
      int n = 0;
      const auto [end, error] = std::from_chars(argv[k], argv[k] + std::strlen(argv[k]), n);
      if (error != std::errc() || *end != '\0' || n < 2)
        throw InputError(fmt::format("'{}' is no number of local maps", argv[k]));
      counts.push_back(n);
    }
    if (counts.empty()) counts = {5, 10, 20, 50, 100};
    const G2oGraph file = read_g2o(argv[1]);
    std::visit([&](const auto& graph) { table(graph, counts); }, file.graph);
    return 0;
  } catch (const std::exception& error) {
    fmt::print(stderr, "mapjoin_table_1: {}\n", error.what());
    return 2;
  }
}
