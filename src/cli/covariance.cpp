#include "mapjoin/solvers/covariance.h"

#include <fmt/format.h>

#include <cmath>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>

#include "mapjoin/cli/arguments.h"
#include "mapjoin/cli/commands.h"
#include "mapjoin/cli/output.h"
#include "mapjoin/evaluation/consistency.h"
#include "mapjoin/io/native_map.h"
#include "mapjoin/solvers/relative.h"

namespace mapjoin::cli {

namespace {

constexpr const char* kCovarianceExamples = R"(Examples:
  mapjoin covariance park.map --all --output uncertainty.csv
      A line a variable: its position, the semi-axes of the ellipse (ellipsoid) that holds it with
      95% probability, and the lower triangle of its covariance by rows.
  mapjoin covariance park.map --keys pose:3,point:12 --json joint.json
      Two variables and what they have in common: the joint covariance, in the order given.
Covariance is relative to the frame of the map ('mapjoin reframe' changes it). It is in the tangents
of the variables: for a pose metres and radians in its own body frame, for a point metres in the
frame of the map.
)";

struct CovarianceCommand {
  std::string map;
  std::vector<std::string> keys;
  bool all = false;
  double confidence = 0.95;
  std::string output;
  std::string json;
};

/// What is said of one variable.
template <int D>
struct Line {
  Key key;
  Eigen::MatrixXd covariance;
  bool placed = false;  ///< it has a position
  Vec<D> position;
  ConfidenceRegion<D> region;
};

template <int D>
Line<D> line_of(const Values<D>& values, int i, const Eigen::MatrixXd& block, double confidence) {
  Line<D> out;
  out.key = values.variables().key(i);
  out.covariance = block;
  const VariableKind<D>& kind = values.variables().kind(i);
  out.placed = kind.has_position;
  if (out.placed) {
    const int first = 0;
    kind.positions(values.value(i), &first, 1, out.position.data());
    out.region = confidence_region<D>(position_covariance(values, i, block), confidence);
  }
  return out;
}

template <int D>
std::string csv_header() {
  std::string out = D == 2 ? "key,x_m,y_m,semi_axis_1_m,semi_axis_2_m,axis_1_rad"
                           : "key,x_m,y_m,z_m,semi_axis_1_m,semi_axis_2_m,semi_axis_3_m";
  for (int r = 1; r <= kGauge<D>; ++r) {
    for (int c = 1; c <= r; ++c) out += fmt::format(",c_{}_{}", r, c);
  }
  return out + "\n";
}

template <int D>
void append_csv(std::string& out, const Line<D>& line) {
  const auto number = [](double x) { return fmt::format(",{:.17g}", x); };
  const auto rounded = [](double x) { return fmt::format(",{:.9g}", x); };
  const std::string nothing = ",";
  out += to_string(line.key);
  for (int k = 0; k < D; ++k) out += line.placed ? number(line.position(k)) : nothing;
  for (int k = 0; k < D; ++k) out += line.placed ? rounded(line.region.semi_axes(k)) : nothing;
  if constexpr (D == 2) {
    const auto& axes = line.region.axes;
    out += line.placed ? rounded(std::atan2(axes(1, 0), axes(0, 0))) : nothing;
  }
  const Eigen::Index dim = line.covariance.rows();
  for (int r = 0; r < std::max<Eigen::Index>(kGauge<D>, dim); ++r) {
    for (int c = 0; c <= r; ++c) out += r < dim ? number(line.covariance(r, c)) : nothing;
  }
  out += '\n';
}

nlohmann::ordered_json rows_of(const Eigen::MatrixXd& matrix) {
  nlohmann::ordered_json out = nlohmann::ordered_json::array();
  for (Eigen::Index r = 0; r < matrix.rows(); ++r) {
    out.push_back(nlohmann::ordered_json::array());
    for (Eigen::Index c = 0; c < matrix.cols(); ++c) out.back().push_back(matrix(r, c));
  }
  return out;
}

template <int D>
nlohmann::ordered_json json_of(const Line<D>& line) {
  nlohmann::ordered_json out;
  out["key"] = to_string(line.key);
  if (line.placed) {
    out["position"] = std::vector<double>(line.position.data(), line.position.data() + D);
    out["semi_axes"] =
        std::vector<double>(line.region.semi_axes.data(), line.region.semi_axes.data() + D);
    out["axes"] = rows_of(line.region.axes);
  }
  out["covariance"] = rows_of(line.covariance);
  return out;
}

template <int D>
void show(const Line<D>& line) {
  const Eigen::VectorXd deviations = line.covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  fmt::print("{}: deviations", to_string(line.key));
  for (const double d : deviations) fmt::print(" {:.6g}", d);
  if (line.placed) {
    fmt::print(", semi-axes");
    for (int k = 0; k < D; ++k) fmt::print(" {:.6g}", line.region.semi_axes(k));
    fmt::print(" m");
  }
  fmt::print("\n");
}

template <int D>
void report(const CovarianceCommand& a, const Map<D>& map) {
  const std::vector<Key> keys = parse_keys(a.keys, map.variables());
  const Covariance<D> covariance(map);
  std::vector<int> numbers;
  for (const Key& key : keys) numbers.push_back(*map.variables().find(key));
  const CovarianceBlocks blocks = a.all ? covariance.blocks() : covariance.blocks(numbers);

  nlohmann::ordered_json json;
  json["frame"] = to_string(map.anchor);
  json["confidence"] = a.confidence;
  json["variables"] = nlohmann::ordered_json::array();
  std::string csv = csv_header<D>();
  for (std::size_t k = 0; k < blocks.size(); ++k) {
    const Line<D> line = line_of(map.values, blocks.variables[k], blocks.block(k), a.confidence);
    if (!a.output.empty()) append_csv(csv, line);
    if (!a.json.empty()) json["variables"].push_back(json_of(line));
    if (!a.all) show(line);
  }
  if (!a.all && !a.json.empty()) json["joint"] = rows_of(covariance.of(keys));

  OutputFiles files;
  if (!a.output.empty()) files.write_text(a.output, csv);
  if (!a.json.empty()) files.write_text(a.json, json.dump(2) + "\n");
  files.commit();
  if (a.all)
    fmt::print("{}: {} variables in the frame of {}\n", a.output.empty() ? a.json : a.output,
               blocks.size(), to_string(map.anchor));
}

void covariance(const CovarianceCommand& a) {
  if (a.all == !a.keys.empty())
    throw InputError("covariance of what? Give --keys pose:3,point:12 or --all");
  if (a.all && a.output.empty() && a.json.empty())
    throw InputError("--all needs --output FILE.csv or --json FILE: there is a line a variable");
  for (const std::string& file : {a.output, a.json}) {
    if (!file.empty()) OutputFiles::expect(file);
  }
  std::visit([&]<int D>(const Map<D>& map) { report(a, map); }, read_any_map(a.map));
}

}  // namespace

void add_covariance(Command& app) {
  auto arguments = std::make_shared<CovarianceCommand>();
  CovarianceCommand& a = *arguments;
  Command command = app.add_command("covariance", "Say how uncertain a map's variables are");
  command.add_option("map", a.map, "A native map with information").type_name("MAP").required();
  const Option keys =
      command.add_option("--keys", a.keys, "These variables, and their joint covariance")
          .type_name("KEY,KEY,...")
          .separated_by(',');
  command.add_flag("--all", a.all, "Every variable").excludes(keys);
  command
      .add_option("--confidence", a.confidence,
                  "The probability with which an ellipse holds its position")
      .within(0.0, 1.0)
      .show_default();
  command.add_option("-o,--output", a.output, "A table, a line a variable").type_name("FILE.csv");
  command.add_option("--json", a.json, "The same as JSON; with --keys the joint covariance as well")
      .type_name("FILE");
  command.examples(kCovarianceExamples);
  command.run([arguments] { covariance(*arguments); });
}

}  // namespace mapjoin::cli
