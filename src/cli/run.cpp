#include "mapjoin/cli/run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <ctime>

#include "mapjoin/cli/progress.h"
#include "mapjoin/cli/report.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/graph/world.h"
#include "mapjoin/io/g2o.h"
#include "mapjoin/io/native_map.h"
#include "mapjoin/io/tum.h"
#include "mapjoin/joining/checkpoint.h"
#include "mapjoin/solvers/expect_determined.h"

namespace mapjoin::cli {

namespace {

/// The anchor that the user or the file asks for, if any.
template <int D>
std::optional<Anchor<D>> wanted_anchor(Job& job, const VariableSet<D>& variables) {
  const JoinArguments& a = job.arguments;
  if (!a.anchor.empty()) return chosen_anchor<D>(a.anchor, a.session, variables);
  if (!job.fixed) return std::nullopt;
  if (variables.find(*job.fixed)) return pose_anchor<D>(*job.fixed);
  job.notes.push_back(fmt::format("the file fixes {}, of which no measurement speaks: ignored",
                                  to_string(*job.fixed)));
  return std::nullopt;
}

/// Writes the piece that holds all of the anchor's variables in its frame.
template <int D>
void into_frame(std::vector<Map<D>>& pieces, const Anchor<D>& anchor) {
  for (Map<D>& map : pieces) {
    const bool holds = std::all_of(anchor.keys.begin(), anchor.keys.end(), [&](const Key& key) {
      return map.variables().find(key).has_value();
    });
    if (!holds) continue;
    expect_determined(map, anchor);
    map = change_frame(std::move(map), anchor);
    return;
  }
  if (anchor.keys[0] == world_key()) {
    throw InputError(
        "--anchor world: the measurements from the world do not say where anything lies in it; two "
        "positions in the plane do, three that are not on one line in space, or a pose");
  }
  throw InputError(fmt::format(
      "--anchor {}: its points are in different pieces, which nothing links; name points "
      "of one piece",
      to_string(anchor)));
}

/// What a reader of the file should know of its frame: g2o has a word for poses only.
template <int D>
std::string frame_comment(const Anchor<D>& anchor) {
  std::string out = fmt::format("mapjoin: in the frame of {}", to_string(anchor));
  if (anchor.kind == nullptr || is_pose_anchor(anchor)) return out;
  out += fmt::format("\nmapjoin: {} is the origin, {} on the positive x axis",
                     to_string(anchor.keys[0]), to_string(anchor.keys[1]));
  if (D == 3)
    out += fmt::format(", {} in the x-y plane at positive y", to_string(anchor.keys.back()));
  return out;
}

template <int D>
JoinResult<D> solve_interruptibly(const JoinArguments& arguments, bool information,
                                  const std::function<JoinResult<D>(const JoinOptions&)>& solve) {
  Interruptible::check();
  ProgressBar bar;
  JoinOptions options = join_options(arguments);
  options.information = information;
  options.progress = bar.callback();
  return solve(options);
}

}  // namespace

void expect_outputs(const JoinArguments& arguments) {
  output_format(arguments.output);
  OutputFiles::expect(arguments.output);
  if (!arguments.json.empty()) OutputFiles::expect(arguments.json);
}

template <int D>
void write_piece(OutputFiles& files, const std::filesystem::path& path, const Map<D>& map,
                 bool feature_offset, bool quaternion_information) {
  files.write(path, [&](const std::filesystem::path& at) {
    switch (output_format(path)) {
      case OutputFormat::kG2o: {
        G2oWriteOptions options;
        options.feature_offset = feature_offset;
        options.quaternion_information = quaternion_information;
        options.comment = frame_comment(map.anchor);
        write_g2o(at, map.values, options);
        break;
      }
      case OutputFormat::kNative:
        write_map(at, map);
        break;
      case OutputFormat::kTum:
        write_tum(at, map.values);
        break;
    }
  });
}

template <int D>
void run(Job job, const VariableSet<D>& variables,
         const std::function<JoinResult<D>(const JoinOptions&)>& solve) {
  const std::optional<Anchor<D>> anchor = wanted_anchor(job, variables);
  RunReport report{job.arguments, {}, job.measurements, {}, {}, {}, {}};
  report.seconds.read = job.read_seconds;

  const Interruptible interruptible;
  const Stopwatch solving;
  const std::clock_t before = std::clock();
  // Written to native maps; to change a frame one has to know how well it is determined.
  const bool information = anchor || output_format(job.arguments.output) == OutputFormat::kNative;
  JoinResult<D> result = solve_interruptibly<D>(job.arguments, information, solve);
  if (anchor) into_frame(result.maps, *anchor);
  for (const Map<D>& map : result.maps) report.frames.push_back(to_string(map.anchor));
  report.seconds.solve = solving.seconds();
  report.seconds.solve_processor = static_cast<double>(std::clock() - before) / CLOCKS_PER_SEC;
  report.join = std::move(result.report);
  report.notes = std::move(job.notes);
  report.association = std::move(job.association);

  OutputFiles files;
  const Stopwatch writing;
  for (std::size_t k = 0; k < result.maps.size(); ++k) {
    report.written.push_back(piece_path(job.arguments.output, k));
    write_piece(files, report.written.back(), result.maps[k], job.feature_offset,
                job.arguments.quaternion_information);
  }
  report.seconds.write = writing.seconds();
  if (!job.arguments.json.empty()) files.write_text(job.arguments.json, json(report));
  Interruptible::check();
  files.commit();
  if (!job.arguments.checkpoint.empty()) remove_checkpoint(job.arguments.checkpoint);
  fmt::print("{}", text(report));
}

#define MAPJOIN_INSTANTIATE(D)                                                                  \
  template void run<D>(Job, const VariableSet<D>&,                                              \
                       const std::function<JoinResult<D>(const JoinOptions&)>&);                \
  template void write_piece<D>(OutputFiles&, const std::filesystem::path&, const Map<D>&, bool, \
                               bool);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin::cli
