#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <utility>

#include "mapjoin/cli/arguments.h"
#include "mapjoin/cli/commands.h"
#include "mapjoin/cli/compare_table.h"
#include "mapjoin/cli/contest.h"
#include "mapjoin/cli/input.h"
#include "mapjoin/cli/join_command.h"
#include "mapjoin/cli/output.h"
#include "mapjoin/cli/progress.h"
#include "mapjoin/cli/raw.h"
#include "mapjoin/cli/sequence.h"
#include "mapjoin/cli/truth.h"
#include "mapjoin/cli/watch.h"
#include "mapjoin/evaluation/consistency.h"
#include "mapjoin/evaluation/evaluate.h"
#include "mapjoin/filtering/methods.h"
#include "mapjoin/frames/local_map.h"
#include "mapjoin/io/local_maps.h"
#include "mapjoin/io/native_map.h"

namespace mapjoin::cli {

namespace {

constexpr const char* kCompareExamples = R"(Methods:
  linear:paper, linear:summary, linear:observe, linear:optimal
            Linear SLAM, by divide and conquer; 'linear' is the last. See 'mapjoin join --help'
  slsjf     Sparse Local Submap Joining Filter; islsjf: smoothed at the end (I-SLSJF);
            slsjf:amd ordered by minimum degree alone, slsjf:whole factorised whole at every map
            (these two only where they are named)
  dslam     D-SLAM map joining: features alone; idslam: iterated (I-DMJ)
  ekf       map joining by a dense extended Kalman filter
  slsjf:anew:N   slsjf, linearising all local maps anew at every N (only where it is named)
  ekf-slam  of a recording: EKF SLAM over the whole run, without local maps
Of a recording, local maps are built first, as 'mapjoin build --keep end-pose' does.
Columns: chi2 over all local maps (of dslam and idslam over feature-only ones); RMSE of poses and of
features to the reference, in metres per coordinate, both maps in the frame of their lowest common
pose, and of features after the best rigid fit; NEES against the truth, and the bounds that a
consistent map's lies between with 95% probability, and the share of coordinates within two standard
deviations of the truth; seconds of initialising and adding, ordering,
factorising, recovering the estimate, refining, and in all; the memory it took.
Without --reference, methods are held against islsjf or linear:optimal, and dslam against idslam,
where those are among them.

Examples:
  mapjoin compare victoria_park_200
  mapjoin compare simu_8240_50 --methods slsjf,ekf,linear:optimal --truth beacons_true.csv
  mapjoin compare dlr_200 --methods all --reference dlr_200_optimum.g2o --json table.json
  mapjoin compare park.g2o --segment maps:200 --methods slsjf,ekf,ekf-slam --output park_maps
      From one recording; every method's map is written to park_maps/METHOD.map.
)";

struct CompareCommand {
  std::string source;  ///< local maps, or a recording
  std::string segment;
  std::string methods = "all";
  std::string associate = "given";
  std::string output;
  std::vector<std::string> watched;  ///< names of points
  std::string truth;
  std::string reference;
  std::string json;
  std::string indefinite = "refuse";
  bool skip_unknown = false;
  BuildArguments build;
  CsvLogOptions csv;  ///< its session is that of local maps, too

  bool recording() const { return !segment.empty(); }
};

std::optional<AssociationOptions> association_of(const CompareCommand& a) {
  if (a.associate == "given") return std::nullopt;
  return association_options(a.associate);
}

bool features_alone(Method method) { return method == Method::kDslam || method == Method::kIdslam; }

/// What a row is held against: the given reference, else the row of the same problem's optimum.
template <int D>
const Values<D>* reference_of(const Row<D>& row, const std::vector<Row<D>>& rows,
                              const std::optional<Values<D>>& given) {
  if (given) return &*given;
  const auto is_optimum = [&](const Row<D>& other) {
    if (!other.failure.empty()) return false;
    if (features_alone(row.contestant.method)) return other.contestant.method == Method::kIdslam;
    return other.contestant.method == Method::kIslsjf ||
           (other.contestant.method == Method::kLinear && other.contestant.mode == Mode::kOptimal);
  };
  const auto found = std::find_if(rows.begin(), rows.end(), is_optimum);
  return found == rows.end() ? nullptr : &found->result.map.values;
}

/// The truth without what goes by another name in the map: of a feature that was not found again
/// the number is one that was free, and says nothing.
template <int D>
Values<D> known_by_name(const Values<D>& truth, const std::optional<MatchScore>& matches) {
  if (!matches) return truth;
  const std::set<Key> renamed(matches->renamed.begin(), matches->renamed.end());
  std::vector<int> kept;
  for (int i = 0; i < truth.size(); ++i) {
    if (renamed.count(truth.variables().key(i)) == 0) kept.push_back(i);
  }
  return subset(truth, kept);
}

template <int D>
void compare_methods(const CompareCommand& a, const Subject<D>& subject, OutputFolder* folder) {
  const Interruptible interruptible;
  std::optional<Values<D>> reference;
  std::vector<Row<D>> rows;
  for (const Contestant& contestant : contestants(a.methods, a.recording())) {
    rows.push_back(run_one<D>(contestant, subject, association_of(a)));
    Row<D>& row = rows.back();
    if (!row.failure.empty()) continue;
    if (!a.reference.empty() && !reference) {
      const AnyValues any = read_solution(a.reference, a.csv.session, row.result.map.variables());
      const auto* const values = std::get_if<Values<D>>(&any);
      if (values == nullptr)
        throw InputError(
            fmt::format("{} is {}D but the local maps are {}D", a.reference, 5 - D, D));
      reference = *values;
    }
    if (!a.truth.empty()) {
      const Values<D> truth = known_by_name(read_truth(a.truth, row.result.map), row.matches);
      row.consistency = consistency(row.result.map, truth);
      row.coverage = coverage(row.result.map, truth);
    }
    if (!a.watched.empty())
      row.watched = watch(contestant.method, contestant.whole_run, contestant.filter, subject,
                          std::span<const Key>(parse_keys(a.watched, row.result.map.variables())));
    if (folder != nullptr) {
      std::string file = contestant.label;
      std::replace(file.begin(), file.end(), ':', '_');
      write_map(folder->path() / (file + ".map"), row.result.map);
    }
  }
  for (Row<D>& row : rows) {
    const Values<D>* const held = reference_of(row, rows, reference);
    if (row.failure.empty() && held != nullptr)
      row.deviation = deviation(row.result.map.values, *held);
  }
  if (!a.json.empty()) {
    nlohmann::ordered_json all = nlohmann::ordered_json::array();
    for (const Row<D>& row : rows) all.push_back(json(row));
    OutputFiles files;
    files.write_text(a.json, all.dump(2) + "\n");
    files.commit();
  }
  fmt::print("{}", text(rows, !a.truth.empty(), a.associate != "given"));
}

template <int D>
Subject<D> build_subject(const CompareCommand& a, RawLog<D> log) {
  BuildOptions options = build_options(a.build, 1);
  options.keep = Keep::kEndPose;
  const BuiltMaps<D> built =
      build_local_maps(log, segment(log, parse_segment_rule(a.segment)), options);
  Subject<D> out;
  for (const Map<D>& map : built.maps) out.maps.push_back(as_local_map(map));
  fmt::print("local maps    {}, built in {:.3f} s of {} measurements, {} refused\n",
             out.maps.size(), built.seconds, built.used.size(), built.refused.size());
  out.log = std::move(log);
  return out;
}

void compare_recording(const CompareCommand& a, OutputFolder* folder) {
  parse_segment_rule(a.segment);
  G2oOptions options;
  options.session = a.csv.session;
  options.skip_unknown = a.skip_unknown;
  options.indefinite = information_policy(a.indefinite);
  RawInput input = read_raw(a.source, options, a.csv);
  for (const std::string& note : input.notes) fmt::print("note          {}\n", note);
  std::visit(
      [&]<int D>(RawLog<D>& log) { compare_methods(a, build_subject(a, std::move(log)), folder); },
      input.log);
}

void compare_local_maps(const CompareCommand& a, OutputFolder* folder) {
  if (input_format(a.source) != InputFormat::kLocalMaps)
    throw InputError(
        fmt::format("{} is no folder of local maps (localmap_1.txt, ...); a recording is cut into "
                    "local maps by --segment, as in --segment maps:200",
                    a.source));
  LocalMapOptions options;
  options.session = a.csv.session;
  options.indefinite = information_policy(a.indefinite);
  std::visit(
      [&]<int D>(LocalMapSet<D>&& set) {
        compare_methods(a, Subject<D>{std::move(set.maps), {}}, folder);
      },
      read_sequence(a.source, options));
}

void compare(const CompareCommand& a) {
  contestants(a.methods, a.recording());  // are there such methods? Before anything takes long.
  if (!a.json.empty()) OutputFiles::expect(a.json);
  for (const std::string& path : {a.truth, a.reference}) {
    if (!path.empty()) input_format(path);  // is it there?
  }
  std::optional<OutputFolder> folder;
  if (!a.output.empty()) folder.emplace(a.output);
  OutputFolder* const maps = folder ? &*folder : nullptr;
  a.recording() ? compare_recording(a, maps) : compare_local_maps(a, maps);
  if (folder) folder->commit();
}

}  // namespace

void add_compare(Command& app) {
  auto arguments = std::make_shared<CompareCommand>();
  CompareCommand& a = *arguments;
  Command command = app.add_command("compare", "Join local maps by several methods, side by side");
  command
      .add_option("source", a.source,
                  "A folder of localmap_K.txt, .mat or .map; or with --segment a recording: a g2o "
                  "graph, or a "
                  "folder of controls.csv and observations.csv")
      .type_name("FOLDER|RAW")
      .required();
  command
      .add_option("--segment", a.segment,
                  "Of a recording: when the next local map begins, as in maps:200; see 'mapjoin "
                  "build --help'")
      .type_name("RULE");
  add_build_arguments(command, a.build, "--local-anchor");
  for (const char* option : {"--builder", "--local-anchor", "--robust"})
    command.option(option).needs(command.option("--segment"));
  command.add_option("--methods", a.methods, "all, or names separated by commas; see below")
      .show_default();
  command
      .add_option(
          "--associate", a.associate,
          "Which features are the same: as they are numbered (given), or found as the local "
          "maps arrive, by nn, gnn or jcbb (slsjf and ekf); see 'mapjoin join --help'")
      .one_of({"given", "nn", "gnn", "jcbb"})
      .show_default();
  command
      .add_option(
          "--truth", a.truth,
          "What is known to be true: .g2o, .map, or a .csv of features (id,x,y) in the frame "
          "of the first local map")
      .type_name("FILE");
  command.add_option("--reference", a.reference, "A solution to measure RMSE to, .g2o or .map")
      .type_name("FILE");
  command
      .add_option("--json", a.json,
                  "Write the figures to this file as well, and more: seconds of every local map, "
                  "sizes and non-zeros of the information matrix")
      .type_name("FILE");
  command
      .add_option("--watch", a.watched,
                  "With --json: where these points are believed to be, and their standard "
                  "deviations, after every local map (slsjf, dslam, ekf) or pose (ekf-slam)")
      .type_name("point:ID,...")
      .separated_by(',')
      .needs(command.option("--json"));
  command
      .add_option("-o,--output", a.output,
                  "Write every method's map into this folder, which is new or empty")
      .type_name("FOLDER");
  add_log_arguments(command, a.csv);
  command.add_flag("--skip-unknown", a.skip_unknown,
                   "Count g2o records that are not understood instead of refusing the file");
  command.add_option("--session", a.csv.session, "Session of ids that are written without one")
      .type_name("N");
  add_indefinite_argument(command, a.indefinite);
  command.examples(kCompareExamples);
  command.run([arguments] { compare(*arguments); });
}

}  // namespace mapjoin::cli
