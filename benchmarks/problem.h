#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "mapjoin/graph/map.h"

namespace mapjoin::benchmarks {

/// Measurements in memory, as a solver is handed them: what is timed begins here.
template <int D>
struct Problem {
  std::string name;
  std::vector<LocalMap<D>> local_maps;  ///< where it is a set of them
  MeasurementGraph<D> graph;            ///< all measurements
  std::optional<Values<D>> truth = {};  ///< of a simulated world
};
using AnyProblem = std::variant<Problem<2>, Problem<3>>;

/// A g2o file or a folder of localmap_K.txt. \throws InputError, FileError.
AnyProblem read_problem(const std::filesystem::path& path);

/// "manhattan:100000": a world of mapjoin simulate, with its defaults, and the number of poses.
/// \throws InputError.
AnyProblem simulate_problem(const std::string& text, std::uint64_t seed);

}  // namespace mapjoin::benchmarks
