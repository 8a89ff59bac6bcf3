#include "benchmarks/problem.h"

#include <fmt/format.h>

#include <charconv>

#include "mapjoin/evaluation/simulate.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/io/g2o.h"
#include "mapjoin/io/local_maps.h"

namespace mapjoin::benchmarks {

namespace {

AnyProblem from_local_maps(const std::filesystem::path& folder) {
  return std::visit(
      [&]<int D>(LocalMapSet<D>&& set) -> AnyProblem {
        MeasurementGraphBuilder<D> builder;
        for (const LocalMap<D>& map : set.maps) builder.add(map);
        return Problem<D>{folder.filename().string(), std::move(set.maps),
                          std::move(builder).build()};
      },
      read_local_maps(folder));
}

template <int D>
AnyProblem from_simulation(const SimulationOptions& options) {
  Simulation<D> world = simulate<D>(options);
  return Problem<D>{fmt::format("{} {}", name(options.world), options.poses),
                    {},
                    std::move(world.graph),
                    std::move(world.truth)};
}

}  // namespace

AnyProblem read_problem(const std::filesystem::path& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) {
    return from_local_maps(path.has_filename() ? path : path.parent_path());
  }
  return std::visit(
      [&]<int D>(MeasurementGraph<D>&& graph) -> AnyProblem {
        return Problem<D>{path.stem().string(), {}, std::move(graph)};
      },
      read_g2o(path).graph);
}

AnyProblem simulate_problem(const std::string& text, std::uint64_t seed) {
  const std::size_t colon = text.find(':');
  std::int64_t poses = 0;
  const char* const end = text.data() + text.size();
  const char* const number = text.data() + std::min(text.size(), colon + 1);
  if (colon == std::string::npos || std::from_chars(number, end, poses).ptr != end || poses < 2) {
    throw InputError(fmt::format(
        "--simulate {}: expected WORLD:POSES with two poses or more, as in manhattan:100000",
        text));
  }
  SimulationOptions options = simulation_defaults(parse_world(text.substr(0, colon)));
  options.poses = poses;
  options.seed = seed;
  return dimension(options.world) == 2 ? from_simulation<2>(options) : from_simulation<3>(options);
}

}  // namespace mapjoin::benchmarks
