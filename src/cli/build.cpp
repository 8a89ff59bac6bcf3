#include "mapjoin/building/build.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "mapjoin/cli/commands.h"
#include "mapjoin/cli/input.h"
#include "mapjoin/cli/output.h"
#include "mapjoin/cli/progress.h"
#include "mapjoin/cli/raw.h"
#include "mapjoin/frames/local_map.h"
#include "mapjoin/io/local_maps.h"
#include "mapjoin/io/native_map.h"

namespace mapjoin::cli {

namespace {

namespace fs = std::filesystem;

constexpr const char* kBuildExamples = R"(Examples:
  mapjoin build park.g2o --segment poses:50 --output park_maps
  mapjoin join park_maps --mode summary --output park.g2o
      Local maps of 50 poses each, joined as they are: the measurements are not needed any more.
  mapjoin build simu_8240 --segment uncertainty:0.2 --builder ekf --keep end-pose --output maps
      From controls.csv and observations.csv, by a filter that forgets its past poses.
  mapjoin build park.g2o --segment features:30 --keep features --output feature_maps
      D-SLAM: maps of features alone, each sharing enough of them with those before it.

FOLDER gets localmap_1.map, localmap_2.map, ..., and localmap_1.txt, ... where that format can say
what is in the maps and none has more than 1000 numbers.
)";

constexpr int kLargestText = 1000;  // scalars: the text format writes their square

struct BuildCommand {
  std::string raw;
  std::string segment;
  std::string output;
  int threads = 1;
  std::string indefinite = "refuse";
  bool skip_unknown = false;
  BuildArguments build;
  CsvLogOptions csv;
};

/// The maps as localmap_K.txt. \returns why not, where the format cannot say them.
template <int D>
std::string write_text(const fs::path& folder, const std::vector<Map<D>>& maps) {
  LocalMapSet<D> set;
  for (const Map<D>& map : maps) {
    if (map.variables().scalars() > kLargestText) {
      return fmt::format("one of them has {} numbers", map.variables().scalars());
    }
    set.pose_feature = set.pose_feature || map.variables().find_column(Tag("point")) >= 0;
    set.maps.push_back(as_local_map(map));
  }
  try {
    write_local_maps(folder, set);
  } catch (const InputError& error) {
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (entry.path().extension() == ".txt") fs::remove(entry.path());
    }
    return error.what();
  }
  return {};
}

template <int D>
void build(const BuildCommand& a, const RawLog<D>& log, OutputFolder& folder) {
  const SegmentRule rule = parse_segment_rule(a.segment);
  const BuildOptions options = build_options(a.build, a.threads);
  const Stopwatch segmenting;
  const Segmentation segments = segment(log, rule, options.keep == Keep::kFeatures ? D : 0);
  const double segmented = segmenting.seconds();
  const BuiltMaps<D> built = build_local_maps(log, segments, options);
  if (built.maps.empty())
    throw InputError("no local map could be built: no feature can be placed by its measurements");
  const Stopwatch writing;
  for (std::size_t k = 0; k < built.maps.size(); ++k)
    write_map(folder.path() / fmt::format("localmap_{}.map", k + 1), built.maps[k]);
  const std::string why_not = write_text(folder.path(), built.maps);
  folder.commit();

  std::size_t largest = 0;
  for (const Map<D>& map : built.maps)
    largest = std::max(largest, static_cast<std::size_t>(map.values.size()));
  fmt::print("local maps    {}, the largest of {} variables\n", built.maps.size(), largest);
  fmt::print("measurements  {} used, {} refused\n", built.used.size(), built.refused.size());
  fmt::print("chi2          {:.6f} (sum over the local maps)\n", built.chi2);
  fmt::print("seconds       {:.3f} segment, {:.3f} build, {:.3f} write\n", segmented, built.seconds,
             writing.seconds());
  fmt::print("written       {}\n", a.output);
  if (!built.refused.empty()) {
    fmt::print(
        "note          refused measurements leave the place of their feature open: too few "
        "of them, or too alike\n");
  }
  if (!why_not.empty()) fmt::print("note          no localmap_K.txt: {}\n", why_not);
}

void run_build(const BuildCommand& a) {
  parse_segment_rule(a.segment);
  build_options(a.build, 1);
  OutputFolder folder(a.output);
  G2oOptions options;
  options.session = a.csv.session;
  options.skip_unknown = a.skip_unknown;
  options.indefinite = information_policy(a.indefinite);
  const RawInput input = read_raw(a.raw, options, a.csv);
  std::visit([&](const auto& log) { build(a, log, folder); }, input.log);
  for (const std::string& note : input.notes) fmt::print("note          {}\n", note);
}

}  // namespace

void add_build(Command& app) {
  auto arguments = std::make_shared<BuildCommand>();
  BuildCommand& a = *arguments;
  Command command = app.add_command("build", "Build local maps from raw measurements");
  command
      .add_option("raw", a.raw,
                  "Measurements: a g2o graph, or a folder of controls.csv and observations.csv")
      .type_name("RAW")
      .required();
  command
      .add_option("--segment", a.segment,
                  "When the next local map begins: poses:N, features:N, uncertainty:X (metres of "
                  "dead reckoning, one sigma), maps:N in all, or graph:N by graph partition")
      .type_name("RULE")
      .required();
  add_build_arguments(command, a.build, "--anchor");
  command
      .add_option("--keep", a.build.keep,
                  "What a local map keeps: all; end-pose, with the features and the poses that "
                  "other maps share; features alone")
      .one_of({"all", "end-pose", "features"})
      .show_default();
  command.add_option("-o,--output", a.output, "A folder that is new or empty")
      .type_name("FOLDER")
      .required();
  command.add_option("--threads", a.threads, "Local maps built at the same time")
      .within(1, 1024)
      .show_default();
  add_indefinite_argument(command, a.indefinite);
  command.add_flag("--skip-unknown", a.skip_unknown,
                   "Count g2o records that are not understood instead of refusing the file");
  command.add_option("--session", a.csv.session, "Session of ids without one").show_default();
  add_log_arguments(command, a.csv);
  command.examples(kBuildExamples);
  command.run([arguments] { run_build(*arguments); });
}

}  // namespace mapjoin::cli
