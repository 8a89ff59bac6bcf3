#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "mapjoin/association/sessions.h"
#include "mapjoin/cli/commands.h"
#include "mapjoin/cli/freed_memory.h"
#include "mapjoin/cli/input.h"
#include "mapjoin/cli/join_command.h"
#include "mapjoin/cli/progress.h"
#include "mapjoin/cli/run.h"
#include "mapjoin/cli/sequence.h"
#include "mapjoin/filtering/methods.h"
#include "mapjoin/io/native_map.h"
#include "mapjoin/joining/join_all.h"

namespace mapjoin::cli {

namespace {

constexpr const char* kJoinExamples = R"(Methods, of a folder of local maps in their order:
  linear    Linear SLAM; --mode, --tree and --strategy say how
  slsjf     Sparse Local Submap Joining Filter: local maps fused one after another, linearised once
  islsjf    The same, smoothed over all local maps at the end: the optimum
  dslam     D-SLAM map joining: a map of features alone, by what is relative among them
  idslam    Its iterated form, I-DMJ
  ekf       Map joining by a dense extended Kalman filter: the last pose and all features

Examples:
  mapjoin join victoria_park_200 --output park.g2o
      A folder of localmap_1.txt, localmap_2.txt, ... (or .mat, from MATLAB). Features are written
      as vertices 100000 + id.
  mapjoin join victoria_park_200 --features-only --anchor points:84,85 --output features.map
      The same with all poses marginalised out of the local maps first: D-SLAM.
  mapjoin join victoria_park_200 --method slsjf --output park.map
      By another method; 'mapjoin compare' runs several side by side.
  mapjoin join victoria_park_200 --associate jcbb --judge --output park.g2o
      The same without using its features' numbers but to judge what was found.
  mapjoin join monday.map tuesday.map --output week.g2o
      Maps made by solve or join. Variables of equal session and id are the same variable.
  mapjoin join monday.map tuesday.map --associate jcbb --output week.map
      Two recordings of one place that share no names: found by their features.
  mapjoin solve monday.g2o --session 1 --output monday.map
  mapjoin solve tuesday.g2o --session 2 --output tuesday.map
  mapjoin join monday.map tuesday.map --links links.g2o --output week.map
      Two recordings that both count from 0, read under two sessions, and measurements between
      them: ids in links.g2o are written 1/12 (pose 12 of session 1).
)";

template <int D>
MeasurementGraph<D> read_links(const JoinCommand& a, const VariableSet<D>& variables,
                               std::vector<std::string>& notes) {
  if (a.links.empty()) return {};
  G2oOptions options;
  options.session = a.join.session;
  options.skip_unknown = a.join.skip_unknown;
  options.quaternion_information = a.join.quaternion_information;
  options.indefinite = information_policy(a.join.indefinite);
  G2oGraph file = read_g2o(a.links, options);
  if (file.dimension != D) {
    throw InputError(
        fmt::format("{} holds {}D measurements but the maps are {}D", a.links, file.dimension, D));
  }
  auto links = std::get<MeasurementGraph<D>>(std::move(file.graph));
  for (int i = 0; i < links.variables.size(); ++i) {
    variables.require(links.variables.key(i), "in " + a.links);
  }
  notes = notes_of(file.counts);
  return links;
}

template <int D>
void join_maps(const JoinCommand& a, const std::vector<AnyMap>& any, const Stopwatch& reading) {
  std::vector<Map<D>> maps;
  for (std::size_t k = 0; k < any.size(); ++k) {
    const auto* map = std::get_if<Map<D>>(&any[k]);
    if (map == nullptr) {
      throw InputError(
          fmt::format("{} is {}D but {} is {}D: maps of the plane and of space cannot "
                      "be joined",
                      a.inputs[0], D, a.inputs[k], 5 - D));
    }
    maps.push_back(*map);
  }
  Job job{a.join, 0.0, 0, {}, false, {}};
  if (a.associate != "given") {
    auto found = associate_sessions(std::span<const Map<D>>(maps), association_options(a));
    maps = std::move(found.maps);
    job.association = AssociationSummary{a.associate, std::move(found.report), {}};
  }
  std::vector<const VariableSet<D>*> sets;
  for (const Map<D>& map : maps) sets.push_back(&map.variables());
  const VariableSet<D> variables = unite<D>(sets);
  const MeasurementGraph<D> links = read_links<D>(a, variables, job.notes);
  job.read_seconds = reading.seconds();
  job.measurements = static_cast<std::int64_t>(links.size());
  for (const Map<D>& map : maps) {
    job.measurements += map.observations ? static_cast<std::int64_t>(map.observations->size()) : 1;
  }
  run<D>(std::move(job), variables,
         [&](const JoinOptions& o) { return join_all(std::span<const Map<D>>(maps), links, o); });
}

/// Options that mean nothing to the methods other than the linear one, where they are given.
void expect_linear_only(const Command& command, const JoinCommand& a) {
  if (parse_method(a.join.method) == Method::kLinear) return;
  for (const char* option : {"--mode", "--tree", "--strategy", "--threads", "--tolerance",
                             "--memory-limit", "--scratch", "--checkpoint", "--features-only"}) {
    if (command.has(option))
      throw InputError(fmt::format("{} goes with --method linear; --method {} has no such choice",
                                   option, a.join.method));
  }
}

void join(const JoinCommand& given) {
  JoinCommand a = given;
  expect_outputs(a.join);
  if (a.join.memory_limit == 0) keep_freed_memory();
  // A folder is a sequence of local maps; where nothing asks for that, its native maps are joined
  // as finished maps are, with all that they carry.
  const bool as_sequence =
      a.features_only || a.check_matches || a.associate != "given" || a.join.method != "linear";
  if (a.inputs.size() == 1 && input_format(a.inputs[0]) == InputFormat::kLocalMaps &&
      !as_sequence) {
    const std::vector<std::string> maps = native_maps_in(a.inputs[0]);
    if (!maps.empty()) a.inputs = maps;
  }
  if (!a.merged_list.empty()) {
    if (!a.features_only) throw InputError("--merged-list goes with --features-only");
    OutputFiles::expect(a.merged_list);
  }
  if (a.judge && a.associate == "given")
    throw InputError("--judge goes with --associate nn, gnn or jcbb: it judges what those find");
  const bool folder = std::any_of(a.inputs.begin(), a.inputs.end(), [](const std::string& path) {
    return input_format(path) == InputFormat::kLocalMaps;
  });
  if (folder && a.inputs.size() > 1) {
    throw InputError(
        "join takes either one folder of local maps or native maps (.map): solve the "
        "folder into a .map first");
  }
  if (folder) return join_local_maps(a);
  if (a.join.method != "linear") {
    throw InputError(fmt::format(
        "--method {} goes with a folder of local maps, whose order it follows; finished maps are "
        "joined by the linear method",
        a.join.method));
  }
  if (a.judge || a.check_matches)
    throw InputError("--judge and --check-matches go with a folder of local maps");
  if (a.features_only) {
    throw InputError(
        "--features-only goes with a folder of local maps; of native maps, 'mapjoin marginalize "
        "MAP --keep features' first");
  }
  const Stopwatch reading;
  std::vector<AnyMap> maps;
  for (const std::string& path : a.inputs) {
    if (input_format(path) != InputFormat::kNative) {
      throw InputError(
          fmt::format("{} is neither a native map (.map) nor a folder of local maps; a "
                      "g2o file becomes a map by 'mapjoin solve {} --output X.map'",
                      path, path));
    }
    maps.push_back(read_any_map(path));
  }
  if (std::holds_alternative<Map<2>>(maps[0])) {
    join_maps<2>(a, maps, reading);
  } else {
    join_maps<3>(a, maps, reading);
  }
}

}  // namespace

void add_join(Command& app) {
  auto arguments = std::make_shared<JoinCommand>();
  Command command = app.add_command("join", "Join local maps, or maps made before");
  command
      .add_option("maps", arguments->inputs,
                  "A folder of localmap_K.map, .txt or .mat, or native maps (.map)")
      .type_name("FOLDER|MAP")
      .required();
  command
      .add_option("--links", arguments->links,
                  "Measurements between variables of the maps, in g2o; ids as 12 or 1/12 (session "
                  "1)")
      .type_name("LINKS.g2o");
  command.add_flag(
      "--features-only", arguments->features_only,
      "Marginalise the poses out of every local map of the folder, then join by "
      "features alone; neighbours that share too few are joined with their poses first");
  command
      .add_option(
          "--merged-list", arguments->merged_list,
          "With --features-only: which local maps each feature-only map is made of, and its "
          "frame")
      .type_name("FILE.csv");
  command
      .add_option(
          "--method", arguments->join.method,
          "How local maps are joined: linear, slsjf, islsjf, dslam, idslam or ekf; see below")
      .one_of({"linear", "slsjf", "islsjf", "dslam", "idslam", "ekf"})
      .show_default();
  command
      .add_option(
          "--associate", arguments->associate,
          "Which features of the maps are the same: as they are numbered (given), or found by "
          "nearest neighbour (nn), global nearest neighbour (gnn) or "
          "joint compatibility (jcbb). In a folder, what is found is numbered from 1; native "
          "maps that share nothing are laid on one another by their features first")
      .one_of({"given", "nn", "gnn", "jcbb"})
      .show_default();
  command
      .add_option("--gate", arguments->gate,
                  "With --associate: probability with which a right match is within the gate")
      .type_name("P")
      .show_default();
  command
      .add_option("--odds", arguments->odds,
                  "With --associate: how many times as likely as any other choice a match must be; "
                  "0: the matcher decides alone")
      .not_negative()
      .type_name("N")
      .show_default();
  command
      .add_option(
          "--max-distance", arguments->max_distance,
          "With --associate: metres beyond which features are not compared [whatever the gate "
          "allows]")
      .not_negative()
      .type_name("M");
  command.add_flag(
      "--check-matches", arguments->check_matches,
      "With given numbers: test in every join whether each feature that is joined agrees "
      "with the others. With --associate this is always done");
  command.add_flag("--judge", arguments->judge,
                   "With --associate: print precision and recall by the numbers in the files");
  add_join_arguments(command, arguments->join);
  command.examples(std::string(kModes) + "\n" + kJoinExamples);
  command.run([arguments, command] {
    expect_linear_only(command, *arguments);
    join(*arguments);
  });
}

}  // namespace mapjoin::cli
