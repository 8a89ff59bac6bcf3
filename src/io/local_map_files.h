#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace mapjoin::detail {

/// A localmap_K.txt or localmap_K.mat.
struct LocalMapFile {
  std::int64_t number = 0;  ///< K
  std::filesystem::path path;
};

/// The localmap_K.txt of a folder, in ascending order of K; where there is none, the
/// localmap_K.mat. \throws FileError when the folder cannot be read.
std::vector<LocalMapFile> local_map_files(const std::filesystem::path& folder);

}  // namespace mapjoin::detail
