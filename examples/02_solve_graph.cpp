// Solves a measurement graph in a g2o file: the optimum, without any initial guess.
//
//   02_solve_graph [GRAPH.g2o [OUT.g2o]]      without arguments: a simulated drive

#include <fmt/format.h>

#include <filesystem>

#include "mapjoin/evaluation/evaluate.h"
#include "mapjoin/evaluation/simulate.h"
#include "mapjoin/frames/anchors.h"
#include "mapjoin/io/g2o.h"
#include "mapjoin/joining/join_all.h"

using namespace mapjoin;

namespace {

void simulate_graph(const std::string& file) {
  SimulationOptions options = simulation_defaults(World::kManhattan);
  options.poses = 1000;
  write_g2o<2>(file, simulate<2>(options).graph);
}

void print(const JoinReport& report) {
  fmt::print("variables     {} poses, {} features\n", report.poses, report.features);
  fmt::print("measurements  {}\n", report.observations);
  fmt::print("components    {}\n", report.components);
  fmt::print("chi2          {:.6f} after the joins, {:.6f} after {} more linear solves\n",
             report.chi2_linear, report.chi2, report.refine_solves);
  fmt::print("seconds       {:.3f}\n", report.seconds);
  for (const std::string& note : report.notes) fmt::print("note          {}\n", note);
}

template <int D>
bool solve(const MeasurementGraph<D>& graph, const std::string& output) {
  JoinOptions options;
  options.threads = 2;  // the result has the same bits for any number
  const JoinResult<D> result = join_all(graph, options);
  print(result.report);

  // Poses that no measurements link are maps of their own; here we are content with the first.
  const Map<D>& map = result.maps[0];
  write_g2o(output, map.values);
  fmt::print("written       {} (frame of {})\n", output, to_string(map.anchor));

  // Is what was written what was found? Digits are not lost in files.
  const auto read = std::get<Values<D>>(read_g2o_values(output));
  const double again = chi2(read, *map.observations);
  fmt::print("chi2 of it    {:.6f}\n", again);
  const bool same = result.maps.size() > 1 || std::abs(again - result.report.chi2) <= 1e-9 * again;
  return same && result.report.minimum;
}

}  // namespace

int main(int argc, char** argv) try {
  const auto temporary = std::filesystem::temp_directory_path() / "mapjoin_02_solve_graph";
  const std::string input = argc > 1 ? argv[1] : temporary.string() + ".g2o";
  const std::string output = argc > 2 ? argv[2] : temporary.string() + "_map.g2o";
  if (argc < 2) simulate_graph(input);

  const G2oGraph file = read_g2o(input);  // of the plane or of space: the file says
  const bool good = std::visit([&](const auto& graph) { return solve(graph, output); }, file.graph);
  return good ? 0 : 1;
} catch (const Error& error) {  // names file, line and remedy
  fmt::print(stderr, "{}\n", error.what());
  return 2;
}
