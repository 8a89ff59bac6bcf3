#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "mapjoin/io/local_maps.h"

namespace mapjoin::cli {

/// The localmap_K.map of a folder, in order of K, where there are any.
std::vector<std::string> native_maps_in(const std::filesystem::path& folder);

/// The local maps of a folder in their order: localmap_K.txt or .mat; where it has none,
/// localmap_K.map, each as one observation of all its variables in the frame it was solved in.
/// \throws FileError, InputError.
AnyLocalMapSet read_sequence(const std::filesystem::path& folder, const LocalMapOptions& options);

}  // namespace mapjoin::cli
