#pragma once

#include <cstdint>
#include <filesystem>

#include "mapjoin/graph/values.h"

/// \file
/// Trajectories as TUM text, which tools for comparing trajectories read: `timestamp tx ty tz qx qy
/// qz qw` a line. The timestamp is the pose's id. Trajectories of the plane lie in z = 0. Features
/// are not written.

namespace mapjoin {

/// Writes the poses in ascending order of id, numbers with as many digits as reading them back
/// exactly takes. Poses of several sessions get timestamps session * 10^k + id, and a comment line
/// says so. The file appears complete or not at all. \throws InputError when there is no pose;
/// FileError.
template <int D>
void write_tum(const std::filesystem::path& file, const Values<D>& values);

/// Reads poses; timestamps have to be whole numbers from 0. With D = 2, poses have to lie in the
/// plane (1e-6 m and rad). \throws InputError with file and line for everything else; FileError.
template <int D>
Values<D> read_tum(const std::filesystem::path& file, std::uint32_t session = 0);

}  // namespace mapjoin
