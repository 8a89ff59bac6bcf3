#include <fmt/format.h>

#include <algorithm>

#include "benchmarks/tables.h"
#include "mapjoin/evaluation/simulate.h"

namespace mapjoin::benchmarks {

std::string worlds_table(std::span<const std::string> sources, std::uint64_t seed) {
  std::vector<std::string> names;
  for (const std::string& source : sources) {
    const std::string world = source.substr(0, source.find(':'));
    if (std::find(names.begin(), names.end(), world) == names.end()) names.push_back(world);
  }
  if (names.empty()) return {};
  Rows rows;
  for (const std::string& world : names) {
    const SimulationOptions o = simulation_defaults(parse_world(world));
    const bool features = o.world == World::kLandmarks2d || o.world == World::kLandmarks3d;
    rows.push_back({world, fmt::format("{:g}", o.sigma_translation),
                    fmt::format("{:g}", o.sigma_rotation), fmt::format("{:g}", o.edges_per_pose),
                    features ? fmt::format("{:g}", o.sigma_feature) : "",
                    features ? fmt::format("{:g}", o.visible_features) : "",
                    features ? fmt::format("{:g}", o.sensor_range) : ""});
  }
  return fmt::format(
             "## Simulated worlds\n\nThose of `mapjoin simulate WORLD --poses N --seed {}`, with "
             "its "
             "defaults: normal, independent noise of\nthese standard deviations, which is also "
             "what the "
             "information says. Their optimum is the minimum that\nrefinement started from the "
             "truth "
             "ends in; joining does not know the truth.\n\n",
             seed) +
         table({"world", "a coordinate of a relative pose, m", "an axis of its rotation, rad",
                "relative poses a pose", "a coordinate of a feature, m",
                "features in range of a pose", "range, m"},
               rows);
}

}  // namespace mapjoin::benchmarks
