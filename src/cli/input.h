#pragma once

#include <filesystem>
#include <string>
#include <variant>
#include <vector>

#include "mapjoin/graph/values.h"
#include "mapjoin/io/g2o.h"

namespace mapjoin::cli {

/// What an input is, from the looks of it.
enum class InputFormat { kLocalMaps, kNative, kG2o };

/// A folder, a native map, or else g2o text. \throws FileError when there is nothing there.
InputFormat input_format(const std::filesystem::path& path);

/// Sentences about what a g2o file held besides measurements.
std::vector<std::string> notes_of(const G2oCounts& counts);

/// "12 EDGE_SE2, 3 EDGE_SE2_XY".
std::string list_of(const std::map<std::string, std::int64_t>& counts);

using AnyValues = std::variant<Values<2>, Values<3>>;

/// The values of a solution: g2o vertices or a native map. Features that g2o ids number 100000 (or
/// the next power of ten) higher than `known` does get their numbers in `known` back.
AnyValues read_solution(const std::filesystem::path& path, std::uint32_t session);
AnyValues read_solution(const std::filesystem::path& path, std::uint32_t session,
                        const std::variant<VariableSet<2>, VariableSet<3>>& known);

}  // namespace mapjoin::cli
