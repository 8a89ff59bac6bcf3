#pragma once

#include <Eigen/Core>
#include <optional>

#include "mapjoin/frames/anchors.h"

/// \file
/// Frames fixed by features alone (Linear SLAM, Appendix B): two points in the plane, three in
/// space. A feature-only map has no other; any map with enough points can be written in one.
///
///     in the plane, points:O,X     F_O = (0, 0)       F_X = (d, 0)
///     in space, points:O,X,Y       F_O = (0, 0, 0)    F_X = (d, 0, 0)    F_Y = (s, h, 0)
///
/// F_O is the origin, F_X lies on the positive x axis, F_Y on the side of positive y in the x-y
/// plane. What is written as a number is pinned: three coordinates in the plane, six in space. So
/// `anchored_information` drops both rows of F_O and the y row of F_X; in space the three rows of
/// F_O, y and z of F_X, and z of F_Y. det C = d in the plane and d^2 h in space: the frame is lost
/// where the distance d or the height h vanishes.
///
/// Two tests tell that. Every use of such an anchor asks whether d and h stand out of the rounding
/// errors of the coordinates they are computed from (1e-9 of the largest); the directions of the
/// axes are then good to 1e-7 rad. Whether the *map* can tell the points apart is asked by
/// `expect_distinct`, of whoever has their covariance.

namespace mapjoin {

/// The kind of anchor that is two points in the plane, three in space.
template <int D>
const AnchorKind<D>& points_anchor_kind();

/// The frame of two points of the plane: one at the origin, the other on the positive x axis.
Anchor<2> points_anchor(const Key& origin, const Key& on_x);

/// The frame of three points of space: at the origin, on the positive x axis, and in the x-y plane
/// at positive y.
Anchor<3> points_anchor(const Key& origin, const Key& on_x, const Key& at_y);

/// Points of a set of values that are far apart, as an anchor: what a map without poses is written
/// in when nobody asks for anything else.
///
/// F_X is the point farthest from the centroid of all and F_O the one farthest from F_X (their
/// distance is at least half of the largest there is), in space F_Y the one farthest from the line
/// through both; of equals, the lowest key. F_O and F_X then change places if that puts the lower
/// key first. Two or three sweeps, O(points). \returns nothing when there are too few points, or
/// when all coincide or are collinear.
template <int D>
std::optional<Anchor<D>> farthest_points(const Values<D>& values);

/// What the frame of points hangs on, and how well it is known: lengths of the map, the same in
/// whatever frame it is written, and so are their standard deviations.
struct PointsCertainty {
  double distance = 0.0;        ///< of F_X from F_O
  double distance_sigma = 0.0;  ///< its standard deviation
  double height = 0.0;          ///< in space, of F_Y above the line through both; else 0
  double height_sigma = 0.0;
};

/// Lengths that are fewer standard deviations than this may as well be zero.
inline constexpr double kDistinctSigmas = 3.0;

/// To first order, of D points and their joint covariance, stacked. Lengths that drown in rounding
/// errors of the coordinates are zero, and have no standard deviation.
template <int D>
PointsCertainty certainty(const Vec<D>* points, const Eigen::MatrixXd& covariance);

/// To first order, from the joint covariance of the anchor's points: D^2 x D^2, their coordinates
/// stacked in the order of the keys, in any frame; zero where that frame pins.
/// \throws InputError when the covariance is of another size or the anchor is not of points;
/// DegenerateFrameError as any use of the anchor.
template <int D>
PointsCertainty certainty(const Anchor<D>& anchor, const Values<D>& values,
                          const Eigen::MatrixXd& covariance);

/// Requires distance and height to be more than three standard deviations. What is less may as well
/// be zero or point the other way, and linearisation about it means nothing: the frame is
/// degenerate within what the map can tell. \throws DegenerateFrameError that names the points and
/// the numbers.
template <int D>
void expect_distinct(const Anchor<D>& anchor, const Values<D>& values,
                     const Eigen::MatrixXd& covariance);

}  // namespace mapjoin
