#pragma once

#include <cmath>

#include "mapjoin/graph/rigid.h"

/// \file
/// The three angles (a, b, c) of 3D local-map files: R = Rz(a) Ry(b) Rx(c), that is yaw, pitch and
/// roll in radians, and how coordinates in such files change with the tangents of the library's
/// poses.
///
/// The files' authors write R^T = Rx(c) Ry(b) Rz(a) with matrices that turn the other way round; it
/// is the same rotation.

namespace mapjoin {

/// R = Rz(a) Ry(b) Rx(c).
inline Mat<3, 3> rotation_from_angles(const Vec<3>& angles) {
  const double ca = std::cos(angles(0)), sa = std::sin(angles(0));
  const double cb = std::cos(angles(1)), sb = std::sin(angles(1));
  const double cc = std::cos(angles(2)), sc = std::sin(angles(2));
  Mat<3, 3> R;
  R << ca * cb, ca * sb * sc - sa * cc, ca * sb * cc + sa * sc,  //
      sa * cb, sa * sb * sc + ca * cc, sa * sb * cc - ca * sc,   //
      -sb, cb * sc, cb * cc;
  return R;
}

/// The angles of a rotation, b in [-pi/2, pi/2]. At b = +-pi/2 only a -+ c is determined, and c is
/// set to 0.
inline Vec<3> angles_from_rotation(const Mat<3, 3>& R) {
  const double cos_b = std::hypot(R(0, 0), R(1, 0));
  const double b = std::atan2(-R(2, 0), cos_b);
  if (cos_b < 1e-12) return {std::atan2(-R(0, 1), R(1, 1)), b, 0.0};
  return {std::atan2(R(1, 0), R(0, 0)), b, std::atan2(R(2, 1), R(2, 2))};
}

/// How far b is from where the angles are singular: |cos b|.
inline double angles_regularity(const Vec<3>& angles) { return std::abs(std::cos(angles(1))); }

/// d angles / d phi for R Exp(phi) at phi = 0. The columns of its inverse are the axes, seen from
/// the body, about which a, b and c turn. Grows without bound as angles_regularity goes to 0.
inline Mat<3, 3> angle_rates(const Vec<3>& angles) {
  const double cb = std::cos(angles(1)), tb = std::tan(angles(1));
  const double cc = std::cos(angles(2)), sc = std::sin(angles(2));
  Mat<3, 3> M;
  M << 0.0, sc / cb, cc / cb,  //
      0.0, cc, -sc,            //
      1.0, sc * tb, cc * tb;
  return M;
}

/// The inverse of angle_rates, finite everywhere.
inline Mat<3, 3> inverse_angle_rates(const Vec<3>& angles) {
  const double cb = std::cos(angles(1)), sb = std::sin(angles(1));
  const double cc = std::cos(angles(2)), sc = std::sin(angles(2));
  Mat<3, 3> E;
  E << -sb, 0.0, 1.0,    //
      cb * sc, cc, 0.0,  //
      cb * cc, -sc, 0.0;
  return E;
}

/// A pose from the numbers a file gives: x, y, heading or x, y, z, a, b, c.
template <int D>
Rigid<D> pose_from_file_coordinates(const double* x) {
  if constexpr (D == 2) {
    return rigid2(x[0], x[1], x[2]);
  } else {
    return {rotation_from_angles({x[3], x[4], x[5]}), {x[0], x[1], x[2]}};
  }
}

/// The numbers of a pose. Inverse of pose_from_file_coordinates.
template <int D>
Twist<D> file_coordinates(const Rigid<D>& pose) {
  Twist<D> x;
  x.template head<D>() = pose.t;
  if constexpr (D == 2) {
    x(2) = heading(pose);
  } else {
    x.template tail<3>() = angles_from_rotation(pose.R);
  }
  return x;
}

/// B = d(file coordinates) / d(tangent) of a pose: diag(R, 1) in the plane, diag(R, angle_rates) in
/// space. Information of the file's coordinates is B^T I B in the library's tangent.
template <int D>
Mat<kGauge<D>, kGauge<D>> file_chart_jacobian(const Rigid<D>& pose, const double* x) {
  Mat<kGauge<D>, kGauge<D>> B = Mat<kGauge<D>, kGauge<D>>::Zero();
  B.template topLeftCorner<D, D>() = pose.R;
  if constexpr (D == 2) {
    B(2, 2) = 1.0;
  } else {
    B.template bottomRightCorner<3, 3>() = angle_rates({x[3], x[4], x[5]});
  }
  return B;
}

/// The inverse of file_chart_jacobian.
template <int D>
Mat<kGauge<D>, kGauge<D>> inverse_file_chart_jacobian(const Rigid<D>& pose, const double* x) {
  Mat<kGauge<D>, kGauge<D>> B = Mat<kGauge<D>, kGauge<D>>::Zero();
  B.template topLeftCorner<D, D>() = pose.R.transpose();
  if constexpr (D == 2) {
    B(2, 2) = 1.0;
  } else {
    B.template bottomRightCorner<3, 3>() = inverse_angle_rates({x[3], x[4], x[5]});
  }
  return B;
}

}  // namespace mapjoin
