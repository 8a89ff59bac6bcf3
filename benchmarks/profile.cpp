// mapjoin_profile: joins one graph again and again and does nothing else, for profilers to look at.
//
//   mapjoin_profile GRAPH.g2o|WORLD:POSES [SECONDS] [THREADS]
//
// scripts/profile.py runs it under perf and sums up by what the time went into.
#include <fmt/format.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <vector>

#include "benchmarks/join_run.h"
#include "mapjoin/cli/freed_memory.h"
#include "mapjoin/graph/error.h"

namespace mapjoin::benchmarks {

namespace {

/// Joins for so many seconds, once at least. \returns the seconds of each join.
template <int D>
std::vector<double> join_for(const Problem<D>& problem, double seconds, int threads) {
  std::vector<double> out;
  const Laps watch;
  do {
    out.push_back(run_join(problem, threads, false).measured.seconds());
  } while (watch.now() < seconds);
  return out;
}

int run(const std::string& input, double seconds, int threads) {
  try {
    const AnyProblem problem =
        std::filesystem::exists(input) ? read_problem(input) : simulate_problem(input, 1);
    const std::vector<double> runs =
        std::visit([&](const auto& p) { return join_for(p, seconds, threads); }, problem);
    fmt::print("{} joins, {:.6f} s each\n", runs.size(), median(runs));
    return 0;
  } catch (const Error& error) {
    fmt::print(stderr, "mapjoin_profile: {}\n", error.what());
    return 2;
  }
}

}  // namespace

}  // namespace mapjoin::benchmarks

int main(int argc, char** argv) {
  if (argc < 2 || argc > 4) {
    fmt::print(stderr, "usage: mapjoin_profile GRAPH.g2o|FOLDER|WORLD:POSES [SECONDS] [THREADS]\n");
    return 2;
  }
  mapjoin::cli::keep_freed_memory();  // as our program does
  return mapjoin::benchmarks::run(argv[1], argc > 2 ? std::atof(argv[2]) : 5.0,
                                  argc > 3 ? std::max(1, std::atoi(argv[3])) : 1);
}
