#pragma once

#include <cstdint>
#include <filesystem>
#include <string_view>
#include <vector>

namespace mapjoin::detail {

/// A localmap_K.txt, .mat or .map.
struct LocalMapFile {
  std::int64_t number = 0;  ///< K
  std::filesystem::path path;
};

/// The localmap_K.txt of a folder (or with another ending), in ascending order of K; where there is
/// no .txt, the localmap_K.mat. \throws FileError when the folder cannot be read.
std::vector<LocalMapFile> local_map_files(const std::filesystem::path& folder,
                                          std::string_view ending = ".txt");

}  // namespace mapjoin::detail
