#include "mapjoin/cli/raw.h"

#include <fmt/format.h>

#include "mapjoin/cli/input.h"
#include "mapjoin/io/g2o.h"

namespace mapjoin::cli {

void add_build_arguments(Command& command, BuildArguments& a, const std::string& anchor) {
  command
      .add_option("--builder", a.builder,
                  "nls: nonlinear least squares a local map; ekf: an extended Kalman filter")
      .one_of({"nls", "ekf"})
      .show_default();
  command
      .add_option(anchor, a.frame,
                  "What fixes the frame of a local map: its first pose, its last, or features that "
                  "are far apart")
      .one_of({"start", "end", "features"})
      .show_default();
  command
      .add_option(
          "--robust", a.loss,
          "Loss of measurements that do not fit: none, huber, cauchy or geman-mcclure, with "
          "a width in standard deviations, as in cauchy:3")
      .type_name("LOSS")
      .show_default();
  command.add_flag("--whole", a.whole,
                   "Build large local maps from the chain of their measurements, not in parts that "
                   "are joined: as the papers do, for comparison");
}

BuildOptions build_options(const BuildArguments& a, int threads) {
  BuildOptions out;
  if (a.builder == "ekf") out.builder = Builder::kFilter;
  if (a.frame == "end") out.frame = LocalFrame::kEnd;
  if (a.frame == "features") out.frame = LocalFrame::kFeatures;
  if (a.keep == "end-pose") out.keep = Keep::kEndPose;
  if (a.keep == "features") out.keep = Keep::kFeatures;
  out.loss = parse_robust_loss(a.loss);
  out.threads = threads;
  out.whole = a.whole;
  return out;
}

void add_log_arguments(Command& command, CsvLogOptions& options) {
  const auto sigma = [&](const std::string& name, double& target, const std::string& help) {
    command.add_option(name, target, help + " (logs)").show_default();
  };
  sigma("--duration", options.duration, "Of a control, s");
  sigma("--sigma-speed", options.sigma_speed, "Standard deviation of the speed, m/s");
  sigma("--sigma-sideways", options.sigma_sideways, "Of the speed sideways, which is 0, m/s");
  sigma("--sigma-turn-rate", options.sigma_turn_rate, "Of the turn rate, rad/s");
  sigma("--sigma-range", options.sigma_range, "Of a range, m");
  sigma("--sigma-bearing", options.sigma_bearing, "Of a bearing, rad");
  sigma("--nearest", options.nearest, "Leave out observations of a smaller range, m");
}

namespace {

RawInput read_log(const std::string& path, const CsvLogOptions& options) {
  CsvLog read = read_csv_log(path, options);
  RawInput out{std::move(read.log), {}, {}};
  if (read.too_near > 0) {
    out.notes.push_back(fmt::format("{} observations nearer than {} m were left out", read.too_near,
                                    options.nearest));
  }
  return out;
}

}  // namespace

RawInput read_raw(const std::string& path, const G2oOptions& g2o, const CsvLogOptions& csv) {
  switch (input_format(path)) {
    case InputFormat::kLocalMaps:
      if (is_csv_log(path)) return read_log(path, csv);
      throw InputError(fmt::format(
          "{} is a folder without controls.csv and observations.csv; local maps are joined by "
          "'mapjoin join'",
          path));
    case InputFormat::kNative:
      throw InputError(fmt::format("{} is a map; maps are joined by 'mapjoin join'", path));
    case InputFormat::kG2o:
      break;
  }
  const G2oGraph file = read_g2o(path, g2o);
  RawInput out{RawLog<2>(), file.fixed, notes_of(file.counts)};
  std::visit([&]<int D>(const MeasurementGraph<D>& graph) { out.log = raw_log(graph); },
             file.graph);
  return out;
}

}  // namespace mapjoin::cli
