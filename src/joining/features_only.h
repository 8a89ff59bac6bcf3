#pragma once

#include <span>
#include <vector>

#include "mapjoin/graph/map.h"

namespace mapjoin {

/// Local maps without their poses (D-SLAM; Linear SLAM section 7).
template <int D>
struct FeatureOnlyMaps {
  std::vector<Map<D>> maps;  ///< in order, each in the frame of points that are far apart
  /// maps[k] is made of the local maps first[k] .. first[k + 1] - 1, counted from 0.
  std::vector<int> first{0};

  /// How many local maps make maps[k]: more than one where they were joined first.
  int parts(std::size_t k) const { return first[k + 1] - first[k]; }
};

/// Marginalises the poses out of a sequence of local maps, so that it can be joined by its features
/// alone: join_all(std::span<const Map<D>>(result.maps), {}, options), in any mode.
///
/// Two feature-only maps are held together by common features: two in the plane, three in space
/// that are not on one line. So as section 8.3 has it, neighbours that share too few are joined
/// first, poses and all, with one linear solve a join (observe mode), and the poses of that larger
/// map marginalised. Few are those that common_points() finds nothing among: what counts is whether
/// both maps can tell them apart.
///
/// Each map's information is gauge-free and exact; its anchor and `solved_in` are points that
/// best_points() chooses, which is the frame it is an observation in when joined in observe or
/// optimal mode. What the poses shared by two local maps say of both is lost. Dense over the
/// features of a map.
///
/// \throws InputError when there are no local maps; DisconnectedError that names neighbours which
/// share neither pose nor features; DegenerateFrameError when a map has no points that fix a frame;
/// SingularError.
template <int D>
FeatureOnlyMaps<D> features_only(std::span<const LocalMap<D>> local_maps);

}  // namespace mapjoin
