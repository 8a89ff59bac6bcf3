#pragma once

#include <filesystem>

#include "mapjoin/graph/map.h"

namespace mapjoin::cli {

/// What is known of a map's variables. A .g2o or .map file: in any frame, and it has to hold what
/// the map's anchor pins. A .csv file of features (a header; then id, x, y and in 3D z a line): in
/// the frame of the map's anchor, which is added when it is a pose. \throws InputError with file
/// and line.
template <int D>
Values<D> read_truth(const std::filesystem::path& path, const Map<D>& map);

}  // namespace mapjoin::cli
