#pragma once

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <iterator>
#include <string>

#include "mapjoin/graph/rigid.h"

namespace mapjoin::detail {

/// The quaternion of a rotation, of length one and with w >= 0.
inline Eigen::Quaterniond positive_quaternion(const Mat<3, 3>& R) {
  Eigen::Quaterniond q(Eigen::Matrix3d{R});
  q.normalize();
  if (q.w() < 0.0) q.coeffs() = -q.coeffs();
  return q;
}

/// Appends " x y theta" or " x y z qx qy qz qw", each number with as many digits as reading it back
/// exactly takes.
template <int D>
void append_pose(std::string& out, const Rigid<D>& pose) {
  if constexpr (D == 2) {
    fmt::format_to(std::back_inserter(out), " {} {} {}", pose.t(0), pose.t(1), heading(pose));
  } else {
    const Eigen::Quaterniond q = positive_quaternion(pose.R);
    fmt::format_to(std::back_inserter(out), " {} {} {} {} {} {} {}", pose.t(0), pose.t(1),
                   pose.t(2), q.x(), q.y(), q.z(), q.w());
  }
}

}  // namespace mapjoin::detail
