#include <fmt/format.h>

#include <memory>

#include "mapjoin/building/solve.h"
#include "mapjoin/cli/commands.h"
#include "mapjoin/cli/freed_memory.h"
#include "mapjoin/cli/input.h"
#include "mapjoin/cli/progress.h"
#include "mapjoin/cli/raw.h"
#include "mapjoin/cli/run.h"
#include "mapjoin/joining/join_all.h"

namespace mapjoin::cli {

namespace {

constexpr const char* kSolveExamples = R"(Examples:
  mapjoin solve intel.g2o --output intel_map.g2o
      The least squares optimum of a pose graph or a landmark graph. Vertices in the file are not
      used as an initial guess: none is needed. The result is in the frame of the lowest pose, or
      of the one that the file fixes (FIX).
  mapjoin solve monday.g2o --session 1 --output monday.map
      Keeps the measurements too, so that the map can be joined with others: see mapjoin join.
  mapjoin solve city.g2o --mode observe --json stats.json --output city.tum
      One linear solve a join and two at the end, nothing iterated.
  mapjoin solve park.g2o --local-maps 20 --mode summary --output park.g2o
      The recording is cut into 20 local maps, which are built by nonlinear least squares and
      joined. In optimal mode the result is the same for any number of them.
)";

struct SolveCommand {
  std::string graph;
  JoinArguments join;
  int local_maps = 0;  ///< 0: none are built
  BuildArguments build;
};

/// By local maps: what they are and how long they took goes into the notes.
template <int D>
JoinResult<D> solve_by_maps(const SolveCommand& a, const MeasurementGraph<D>& graph,
                            const JoinOptions& options) {
  const RawLog<D> log = raw_log(graph);
  const SegmentRule rule{SegmentRule::By::kMaps, static_cast<double>(a.local_maps)};
  SolvedLog<D> solved = solve_by_local_maps(log, segment(log, rule),
                                            build_options(a.build, options.threads), options);
  solved.result.report.notes.push_back(
      fmt::format("{} local maps, built in {:.3f} s and joined in {:.3f} s", solved.local_maps,
                  solved.seconds_build, solved.seconds_join));
  return std::move(solved.result);
}

void solve(const SolveCommand& given) {
  SolveCommand a = given;
  expect_outputs(a.join);
  if (a.join.memory_limit == 0) keep_freed_memory();
  // Local maps in order of time are joined as the paper has it, neighbours first.
  if (a.local_maps > 0 && a.join.tree.empty() && a.join.mode == "observe") a.join.tree = "order";
  if (input_format(a.graph) != InputFormat::kG2o) {
    throw InputError(fmt::format("{} is no g2o file; maps are joined by 'mapjoin join'", a.graph));
  }
  const Stopwatch reading;
  G2oOptions options;
  options.session = a.join.session;
  options.skip_unknown = a.join.skip_unknown;
  options.quaternion_information = a.join.quaternion_information;
  options.indefinite = information_policy(a.join.indefinite);
  const auto file = std::make_shared<const G2oGraph>(read_g2o(a.graph, options));
  Job job{a.join, reading.seconds(), 0, file->fixed, false, notes_of(file->counts)};
  std::visit(
      [&]<int D>(const MeasurementGraph<D>& graph) {
        job.measurements = static_cast<std::int64_t>(graph.size());
        run<D>(std::move(job), graph.variables, [&](const JoinOptions& o) {
          if (a.local_maps > 0) return solve_by_maps(a, graph, o);
          // Shared, so that the result keeps these measurements and no copy of them.
          return join_all(std::shared_ptr<const MeasurementGraph<D>>(file, &graph), o);
        });
      },
      file->graph);
}

}  // namespace

void add_solve(Command& app) {
  auto arguments = std::make_shared<SolveCommand>();
  Command command = app.add_command("solve", "Solve a measurement graph (g2o)");
  command.add_option("graph", arguments->graph, "The measurements")
      .type_name("GRAPH.g2o")
      .required();
  command
      .add_option("--local-maps", arguments->local_maps,
                  "Build this many local maps from the measurements, in order of the poses, and "
                  "join those [every pose with its measurements is a local map]")
      .type_name("N")
      .within(1, 1000000000);
  add_build_arguments(command, arguments->build, "--local-anchor");
  add_join_arguments(command, arguments->join);
  command.examples(std::string(kModes) + "\n" + kSolveExamples);
  command.run([arguments] { solve(*arguments); });
}

}  // namespace mapjoin::cli
