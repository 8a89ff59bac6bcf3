#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "mapjoin/cli/arguments.h"
#include "mapjoin/cli/output.h"
#include "mapjoin/cli/report.h"

namespace mapjoin::cli {

/// What reading the input left to do, the same for graphs, local maps and finished maps.
struct Job {
  const JoinArguments& arguments;
  double read_seconds = 0.0;
  std::int64_t measurements = 0;
  std::optional<Key> fixed;  ///< a pose that the input fixes: the frame, unless --anchor is given
  bool feature_offset = false;  ///< write features with ids 100000 and more higher
  std::vector<std::string> notes;
  std::optional<AssociationSummary> association{};
};

/// Solves, writes all pieces and the figures, and prints the report.
///
/// `variables` are those of the result, for telling early that an anchor is not among them.
template <int D>
void run(Job job, const VariableSet<D>& variables,
         const std::function<JoinResult<D>(const JoinOptions&)>& solve);

/// Is what the user asked for possible? Before anything takes long. \throws InputError, FileError.
void expect_outputs(const JoinArguments& arguments);

/// Writes one piece in the format that the path asks for.
template <int D>
void write_piece(OutputFiles& files, const std::filesystem::path& path, const Map<D>& map,
                 bool feature_offset, bool quaternion_information);

}  // namespace mapjoin::cli
