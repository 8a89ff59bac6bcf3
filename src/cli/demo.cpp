#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <numeric>
#include <system_error>

#include "mapjoin/cli/commands.h"
#include "mapjoin/cli/demo_picture.h"
#include "mapjoin/cli/output.h"
#include "mapjoin/cli/progress.h"
#include "mapjoin/cli/run.h"
#include "mapjoin/cli/terminal.h"
#include "mapjoin/evaluation/evaluate.h"
#include "mapjoin/evaluation/simulate.h"
#include "mapjoin/io/g2o.h"
#include "mapjoin/joining/join_all.h"

namespace mapjoin::cli {

namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kStretch = 25;  // poses of a local map

constexpr const char* kDemoExamples = R"(Example:
  mapjoin demo --output demo
      Simulates a drive among point features, cuts it into local maps of 25 poses, joins them, and
      compares the result with the truth. Leaves demo/before_after.svg to look at, and the files to
      try the other commands on.
)";

struct DemoCommand {
  std::string output;
  std::int64_t poses = 1000;
  std::uint64_t seed = 3;
};

/// Solves stretches of consecutive poses apart, each with the measurements taken from its poses.
/// Neighbours share one pose; features are shared by all who saw them.
std::vector<Map<2>> make_local_maps(const MeasurementGraph<2>& graph) {
  std::vector<std::vector<std::int64_t>> stretches;
  std::int64_t number = 0;
  for (const auto& measurements : graph.relative) {
    for (const std::int32_t from : measurements.from) {
      const auto k = static_cast<std::size_t>(graph.variables.key(from).id / kStretch);
      if (k >= stretches.size()) stretches.resize(k + 1);
      stretches[k].push_back(number++);
    }
  }
  std::vector<Map<2>> maps;
  for (const auto& stretch : stretches) {
    Interruptible::check();
    maps.push_back(join_all(subgraph<2>(graph, stretch)).maps.at(0));
  }
  return maps;
}

Key last_pose(const Map<2>& map) {
  return map.variables().column(map.variables().find_column(Tag("pose"))).keys.back();
}

/// Where each local map lies when its first pose is put on the last pose of the one before.
std::vector<Rigid2> lay_end_to_end(const std::vector<Map<2>>& maps) {
  std::vector<Rigid2> places{Rigid2()};
  for (const Map<2>& map : maps) {
    places.push_back(places.back() * map.values.pose(last_pose(map)));
  }
  return places;
}

/// All local maps as one set of values; a variable is where the first map that has it says.
Values<2> overlaid(const std::vector<Map<2>>& maps, const std::vector<Rigid2>& places) {
  ValuesBuilder<2> out;
  std::vector<Key> known;
  for (std::size_t k = 0; k < maps.size(); ++k) {
    Values<2> values = maps[k].values;
    values.transform(places[k]);
    const std::size_t before = known.size();
    for (int i = 0; i < values.size(); ++i) {
      const Key& key = values.variables().key(i);
      if (std::binary_search(known.begin(), known.begin() + static_cast<std::ptrdiff_t>(before),
                             key)) {
        continue;
      }
      out.add(values.variables().kind(i), key, values.value(i));
      known.push_back(key);
    }
    std::sort(known.begin(), known.end());
  }
  return std::move(out).build();
}

void print_row(const std::string& name, const Values<2>& values, const Simulation<2>& world) {
  const Deviation d = deviation(values, world.truth);
  fmt::print("  {:<30}{:>14.1f}{:>14.3f}{:>14.3f}\n", name, chi2(values, world.graph), d.pose_rmse,
             d.feature_rmse);
}

JoinResult<2> join_in_mode(const std::vector<Map<2>>& maps, Mode mode) {
  ProgressBar bar;
  JoinOptions options;
  options.mode = mode;
  options.progress = bar.callback();
  return join_all(std::span<const Map<2>>(maps), MeasurementGraph<2>(), options);
}

fs::path make_directories(const DemoCommand& a) {
  std::error_code error;
  fs::create_directories(fs::path(a.output) / "local_maps", error);
  if (error) {
    throw FileError(fmt::format("cannot create the folder {}: {}", a.output, error.message()));
  }
  return a.output;
}

void write_all(const fs::path& folder, const Simulation<2>& world, const DemoMaps& maps) {
  OutputFiles files;
  files.write(folder / "world.g2o", [&](const auto& at) { write_g2o<2>(at, world.graph); });
  files.write(folder / "truth.g2o", [&](const auto& at) { write_g2o<2>(at, world.truth); });
  for (std::size_t k = 0; k < maps.local_maps.size(); ++k) {
    write_piece(files, folder / "local_maps" / fmt::format("{:04}.map", k + 1), maps.local_maps[k],
                false, false);
  }
  write_piece(files, folder / "joined.g2o", maps.joined, false, false);
  files.write_text(folder / "before_after.svg", demo_picture(maps));
  files.commit();
}

void demo(const DemoCommand& a) {
  if (a.poses < 2) throw InputError("--poses: a drive has at least 2");
  const fs::path folder = make_directories(a);
  const Interruptible interruptible;
  SimulationOptions options = simulation_defaults(World::kLandmarks2d);
  options.poses = a.poses;
  options.seed = a.seed;
  const Simulation<2> world = simulate<2>(options);
  fmt::print("{}\n  {} poses, {} features, {} measurements; no initial guess\n\n",
             bold("A simulated drive"), a.poses, world.truth.size() - a.poses, world.graph.size());

  const std::vector<Map<2>> local_maps = make_local_maps(world.graph);
  const std::vector<Rigid2> places = lay_end_to_end(local_maps);
  const std::string head =
      fmt::format("{:<32}{:>14}{:>14}{:>14}", fmt::format("{} local maps", local_maps.size()),
                  "chi2", "poses [m]", "features [m]");
  fmt::print("{}\n", bold(head));
  print_row("laid end to end", overlaid(local_maps, places), world);
  print_row("joined, summaries alone", join_in_mode(local_maps, Mode::kSummary).maps.at(0).values,
            world);
  print_row("joined, with observations", join_in_mode(local_maps, Mode::kObserve).maps.at(0).values,
            world);
  const JoinResult<2> result = join_in_mode(local_maps, Mode::kOptimal);
  print_row("joined, to the optimum", result.maps.at(0).values, world);
  fmt::print(
      "  (RMSE to the truth, per coordinate, in the frame of pose 0; the optimum's chi2 is "
      "about {})\n\n",
      world.graph.residuals() + 3 - static_cast<std::size_t>(world.truth.variables().scalars()));

  write_all(folder, world, {world.truth, local_maps, places, result.maps.at(0)});
  const std::string at = folder.string();
  fmt::print(
      "{}\n  {}/before_after.svg   the picture\n  {}/world.g2o, truth.g2o, joined.g2o, "
      "local_maps/\n\n",
      bold("Look at"), at, at);
  fmt::print(
      "{}\n  mapjoin join {}/local_maps/*.map --output {}/again.g2o\n"
      "  mapjoin evaluate {}/again.g2o --graph {}/world.g2o --reference {}/truth.g2o\n",
      bold("Try"), at, at, at, at, at);
}

}  // namespace

void add_demo(Command& app) {
  auto arguments = std::make_shared<DemoCommand>();
  Command command = app.add_command("demo", "See it work: simulate, cut, join, compare, draw");
  command.add_option("-o,--output", arguments->output, "A folder; created where it does not exist")
      .type_name("DIR")
      .required();
  command.add_option("--poses", arguments->poses, "Length of the drive, m").show_default();
  command.add_option("--seed", arguments->seed, "Another seed, another world").show_default();
  command.examples(kDemoExamples);
  command.run([arguments] { demo(*arguments); });
}

}  // namespace mapjoin::cli
