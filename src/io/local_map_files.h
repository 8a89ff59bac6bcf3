#pragma once

#include <cstdint>
#include <filesystem>
#include <string_view>
#include <vector>

namespace mapjoin::detail {

/// A localmap_K.txt, or localmap_K.map.
struct LocalMapFile {
  std::int64_t number = 0;  ///< K
  std::filesystem::path path;
};

/// The localmap_K.txt of a folder (or with another ending), in ascending order of K. \throws
/// FileError when the folder cannot be read.
std::vector<LocalMapFile> local_map_files(const std::filesystem::path& folder,
                                          std::string_view ending = ".txt");

}  // namespace mapjoin::detail
