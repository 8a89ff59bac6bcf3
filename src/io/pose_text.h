#pragma once

#include <fmt/compile.h>

#include <Eigen/Geometry>
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

/// Appends a space and the number, with as many digits as reading it back exactly takes. Most of
/// the time that writing a graph takes is spent here.
inline void append_number(std::string& out, double number) {
  char text[32];
  text[0] = ' ';
  out.append(text, fmt::format_to(text + 1, FMT_COMPILE("{}"), number));
}

/// Appends " x y theta" or " x y z qx qy qz qw", each number with as many digits as reading it back
/// exactly takes.
template <int D>
void append_pose(std::string& out, const Rigid<D>& pose) {
  for (int k = 0; k < D; ++k) append_number(out, pose.t(k));
  if constexpr (D == 2) {
    append_number(out, heading(pose));
  } else {
    const Eigen::Quaterniond q = positive_quaternion(pose.R);
    for (const double part : {q.x(), q.y(), q.z(), q.w()}) append_number(out, part);
  }
}

}  // namespace mapjoin::detail
