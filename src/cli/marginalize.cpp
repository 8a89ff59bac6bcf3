#include "mapjoin/solvers/marginalize.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "mapjoin/cli/commands.h"
#include "mapjoin/cli/run.h"
#include "mapjoin/frames/anchors.h"
#include "mapjoin/io/native_map.h"

namespace mapjoin::cli {

namespace {

constexpr const char* kMarginalizeExamples = R"(Examples:
  mapjoin marginalize park.map --keep poses --output trajectory.map
      A pose-only map: what the features said of the poses stays, the features go.
  mapjoin marginalize park.map --keep last-pose --output filter.map
      The last pose and all features: the map as a Kalman filter would have it.
  mapjoin marginalize park.map --keep pose:0,point:3,point:17 --output part.map
      Any other variables.
)";

struct MarginalizeCommand {
  std::string map;
  std::vector<std::string> keep;
  std::string anchor;
  std::string output;
};

template <int D>
std::vector<int> kept(const MarginalizeCommand& a, const VariableSet<D>& variables) {
  if (a.keep.size() == 1) {
    if (a.keep[0] == "poses") return poses_of(variables);
    if (a.keep[0] == "features") return features_of(variables);
    if (a.keep[0] == "last-pose") return last_pose_and_features(variables);
  }
  std::vector<int> out;
  for (const Key& key : parse_keys(a.keep, variables)) out.push_back(*variables.find(key));
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

void marginalize_map(const MarginalizeCommand& a) {
  output_format(a.output);
  OutputFiles::expect(a.output);
  std::visit(
      [&]<int D>(Map<D>&& map) {
        const std::vector<int> keep = kept(a, map.variables());
        Anchor<D> anchor;
        if (!a.anchor.empty())
          anchor = chosen_anchor<D>(a.anchor, session_of(map.variables()), map.variables());
        const Map<D> part = marginalize(map, std::span<const int>(keep), anchor);
        OutputFiles files;
        write_piece(files, a.output, part, false, false);
        files.commit();
        fmt::print("{}: {} of {} variables kept, {} blocks of information, frame: {}\n", a.output,
                   part.values.size(), map.values.size(), part.information.blocks(),
                   to_string(part.anchor));
      },
      read_any_map(a.map));
}

}  // namespace

void add_marginalize(Command& app) {
  auto arguments = std::make_shared<MarginalizeCommand>();
  Command command = app.add_command(
      "marginalize", "Eliminate poses or features from a map, and keep what they said");
  command.add_option("map", arguments->map, "A native map with information")
      .type_name("MAP")
      .required();
  command
      .add_option("--keep", arguments->keep,
                  "features, poses, last-pose (with all features), or a list of keys")
      .type_name("WHAT")
      .separated_by(',')
      .required();
  command
      .add_option("--anchor", arguments->anchor,
                  "The frame of the result when what fixes the map's own goes [the lowest pose, "
                  "points that are far apart where no pose is kept]")
      .type_name("ANCHOR");
  command
      .add_option("-o,--output", arguments->output, "OUT.map, or OUT.g2o, OUT.tum for the values")
      .type_name("FILE")
      .required();
  command.examples(kMarginalizeExamples);
  command.run([arguments] { marginalize_map(*arguments); });
}

}  // namespace mapjoin::cli
