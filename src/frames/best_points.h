#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "mapjoin/graph/anchor.h"

/// \file
/// Which points to fix a frame by, where a map has many: feature-only maps are joined in the frame
/// of some of the features they share (Linear SLAM section 7), and nobody says which.
///
/// The frame is lost where det C vanishes: the distance d of F_X from F_O in the plane, d^2 h in
/// space with the height h of F_Y above their line (frames/points_anchor.h). So the points with the
/// largest det C are best, of those whose d and h every map can tell from zero: by more than three
/// standard deviations. Both are the same in whatever frame the maps are written.

namespace mapjoin {

/// What one map knows of the candidates: their positions in any frame, and their joint covariance.
template <int D>
struct CandidatePoints {
  std::vector<Vec<D>> positions;
  Eigen::MatrixXd covariance;  ///< D n x D n, stacked in the order of the positions
};

/// Points that fix a frame.
template <int D>
struct ChosenPoints {
  Anchor<D> anchor;
  double certainty = 0.0;  ///< standard deviations in the least certain length, of all maps
};

/// At most `most` of the points, far from one another: the one farthest from the centroid, then
/// always the one farthest from those chosen, of equals the first. Ascending numbers. O(n most).
template <int D>
std::vector<int> spread_points(std::span<const Vec<D>> points, int most);

/// The two or three candidates with the largest det C, in the map where it is smallest, whose
/// lengths are certain in every map. F_O comes before F_X in the order of the candidates; of
/// equals, the first are chosen.
///
/// \returns nothing when there are too few, or when no lengths are more than three standard
/// deviations in every map: the same bound as expect_distinct(). O(n^D) in the number of
/// candidates; choose them by spread_points().
template <int D>
std::optional<ChosenPoints<D>> best_points(std::span<const Key> candidates,
                                           std::span<const CandidatePoints<D>> maps);

}  // namespace mapjoin
