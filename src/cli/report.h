#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "mapjoin/association/associated_join.h"
#include "mapjoin/cli/arguments.h"
#include "mapjoin/joining/options.h"

namespace mapjoin::cli {

/// The wall-clock seconds of a run's parts: file to memory, memory to result, result to file.
struct Seconds {
  double read = 0.0;
  double solve = 0.0;
  double write = 0.0;
  double solve_processor =
      0.0;  ///< of all threads, while solving: what a busy machine does not change
};

/// What data association found.
struct AssociationSummary {
  std::string matcher;  ///< as --associate has it; "given": names were tested, not found
  AssociationReport report;
  std::optional<AssociationScore> score;  ///< by the names in the files
};

/// What `solve` and `join` say at the end.
struct RunReport {
  const JoinArguments& arguments;
  JoinReport join;
  std::int64_t measurements = 0;
  std::vector<std::string> frames;  ///< of each piece
  std::vector<std::filesystem::path> written;
  std::vector<std::string> notes;
  Seconds seconds;
  std::optional<AssociationSummary> association{};
};

/// The report in words, for people.
std::string text(const RunReport& report);
/// The same figures for programs: the content of --json.
std::string json(const RunReport& report);

}  // namespace mapjoin::cli
