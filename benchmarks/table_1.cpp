// Table 1 of Linear SLAM, measured: building n local maps, and joining them linearly and
// nonlinearly, sequentially and by divide and conquer, in units of one full nonlinear solve (from
// odometry, wherever it ends); beside the paper's predictions (25)-(28), which count dense cubes.
//
//   mapjoin_table_1 GRAPH.g2o [n ...]
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <exception>
#include <limits>
#include <span>
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

/// A way of joining: a column of the table.
struct Way {
  const char* name;
  bool linear, sequential;
};
constexpr Way kWays[] = {{"linear, sequential", true, true},
                         {"linear, divide and conquer", true, false},
                         {"nonlinear, sequential", false, true},
                         {"nonlinear, divide and conquer", false, false}};

/// What the paper predicts of building n maps, relative to the full problem.
double predicted_building(double observations, double states, int n) {
  const double all = observations + std::pow(states, 3);
  return (observations + std::pow(states, 3) / (1.0 * n * n)) / all;
}

/// ... and of joining them.
double predicted_joining(double observations, double states, int n, const Way& way) {
  const double m = way.linear ? 1.0 : kIterations;
  const auto solve = [&](double part) { return m * (part * states + std::pow(part * states, 3)); };
  double sum = 0.0;
  if (way.sequential) {
    for (int i = 2; i <= n; ++i) sum += solve(static_cast<double>(i) / n);
  } else {
    sum = solve(1.0);
    const int levels = static_cast<int>(std::ceil(std::log2(n)));
    for (int k = 1; k < levels; ++k)
      sum += solve(std::pow(2.0, k) / n) * std::floor(n / std::pow(2.0, k));
  }
  return sum / (kIterations * (observations + std::pow(states, 3)));
}

/// The best of three, or as many as fit into two seconds.
template <class Work>
double seconds_of(const Work& work) {
  double best = std::numeric_limits<double>::infinity();
  const Laps all;
  for (int k = 0; k < 3 && (k == 0 || all.now() < 2.0); ++k) {
    const Laps watch;
    work();
    best = std::min(best, watch.now());
  }
  return best;
}

template <int D>
Values<D> joined(const std::vector<Map<D>>& maps, const Way& way, NonlinearJoining& cost) {
  cost = {};
  if (!way.linear)
    return join_all_nonlinearly(std::span<const Map<D>>(maps), way.sequential, cost).values;
  JoinOptions options;
  options.mode = Mode::kSummary;
  options.tree = TreeShape::kOrder;
  options.strategy = way.sequential ? Strategy::kSequential : Strategy::kDivideAndConquer;
  options.information = false;
  return join_all(std::span<const Map<D>>(maps), {}, options).maps.at(0).values;
}

template <int D>
void table(const MeasurementGraph<D>& graph, const std::vector<int>& counts) {
  const RawLog<D> log = raw_log(graph);
  const BuiltMaps<D> full =
      build_local_maps(log, segment(log, {SegmentRule::By::kMaps, 1.0}), {.whole = true});
  fmt::print("one full nonlinear solve: {:.2f} s, {} iterations, chi2 {:.4f}\n\n", full.seconds,
             full.most_iterations, full.chi2);
  const Values<D> optimum = join_all(graph, {}).maps.at(0).values;
  const auto observations = static_cast<double>(graph.size());
  const double states = graph.variables.size();
  std::string details =
      "| n | joining | seconds | joins | iterations a join | RMSE of poses to the optimum, m |\n"
      "|---|---|---|---|---|---|\n";
  fmt::print("| n | building | predicted |");
  for (const Way& way : kWays) fmt::print(" {} | predicted |", way.name);
  fmt::print("\n|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (const int n : counts) {
    const Segmentation segments = segment(log, {SegmentRule::By::kMaps, static_cast<double>(n)});
    BuiltMaps<D> built;
    const double building = seconds_of([&] { built = build_local_maps(log, segments); });
    fmt::print("| {} | {:.4f} | {:.4f} |", n, building / full.seconds,
               predicted_building(observations, states, n));
    for (const Way& way : kWays) {
      Values<D> values;
      NonlinearJoining cost;
      const double seconds = seconds_of([&] { values = joined(built.maps, way, cost); });
      fmt::print(" {:.4f} | {:.4f} |", seconds / full.seconds,
                 predicted_joining(observations, states, n, way));
      std::fflush(stdout);
      const double iterations =
          way.linear ? 1.0 : static_cast<double>(cost.iterations) / std::max(1, cost.joins);
      details +=
          fmt::format("| {} | {} | {:.3f} | {} | {:.1f} | {:.6f} |\n", n, way.name, seconds,
                      built.maps.size() - 1, iterations, deviation(values, optimum).pose_rmse);
    }
    fmt::print("\n");
  }
  fmt::print("\n{}", details);
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
