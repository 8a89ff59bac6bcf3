#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "mapjoin/association/sessions.h"
#include "mapjoin/cli/commands.h"
#include "mapjoin/cli/input.h"
#include "mapjoin/cli/progress.h"
#include "mapjoin/cli/run.h"
#include "mapjoin/frames/anchors.h"
#include "mapjoin/io/local_maps.h"
#include "mapjoin/io/native_map.h"
#include "mapjoin/joining/features_only.h"
#include "mapjoin/joining/join_all.h"

namespace mapjoin::cli {

namespace {

constexpr const char* kExamples = R"(Examples:
  mapjoin join victoria_park_200 --output park.g2o
      A folder of localmap_1.txt, localmap_2.txt, ... (or .mat, from MATLAB). Features are written
      as vertices 100000 + id.
  mapjoin join victoria_park_200 --features-only --anchor points:84,85 --output features.map
      The same with all poses marginalised out of the local maps first: D-SLAM.
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

constexpr double kFalseAlarm = 0.01;  // of a join whose matches are all right

struct Arguments {
  std::vector<std::string> inputs;
  std::string links;
  bool features_only = false;
  std::string merged_list;
  std::string associate = "given";
  double gate = 0.9999;
  double odds = 1000.0;
  bool check_matches = false;
  bool judge = false;
  JoinArguments join;
};

/// Which local maps each feature-only map is made of, by their numbers, and its frame.
template <int D>
std::string merged_list(const FeatureOnlyMaps<D>& features, int first_number) {
  std::string out = "map,first,last,frame\n";
  for (std::size_t k = 0; k < features.maps.size(); ++k) {
    out +=
        fmt::format("{},{},{},\"{}\"\n", k + 1, features.first[k] + first_number,
                    features.first[k + 1] - 1 + first_number, to_string(features.maps[k].anchor));
  }
  return out;
}

template <int D>
std::string note_of(const FeatureOnlyMaps<D>& features) {
  int merged = 0;
  for (std::size_t k = 0; k < features.maps.size(); ++k) merged += features.parts(k) > 1 ? 1 : 0;
  return fmt::format(
      "{} feature-only maps of {} local maps: {} are made of several, joined with their poses, "
      "because neighbours shared too few features",
      features.maps.size(), features.first.back(), merged);
}

template <int D>
void join_features(const Arguments& a, const LocalMapSet<D>& set, Job job) {
  const Stopwatch marginalizing;
  const FeatureOnlyMaps<D> features = features_only(std::span<const LocalMap<D>>(set.maps));
  job.read_seconds += marginalizing.seconds();
  job.measurements = static_cast<std::int64_t>(features.maps.size());
  job.notes.push_back(note_of(features));
  std::vector<const VariableSet<D>*> sets;
  for (const Map<D>& map : features.maps) sets.push_back(&map.variables());
  run<D>(std::move(job), unite<D>(sets), [&](const JoinOptions& o) {
    return join_all(std::span<const Map<D>>(features.maps), {}, o);
  });
  if (!a.merged_list.empty()) {
    OutputFiles list;
    list.write_text(a.merged_list, merged_list(features, set.first_number));
    list.commit();
  }
}

AssociationOptions association_options(const Arguments& a) {
  AssociationOptions options;
  if (a.associate == "nn") options.matcher = Matcher::kNearest;
  if (a.associate == "gnn") options.matcher = Matcher::kGlobal;
  options.candidates.gate = options.joint.gate = a.gate;
  options.odds = a.odds;
  return options;
}

/// Finds out which features of the local maps are the same, or tests what their names say.
template <int D>
void associate(const Arguments& a, LocalMapSet<D>& set, Job& job) {
  const bool find = a.associate != "given";
  if (!find && !a.check_matches) return;
  const Interruptible interruptible;
  ProgressBar bar;
  const Strategy strategy = join_options(a.join).strategy;
  AssociationSummary summary{a.associate, {}, {}};
  if (!find) {
    summary.report = check_given_matches<D>(set.maps, kFalseAlarm, strategy, bar.callback());
  } else {
    AssociatedMaps<D> found =
        join_associating<D>(set.maps, association_options(a), strategy, bar.callback());
    if (a.judge) {
      std::vector<Key> named;
      for (const Sighting& sighting : found.sightings) named.push_back(sighting.original);
      summary.score = score(found.names, named);
    }
    set.maps = std::move(found.local_maps);
    summary.report = std::move(found.report);
  }
  job.association = std::move(summary);
}

void join_local_maps(const Arguments& a) {
  if (!a.links.empty()) {
    throw InputError("--links goes with native maps: join the folder into a .map first");
  }
  const Stopwatch reading;
  LocalMapOptions options;
  options.session = a.join.session;
  options.indefinite = information_policy(a.join.indefinite);
  AnyLocalMapSet any = read_local_maps(a.inputs[0], options);
  std::visit(
      [&]<int D>(LocalMapSet<D>& set) {
        Job job{a.join, reading.seconds(), static_cast<std::int64_t>(set.maps.size()), {}, true,
                {}};
        G2oCounts counts;
        counts.repaired = set.repaired;
        job.notes = notes_of(counts);
        associate(a, set, job);
        if (a.features_only) return join_features(a, set, std::move(job));
        MeasurementGraphBuilder<D> builder;  // for the variables alone
        for (const LocalMap<D>& map : set.maps) builder.add(map);
        run<D>(std::move(job), std::move(builder).build().variables, [&](const JoinOptions& o) {
          return join_all(std::span<const LocalMap<D>>(set.maps), o);
        });
      },
      any);
}

template <int D>
MeasurementGraph<D> read_links(const Arguments& a, const VariableSet<D>& variables,
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
void join_maps(const Arguments& a, const std::vector<AnyMap>& any, const Stopwatch& reading) {
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

void join(const Arguments& a) {
  expect_outputs(a.join);
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

void add_join(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *app.add_subcommand("join", "Join local maps, or maps made before");
  command
      .add_option("maps", arguments->inputs,
                  "A folder of localmap_K.txt or .mat, or native maps (.map)")
      ->type_name("FOLDER|MAP")
      ->required();
  command
      .add_option("--links", arguments->links,
                  "Measurements between variables of the maps, in g2o; ids as 12 or 1/12 (session "
                  "1)")
      ->type_name("LINKS.g2o");
  command.add_flag(
      "--features-only", arguments->features_only,
      "Marginalise the poses out of every local map of the folder, then join by "
      "features alone; neighbours that share too few are joined with their poses first");
  command
      .add_option(
          "--merged-list", arguments->merged_list,
          "With --features-only: which local maps each feature-only map is made of, and its "
          "frame")
      ->type_name("FILE.csv");
  command
      .add_option(
          "--associate", arguments->associate,
          "Which features of the maps are the same: as they are numbered (given), or found by "
          "nearest neighbour (nn), global nearest neighbour (gnn) or "
          "joint compatibility (jcbb). In a folder, what is found is numbered from 1; native "
          "maps that share nothing are laid on one another by their features first")
      ->check(CLI::IsMember({"given", "nn", "gnn", "jcbb"}))
      ->capture_default_str();
  command
      .add_option("--gate", arguments->gate,
                  "With --associate: probability with which a right match is within the gate")
      ->type_name("P")
      ->capture_default_str();
  command
      .add_option("--odds", arguments->odds,
                  "With --associate: how many times as likely as any other choice a match must be; "
                  "0: the matcher decides alone")
      ->check(CLI::NonNegativeNumber)
      ->type_name("N")
      ->capture_default_str();
  command.add_flag(
      "--check-matches", arguments->check_matches,
      "With given numbers: test in every join whether each feature that is joined agrees "
      "with the others. With --associate this is always done");
  command.add_flag("--judge", arguments->judge,
                   "With --associate: print precision and recall by the numbers in the files");
  add_join_arguments(command, arguments->join);
  add_examples(command, std::string(kModes) + "\n" + kExamples);
  command.callback([arguments] { join(*arguments); });
}

}  // namespace mapjoin::cli
