#pragma once

#include <cstdint>
#include <vector>

#include "mapjoin/building/robust_loss.h"
#include "mapjoin/building/segmentation.h"
#include "mapjoin/graph/map.h"

/// \file
/// Local maps from raw measurements: where maps come from (Linear SLAM sections 3 and 5.3, SLSJF
/// section II). This is the nonlinear part of SLAM by submap joining, and it stays small: each
/// local map is a least squares problem of its own, started from the chain of its own measurements,
/// or where there are many from joining them (building/parts.h). Everything after it is linear.
///
///     const RawLog<2> log = raw_log(read_g2o("park.g2o").as<2>());
///     const BuiltMaps<2> built = build_local_maps(log, segment(log, {SegmentRule::By::kPoses,
///     50})); const JoinResult<2> joined = join_all(std::span<const Map<2>>(built.maps), {},
///     options);

namespace mapjoin {

enum class Builder {
  kNonlinear,  ///< nonlinear least squares over all measurements of the map (Ceres)
  kFilter      ///< an extended Kalman filter, pose by pose, as SLSJF and D-SLAM have it
};

/// What fixes the frame of a local map.
enum class LocalFrame {
  kStart,    ///< its first pose
  kEnd,      ///< its last pose
  kFeatures  ///< features that are far apart; the first pose where the map has too few
};

/// What a local map keeps; the rest is marginalised (Linear SLAM section 3.2). Poses that other
/// local maps know of too are kept whenever poses are.
enum class Keep {
  kAll,
  kEndPose,  ///< first and last pose, and the features
  kFeatures  ///< no pose: D-SLAM
};

struct BuildOptions {
  Builder builder = Builder::kNonlinear;
  LocalFrame frame = LocalFrame::kStart;
  Keep keep = Keep::kAll;
  RobustLoss loss = {};  ///< nonlinear builder only; off by default
  int threads = 1;       ///< the result has the same bits for any number
  int max_iterations = 100;
  /// Local maps of more than a hundred poses are built in parts that are joined (building/parts.h),
  /// unless this says not to: then from the chain of their measurements, as the papers do. For
  /// comparison.
  bool whole = false;
};

/// Local maps, and what went into them.
template <int D>
struct BuiltMaps {
  /// In order of time. A segment whose poses fall apart gives several, one that places nothing
  /// none. Values and information at the optimum, gauge-free. The map is the measurement now: maps
  /// of the nonlinear builder that keep everything carry themselves as their observations, taken
  /// apart so that joins stay sparse (from the anchor where that is a pose, else from the first
  /// pose), large ones of a filter carry their parts; others are one dense observation each.
  std::vector<Map<D>> maps;
  std::vector<std::int64_t> used;     ///< measurements in the maps, ascending, each once
  std::vector<std::int64_t> refused;  ///< of features that no map could place: in no map
  double chi2 = 0.0;                  ///< sum over the maps; with a robust loss, of its costs
  int most_iterations = 0;            ///< of the nonlinear solves
  double seconds = 0.0;
};

/// Builds every local map of a segmentation, in parallel.
///
/// Measurements of features that cannot be placed (ranges or bearings that leave several places)
/// are refused and listed, never guessed. Cost: one small sparse problem a map. \throws InputError
/// (options that make no sense; frames of features of a recording that has none), SingularError,
/// DegenerateFrameError (features alone that fix no frame; the message names the map), Error when a
/// nonlinear problem does not converge.
template <int D>
BuiltMaps<D> build_local_maps(const RawLog<D>& log, const Segmentation& segmentation,
                              const BuildOptions& options = {});

extern template BuiltMaps<2> build_local_maps<2>(const RawLog<2>&, const Segmentation&,
                                                 const BuildOptions&);
extern template BuiltMaps<3> build_local_maps<3>(const RawLog<3>&, const Segmentation&,
                                                 const BuildOptions&);

}  // namespace mapjoin
