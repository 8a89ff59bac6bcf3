#pragma once

#include <cstdint>
#include <filesystem>
#include <variant>
#include <vector>

#include "mapjoin/graph/map.h"
#include "mapjoin/io/information_policy.h"

/// \file
/// Sets of local maps in the text format of the Linear SLAM authors: a folder of localmap_K.txt, K
/// = 1, 2, ...
///
///     line 1                 id of the reference pose, whose frame the map is written in
///     line 2                 n, the dimension of the state
///     n lines                id value
///     n lines of n numbers   the information matrix of the state
///
/// A variable is a run of lines with equal ids: 3 (2D) or 6 (3D) for a pose, 2 or 3 for a point. A
/// set with a negative id anywhere is *pose-feature*: negative ids are poses, positive ones
/// features, and the reference pose is written with either sign. A set without is *pose-only*;
/// there a longer run is the same pose several times: several measurements of it. Whether the set
/// is 2D or 3D is decided over all its maps. Metres and radians.
///
/// 2D poses are x, y, heading. 3D poses are a position and three angles (a, b, c), R = Rz(a) Ry(b)
/// Rx(c): yaw, pitch, roll. The information is of these numbers; on reading it is brought into the
/// tangent of the library's poses (euler_chart.h). That is where 3D poses with a pitch of +-90
/// degrees are refused: their angles say nothing about roll and yaw apart.
///
/// The same as MATLAB files: a folder of localmap_K.mat with `localmap_st`, n rows of id and value,
/// and `localmap_P`, the n x n covariance matrix of the values. Map K is written in the frame of
/// pose K - 1; id 0 is pose K, where it ends; positive ids are features. Only in builds with matio.

namespace mapjoin {

struct LocalMapOptions {
  /// Session of all ids.
  std::uint32_t session = 0;
  InformationPolicy indefinite = InformationPolicy::kRefuse;
};

/// A set of local maps, each anchored at its reference pose.
template <int D>
struct LocalMapSet {
  std::vector<LocalMap<D>> maps;  ///< in the order of K
  bool pose_feature = false;      ///< negative ids occur: the set tells poses from features
  int first_number = 1;           ///< K of maps[0]
  std::int64_t repaired = 0;      ///< information matrices changed by the policy
};

using AnyLocalMapSet = std::variant<LocalMapSet<2>, LocalMapSet<3>>;

/// Reads a folder of localmap_K.txt, or where it has none of localmap_K.mat. K must be without
/// gaps; it need not begin at 1. Other files are ignored.
///
/// \throws InputError with file and line: missing numbers K, runs that are no variable, a state and
/// matrix of different size, numbers that are not finite, a matrix that is not symmetric (1e-6
/// relative) or, by policy, not positive semidefinite; MATLAB files that hold something else, or a
/// build that cannot read them; FileError.
AnyLocalMapSet read_local_maps(const std::filesystem::path& folder,
                               const LocalMapOptions& options = {});

/// Writes localmap_K.txt, K = first_number, ..., into a folder, which is created where it does not
/// exist.
///
/// \throws InputError for what the format cannot say: anchors other than a pose, variables other
/// than poses and points, ids of several sessions, id 0 in the state of a pose-feature set,
/// features in a pose-only set; FileError.
template <int D>
void write_local_maps(const std::filesystem::path& folder, const LocalMapSet<D>& set);

}  // namespace mapjoin
