// Data sets for tests. They are not part of the repository, so a test must do without them: it says
//
//     const auto file = mapjoin::test::data_file("pose_graphs/intel.g2o");
//     if (!file) GTEST_SKIP() << mapjoin::test::missing_data("pose_graphs/intel.g2o");
#pragma once

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>

#include "tests/support/config.h"

namespace mapjoin::test {

/// The directory of the data sets; it may not exist.
inline std::filesystem::path data_directory() {
  const char* chosen = std::getenv("MAPJOIN_DATA");
  return chosen != nullptr ? chosen : kDefaultDataDirectory;
}

/// A file (or directory) below data_directory(), or nothing where it is absent.
inline std::optional<std::filesystem::path> data_file(const std::string& name) {
  std::filesystem::path path = data_directory() / name;
  if (!std::filesystem::exists(path)) return std::nullopt;
  return path;
}

/// What to say when a test is skipped for want of a file.
inline std::string missing_data(const std::string& name) {
  return "no " + name + " in " + data_directory().string() + " (set MAPJOIN_DATA)";
}

}  // namespace mapjoin::test
