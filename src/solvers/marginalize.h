#pragma once

#include <span>
#include <vector>

#include "mapjoin/graph/map.h"

namespace mapjoin {

/// What a map says of some of its variables: the others are eliminated from its information.
///
/// With the kept variables k and the dropped ones d,
///
///     Lambda = Lambda_kk - Lambda_kd Lambda_dd^-1 Lambda_dk
///
/// on the gauge-free information, which is gauge-free again: so no frame is needed, or preferred,
/// and re-framing before or after gives the same (equation 20 of Linear SLAM). Estimates of what is
/// kept do not change. The result is a summary: it carries no observations.
///
/// Frames: the map stays in its frame when its anchor is kept. Otherwise it is written in that of
/// `anchor`, or where none is given in that of the lowest kept pose; where no pose is kept either,
/// in that of points that are far apart (farthest_points). Where there are none, as of walls alone,
/// the values stay as they are and the anchor is left empty.
///
/// The dropped variables are eliminated in a minimum degree order by dense fronts. Variables kept
/// around a connected set of dropped ones all become neighbours: dropping one trajectory leaves a
/// dense matrix over the features it has seen, dropping features one that is nearly as sparse as
/// before. Without recursion.
///
/// \throws DegenerateFrameError when what is kept does not fix a frame (one pose; two points in the
/// plane; three in space that are not collinear); InputError that names a key the map does not
/// have; SingularError that names a dropped variable which the information does not determine.
template <int D>
Map<D> marginalize(const Map<D>& map, std::span<const Key> keep, const Anchor<D>& anchor = {});

/// The same by numbers of variables in the map, ascending.
template <int D>
Map<D> marginalize(const Map<D>& map, std::span<const int> keep, const Anchor<D>& anchor = {});

/// The same, told what to drop.
template <int D>
Map<D> marginalize_out(const Map<D>& map, std::span<const Key> drop, const Anchor<D>& anchor = {});

/// Numbers of all poses: what a pose-only map keeps.
template <int D>
std::vector<int> poses_of(const VariableSet<D>& variables);
/// Numbers of all that are no poses: what a feature-only map keeps.
template <int D>
std::vector<int> features_of(const VariableSet<D>& variables);
/// The last pose and all features: the map as a Kalman filter has it (section 3.2).
/// \throws InputError when there is no pose.
template <int D>
std::vector<int> last_pose_and_features(const VariableSet<D>& variables);

}  // namespace mapjoin
