#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "mapjoin/graph/map.h"

/// \file
/// What a map of the plane says of how its features lie to each other, and nothing else (D-SLAM map
/// joining, sections III-A and IV): of features f_1 ... f_n
///
///     z = [d_12, alpha_312, d_13, ..., alpha_n12, d_1n]                                  (3), (10)
///
/// their distances from f_1 and their angles at f_1 from the direction of f_2. No choice of frame
/// changes these 2n - 3 numbers. Metres and radians.

namespace mapjoin {

/// z and its information R^-1.
struct RelativeInformation {
  std::vector<Key> features;  ///< f_1, f_2, ..., f_n
  Eigen::VectorXd z;
  Eigen::MatrixXd information;
};

/// The relative information of a map of points alone, exactly what the map says in any frame: its
/// information in the frame of f_1 and f_2, in polar coordinates there. O(n^2) and the blocks of
/// the map. \throws InputError when the map holds anything but points, or lacks f_1 or f_2;
/// DegenerateFrameError when another feature coincides with f_1.
RelativeInformation relative_information(const Map<2>& map, const Key& f1, const Key& f2);

/// H(X) of (4) for the positions of f_1 ... f_n in any frame, 2 x n; `jacobian` becomes its
/// derivative by the stacked positions, (2n - 3) x 2n, unless null.
Eigen::VectorXd relative_positions(const Eigen::Matrix2Xd& X, Eigen::MatrixXd* jacobian);

/// z - H(X), angles within (-pi, pi].
Eigen::VectorXd relative_residual(const Eigen::VectorXd& z, const Eigen::VectorXd& h);

}  // namespace mapjoin
