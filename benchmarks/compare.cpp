// mapjoin_benchmark: how long it takes to the optimum, measured in factorisations. See --help.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <deque>
#include <fstream>

#include "benchmarks/goals.h"
#include "benchmarks/tables.h"
#include "mapjoin/cli/freed_memory.h"
#include "mapjoin/graph/error.h"

namespace mapjoin::benchmarks {

namespace {

constexpr int kMissed = 1;
constexpr int kBadInput = 2;

constexpr const char* kHelp =
    R"(Seconds from measurements in memory to the least squares optimum, without initial values, beside
the two things that they can be compared with on the same machine:

  one factorisation   ordering, analysis, numeric factorisation and one solve of the final
                      information matrix by CHOLMOD: what every step of any sparse solver takes at
                      least. Each of CHOLMOD's variants is run, and the fastest counts. The ratio of
                      both times hardly depends on the machine: "2.5" says that a whole run takes as
                      long as two and a half linear solves.
  Ceres               the same problem from a spanning tree, stopped as soon as it is near enough.

Everything is run in turn, round by round, all data sets in each, and medians are printed: a machine
that is busy for some minutes then costs everybody a round and nobody all. Who is quick runs many
times in a round: one run of a millisecond says as much about where the system happened to put its
threads as about the work. For figures to be kept, run on an idle one. With one thread everything
stays on one processor and BLAS has one thread too.)";

constexpr const char* kExamples = R"(Worlds: manhattan, sphere, grid3d, landmarks2d, landmarks3d

Exit codes: 0 done; 1 some result is not the optimum within 1e-6 of chi2 (the table says which);
2 bad input or usage.

Examples:
  mapjoin_benchmark data/pose_graphs/*.g2o --json times.json --svg ratios.svg
  mapjoin_benchmark --simulate manhattan:100000 --simulate grid3d:20000 --repeat 3 --skip-ceres
  mapjoin_benchmark victoria_park_200/ --threads 1
  mapjoin_benchmark --growth manhattan:10000,100000,1000000
)";

struct Arguments {
  std::vector<std::string> inputs;
  std::vector<std::string> worlds, growths;
  std::uint64_t seed = 1;
  std::string json, svg;
  bool skip_ceres = false;
  ComparisonOptions options;
};

void add_options(CLI::App& app, Arguments& a) {
  app.add_option("inputs", a.inputs, "Measurement graphs (.g2o) and folders of localmap_K.txt")
      ->type_name("GRAPH.g2o|FOLDER");
  app.add_option("--simulate", a.worlds, "A simulated world of so many poses; may be repeated")
      ->type_name("WORLD:POSES")
      ->allow_extra_args(false);
  app.add_option("--growth", a.growths,
                 "How seconds grow with a simulated world, beside nobody; may be repeated")
      ->type_name("WORLD:POSES,POSES,...")
      ->allow_extra_args(false);
  app.add_option("--seed", a.seed, "Of the simulated worlds")->capture_default_str();
  app.add_option("--threads", a.options.threads, "Numbers of threads to run with, as 1,2")
      ->delimiter(',')
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
  app.add_option("--repeat", a.options.repeat, "Rounds to take the median of")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--between", a.options.between,
                 "Rounds of the joins alone after each round; they count like any other")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str();
  app.add_option("--round", a.options.round,
                 "Who takes less than so many seconds runs as often as fits into them, and the "
                 "median of these runs counts for the round")
      ->check(CLI::Range(0.0, 60.0))
      ->capture_default_str();
  app.add_option("--slow", a.options.slow, "What takes longer than so many seconds is run once")
      ->capture_default_str();
  app.add_flag("--skip-ceres", a.skip_ceres, "Do not run Ceres");
  app.add_option("--ceres-limit", a.options.ceres_limit, "Seconds after which Ceres is stopped")
      ->capture_default_str();
  app.add_option("--json", a.json, "Write all figures to this file")->type_name("FILE");
  app.add_option("--svg", a.svg, "Write a chart of the ratios to this file")->type_name("FILE");
}

void write(const std::string& path, const std::string& text) {
  if (path.empty()) return;
  std::ofstream file(path, std::ios::binary);
  file << text << std::flush;
  if (!file) throw FileError(fmt::format("cannot write {}", path));
}

/// Rounds of all races take turns.
template <class AnyRace>
void run_rounds(std::deque<AnyRace>& races, const Arguments& a) {
  for (int round = 1; round <= a.options.repeat && !races.empty(); ++round) {
    for (AnyRace& race : races) race.run_round();
    for (int k = 0; k < a.options.between; ++k) {
      for (AnyRace& race : races) race.run_between();
    }
    fmt::print(stderr, "round {} of {}\n", round, a.options.repeat);
  }
}

std::vector<Comparison> compare(const Arguments& a) {
  std::deque<ComparisonRace> races;
  const auto enter = [&](AnyProblem problem) {
    races.emplace_back(std::move(problem), a.options);
    fmt::print(stderr, "{} of {} data sets ready\n", races.size(),
               a.inputs.size() + a.worlds.size());
  };
  for (const std::string& path : a.inputs) enter(read_problem(path));
  for (const std::string& world : a.worlds) enter(simulate_problem(world, a.seed));
  run_rounds(races, a);
  std::vector<Comparison> out;
  for (ComparisonRace& race : races) {
    out.push_back(std::move(race).finish());
    const Comparison& c = out.back();
    fmt::print(stderr, "{}: {:.2f} times one factorisation{}\n", c.name, c.threads.front().ratio(),
               c.reached() ? "" : ", but NOT at the optimum");
  }
  return out;
}

std::vector<Growth> measure_growths(const Arguments& a) {
  std::deque<GrowthRace> races;
  for (const std::string& world : a.growths) races.emplace_back(world, a.seed, a.options);
  run_rounds(races, a);
  std::vector<Growth> out;
  for (GrowthRace& race : races) out.push_back(std::move(race).finish());
  return out;
}

int run(const Arguments& a) {
  // First the small ones: what large worlds leave behind, freed but kept, they would lie in.
  const std::vector<Comparison> comparisons = compare(a);
  const std::vector<Growth> growths = measure_growths(a);
  if (comparisons.empty() && growths.empty()) {
    throw InputError(
        "nothing to measure: name a .g2o file, a folder of local maps, --simulate or --growth");
  }
  std::vector<std::string> worlds = a.worlds;
  worlds.insert(worlds.end(), a.growths.begin(), a.growths.end());
  const std::vector<Goal> aims = goals(comparisons, growths);
  fmt::print("{}{}{}## Goals\n\n{}\n", markdown(comparisons, a.options),
             markdown(growths, a.options), worlds_table(worlds, a.seed), markdown(aims));
  write(a.json, json(comparisons, growths, aims, a.options));
  if (!comparisons.empty()) write(a.svg, chart(comparisons));
  const auto reached = [](const auto& what) { return what.reached(); };
  return std::all_of(comparisons.begin(), comparisons.end(), reached) &&
                 std::all_of(growths.begin(), growths.end(), reached)
             ? 0
             : kMissed;
}

}  // namespace

}  // namespace mapjoin::benchmarks

int main(int argc, char** argv) {
  using namespace mapjoin::benchmarks;
  mapjoin::cli::keep_freed_memory();  // as our program does; for all contenders
  CLI::App app(kHelp, "mapjoin_benchmark");
  app.footer(kExamples);
  Arguments arguments;
  add_options(app, arguments);
  try {
    app.parse(argc, argv);
    arguments.options.ceres = !arguments.skip_ceres;
    return run(arguments);
  } catch (const CLI::Success& asked) {
    return app.exit(asked);
  } catch (const CLI::ParseError& error) {
    fmt::print(stderr, "mapjoin_benchmark: {}\nSee 'mapjoin_benchmark --help'.\n", error.what());
    return kBadInput;
  } catch (const mapjoin::Error& error) {
    fmt::print(stderr, "mapjoin_benchmark: {}\n", error.what());
    return kBadInput;
  }
}
