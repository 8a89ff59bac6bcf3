#pragma once

#include <optional>
#include <span>
#include <vector>

#include "mapjoin/filtering/information_filter.h"
#include "mapjoin/filtering/slsjf.h"

/// \file
/// D-SLAM map joining (Huang, Wang, Dissanayake, ICRA 2006).
///
/// The global map is features alone, in the frame in which the first local map begins: that pose
/// stays as the anchor, and no other pose is in the state. Of every further local map only what it
/// says of its features *relative to each other* is fused (relative_information.h): in the plane
/// distances and angles, in space the coordinates in the frame of three features. Where the robot
/// was can be had from the map at any time.
///
/// One thing is done otherwise than in the paper. There two common features say where the new ones
/// lie at first; here it is the best rigid fit over all common ones. That is where everything is
/// linearised, once and for all: with two, the RMSE of dlr_200 to its optimum is 1.61 m, with all
/// 0.55 m (0.54 m published), of victoria_park_200 0.09 and 0.16 m (0.27 m).

namespace mapjoin {

/// Where the robot began and ended a local map, in the frame of the global map.
template <int D>
struct RobotLocation {
  Rigid<D> start;
  Rigid<D> end;
};

template <int D>
class DslamJoin {
 public:
  explicit DslamJoin(const FilterOptions& options = {}) : filter_(options) {}

  /// Fuses the next local map. The first is the global map, without its end pose (III-B). Further
  /// ones need two features (in space three) that are in the global map and that they can tell
  /// apart. \throws InputError; DisconnectedError that names what is missing; SingularError.
  Fusion fuse(const LocalMap<D>& local_map);
  /// The same for a map that has been joined, or stripped of its poses, before. As the first one it
  /// has to hold the pose of its anchor.
  Fusion fuse(const Map<D>& map);

  int fused() const { return fused_; }
  const InformationFilter<D>& filter() const { return filter_; }
  Map<D> map() const { return filter_.map(); }
  Values<D> values() const { return filter_.state().values(); }
  Eigen::MatrixXd covariance(std::span<const Key> keys);

  /// The robot's location (V-A): where the local map lies by the features it has in common with the
  /// global map. \throws DisconnectedError that says how many those are.
  RobotLocation<D> locate(const LocalMap<D>& local_map) const;

 private:
  void fuse_relative(const Map<D>& features);

  InformationFilter<D> filter_;
  int fused_ = 0;
};

/// Features of a global map that a local map may see (V-B): those no farther from `f1` than the
/// local map's own features are, and `margin` metres for the error of both. The rest need not be
/// compared with it. `f1` is a feature of both. Ascending keys. O(features). \throws InputError.
template <int D>
std::vector<Key> gated_features(const Values<D>& global, const Values<D>& local, const Key& f1,
                                double margin);

/// Local maps as D-SLAM map joining takes them: the first without its end pose, the others without
/// poses; neighbours that share too few features are joined with their poses first
/// (joining/features_only.h).
template <int D>
struct DslamInput {
  Map<D> first;                 ///< features and the start pose, its anchor
  std::vector<Map<D>> further;  ///< features alone
  std::vector<int> parts;       ///< how many local maps each is made of, the first's first
  Anchor<D> first_points;       ///< points that fix a frame in `first`
};
template <int D>
DslamInput<D> dslam_input(std::span<const LocalMap<D>> local_maps);

/// Joins local maps by D-SLAM map joining. \throws as DslamJoin::fuse; CancelledError.
template <int D>
FilterResult<D> dslam(std::span<const LocalMap<D>> local_maps, const FilterOptions& options = {},
                      const ProgressCallback& progress = {});

/// I-DMJ, its iterated form: the nonlinear least squares optimum over the relative information of
/// all local maps, from the estimate of D-SLAM map joining.
template <int D>
FilterResult<D> idslam(std::span<const LocalMap<D>> local_maps, const FilterOptions& options = {},
                       const ProgressCallback& progress = {});

extern template class DslamJoin<2>;
extern template class DslamJoin<3>;

}  // namespace mapjoin
