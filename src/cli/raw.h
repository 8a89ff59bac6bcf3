#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "mapjoin/building/build.h"
#include "mapjoin/building/csv_log.h"
#include "mapjoin/cli/arguments.h"
#include "mapjoin/io/g2o.h"

namespace mapjoin::cli {

/// How local maps are built, as the user wrote it.
struct BuildArguments {
  std::string builder = "nls";
  std::string frame = "start";
  std::string keep = "all";
  std::string loss = "none";
  bool whole = false;
};

/// `--builder`, `--robust`, `--whole`, and the local maps' anchor under the given name.
void add_build_arguments(Command& command, BuildArguments& arguments, const std::string& anchor);
BuildOptions build_options(const BuildArguments& arguments, int threads);

/// What a folder of logs does not say: `--duration`, `--sigma-speed` and so on.
void add_log_arguments(Command& command, CsvLogOptions& options);

using AnyLog = std::variant<RawLog<2>, RawLog<3>>;

/// Raw measurements as read.
struct RawInput {
  AnyLog log;
  std::optional<Key> fixed;
  std::vector<std::string> notes;
};

/// A g2o graph, or a folder of controls.csv and observations.csv. \throws InputError, FileError.
RawInput read_raw(const std::string& path, const G2oOptions& g2o, const CsvLogOptions& csv);

}  // namespace mapjoin::cli
