#include "mapjoin/evaluation/evaluate.h"

#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "mapjoin/cli/arguments.h"
#include "mapjoin/cli/commands.h"
#include "mapjoin/cli/input.h"
#include "mapjoin/cli/output.h"
#include "mapjoin/cli/truth.h"
#include "mapjoin/evaluation/consistency.h"
#include "mapjoin/io/local_maps.h"
#include "mapjoin/io/native_map.h"

namespace mapjoin::cli {

namespace {

constexpr const char* kEvaluateExamples = R"(Examples:
  mapjoin evaluate map.g2o --graph graph.g2o
      chi2: the sum of squared residuals, weighted by the measurements' information.
  mapjoin evaluate park.g2o --maps victoria_park_200 --reference park_optimum.g2o
      Also how far it is from a reference, in metres per coordinate: poses and features with both
      maps in the frame of their lowest common pose, consecutive poses relative to each other, and
      features after the best rigid fit.
  mapjoin evaluate run.map --truth beacons_true.csv
      Consistency: NEES, the error against the truth weighted by the map's own information, how many
      dimensions it has, and where a consistent map's NEES lies with 95% probability: between lower
      and upper, and below bound.
  mapjoin evaluate out.g2o out.2.g2o --graph graph.g2o
      A graph in two pieces that nothing links.
)";

struct EvaluateCommand {
  std::vector<std::string> results;
  std::string graph;
  std::string maps;
  std::string reference;
  std::string truth;
  double confidence = 0.95;
  std::string json;
  std::string indefinite = "refuse";
  std::uint32_t session = 0;
  bool skip_unknown = false;
  bool quaternion_information = false;
};

/// What an estimate is held against.
struct Measurements {
  std::variant<MeasurementGraph<2>, MeasurementGraph<3>> graph;
  std::int64_t count = 0;
};

Measurements read_measurements(const EvaluateCommand& a) {
  if (!a.graph.empty()) {
    G2oOptions options;
    options.session = a.session;
    options.skip_unknown = a.skip_unknown;
    options.quaternion_information = a.quaternion_information;
    options.indefinite = information_policy(a.indefinite);
    G2oGraph file = read_g2o(a.graph, options);
    const auto count = std::visit([](const auto& graph) { return graph.size(); }, file.graph);
    return {std::move(file.graph), static_cast<std::int64_t>(count)};
  }
  LocalMapOptions options;
  options.session = a.session;
  options.indefinite = information_policy(a.indefinite);
  return std::visit(
      []<int D>(const LocalMapSet<D>& set) -> Measurements {
        MeasurementGraphBuilder<D> builder;
        for (const LocalMap<D>& map : set.maps) builder.add(map);
        return {std::move(builder).build(), static_cast<std::int64_t>(set.maps.size())};
      },
      read_local_maps(a.maps, options));
}

/// The values of all result files together.
template <int D>
Values<D> read_results(const EvaluateCommand& a, const std::optional<VariableSet<D>>& known) {
  ValuesBuilder<D> all;
  for (const std::string& path : a.results) {
    const AnyValues any =
        known ? read_solution(path, a.session, *known) : read_solution(path, a.session);
    const auto* values = std::get_if<Values<D>>(&any);
    if (values == nullptr) {
      throw InputError(fmt::format("{} is {}D but the others are {}D", path, 5 - D, D));
    }
    for (int i = 0; i < values->size(); ++i) {
      all.add(values->variables().kind(i), values->variables().key(i), values->value(i));
    }
  }
  return std::move(all).build();
}

/// One line as the data sets' own tool prints it, and the same figures as JSON.
struct Figures {
  std::string line;
  nlohmann::ordered_json json = nlohmann::ordered_json::object();

  void add(const char* name, double value) {
    line += fmt::format("{}{} {:.6f}", line.empty() ? "" : " ", name, value);
    json[name] = value;
  }
  void add(const char* name, std::size_t value) {
    line += fmt::format("{}{} {}", line.empty() ? "" : " ", name, value);
    json[name] = value;
  }
};

template <int D>
void add_deviation(const EvaluateCommand& a, const Values<D>& estimate, Figures& figures) {
  const AnyValues any = read_solution(a.reference, a.session, estimate.variables());
  const Deviation d = deviation(estimate, std::get<Values<D>>(any));
  figures.add("common_poses", d.poses);
  figures.add("common_features", d.features);
  if (d.poses > 1) figures.add("pose_rmse", d.pose_rmse);
  if (d.poses > 0 && d.features > 0) figures.add("feature_rmse", d.feature_rmse);
  if (d.poses > 1) figures.add("relative_rmse", d.relative_rmse);
  if (d.features > 0) figures.add("aligned_feature_rmse", d.aligned_feature_rmse);
}

void add_consistency(const EvaluateCommand& a, Figures& figures) {
  std::visit(
      [&]<int D>(const Map<D>& map) {
        const Consistency c = consistency(map, read_truth(a.truth, map), a.confidence);
        figures.add("nees", c.nees);
        figures.add("dimension", static_cast<std::size_t>(c.dimension));
        figures.add("lower", c.lower);
        figures.add("upper", c.upper);
        figures.add("bound", c.one_sided);
      },
      read_any_map(a.results[0]));
}

void finish(const EvaluateCommand& a, const Figures& figures) {
  if (!a.json.empty()) {
    OutputFiles files;
    files.write_text(a.json, figures.json.dump(2) + "\n");
    files.commit();
  }
  fmt::print("{}\n", figures.line);
}

void evaluate(const EvaluateCommand& a) {
  if (a.graph.empty() && a.maps.empty() && a.reference.empty() && a.truth.empty()) {
    throw InputError("evaluate against what? Give --graph, --maps, --reference or --truth");
  }
  if (a.results.size() > 1 && !(a.reference.empty() && a.truth.empty())) {
    throw InputError("--reference and --truth judge one piece: give its file alone");
  }
  if (!a.json.empty()) OutputFiles::expect(a.json);
  Figures figures;
  if (!a.truth.empty()) {
    add_consistency(a, figures);
    if (a.graph.empty() && a.maps.empty() && a.reference.empty()) return finish(a, figures);
  }
  if (a.graph.empty() && a.maps.empty()) {
    std::visit([&]<int D>(const Values<D>& estimate) { add_deviation(a, estimate, figures); },
               read_solution(a.results[0], a.session));
    return finish(a, figures);
  }
  const Measurements measurements = read_measurements(a);
  std::visit(
      [&]<int D>(const MeasurementGraph<D>& graph) {
        const Values<D> estimate = read_results<D>(a, graph.variables);
        figures.add("chi2", chi2(estimate, graph));
        figures.add("measurements", static_cast<std::size_t>(measurements.count));
        if (!a.reference.empty()) add_deviation(a, estimate, figures);
      },
      measurements.graph);
  finish(a, figures);
}

}  // namespace

void add_evaluate(Command& app) {
  auto arguments = std::make_shared<EvaluateCommand>();
  EvaluateCommand& a = *arguments;
  Command command = app.add_command("evaluate", "Judge a result by measurements or a reference");
  command
      .add_option("result", a.results,
                  "What solve or join wrote (.g2o or .map); several pieces "
                  "of one graph may be given")
      .type_name("RESULT")
      .required();
  const Option graph =
      command.add_option("--graph", a.graph, "The measurements").type_name("GRAPH.g2o");
  command.add_option("--maps", a.maps, "The local maps, a folder of localmap_K.txt")
      .type_name("FOLDER")
      .excludes(graph);
  command.add_option("--reference", a.reference, "A solution to compare with, .g2o or .map")
      .type_name("FILE");
  command
      .add_option("--truth", a.truth,
                  "What is known to be true, .g2o, .map, or a .csv of features (id,x,y) in the "
                  "frame of the map's anchor; the result must be a .map")
      .type_name("FILE");
  command.add_option("--confidence", a.confidence, "The probability of the bounds of NEES")
      .within(0.0, 1.0)
      .show_default();
  command.add_option("--json", a.json, "Write the figures to this file as well").type_name("FILE");
  command.add_option("--session", a.session, "Session of ids that are written without one")
      .type_name("N");
  add_indefinite_argument(command, a.indefinite);
  command.add_flag("--skip-unknown", a.skip_unknown,
                   "Pass over g2o records that are not understood");
  command.add_flag("--quaternion-information", a.quaternion_information,
                   "3D information is of the quaternion's vector part");
  command.examples(kEvaluateExamples);
  command.run([arguments] { evaluate(*arguments); });
}

}  // namespace mapjoin::cli
