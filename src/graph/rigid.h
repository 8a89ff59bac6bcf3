#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

#include "mapjoin/graph/rotation.h"

namespace mapjoin {

/// Dimension of the group of rigid motions of D-dimensional space: 3 in the plane, 6 in space. A
/// map's gauge.
template <int D>
inline constexpr int kGauge = D == 2 ? 3 : 6;

/// A rigid motion x -> R x + t of D-dimensional space: the group that acts on variables.
///
/// Composition is `A * B`; `A * p` moves a point. A pose *is* the motion from its body frame to the
/// map frame. The matrices are unaligned so that arrays of values are plain arrays of scalars,
/// whatever the instruction set.
template <int D, class S = double>
struct Rigid {
  static_assert(D == 2 || D == 3, "mapjoin works in the plane and in space");
  using Vector = Vec<D, S>;
  using Rotation = Mat<D, D, S>;

  Rotation R = Rotation::Identity();
  Vector t = Vector::Zero();

  static Rigid identity() { return {}; }

  Rigid inverse() const {
    Rigid out;
    out.R = R.transpose();
    out.t.noalias() = -(R.transpose() * t);
    return out;
  }
  friend Rigid operator*(const Rigid& a, const Rigid& b) {
    Rigid out;
    out.R.noalias() = a.R * b.R;
    out.t.noalias() = a.R * b.t;
    out.t += a.t;
    return out;
  }
  friend Vector operator*(const Rigid& a, const Vector& p) { return a.R * p + a.t; }

  template <class Other>
  Rigid<D, Other> cast() const {
    return {R.template cast<Other>(), t.template cast<Other>()};
  }
};

using Rigid2 = Rigid<2>;
using Rigid3 = Rigid<3>;

/// Element of the Lie algebra, and tangent of a pose: (translation, rotation).
template <int D, class S = double>
using Twist = Vec<kGauge<D>, S>;

/// Pose of the plane from coordinates and a heading in radians.
inline Rigid2 rigid2(double x, double y, double theta) {
  Rigid2 out;
  out.R = rotation_exp<2>(Vec<1>(theta));
  out.t << x, y;
  return out;
}

/// Heading in radians, in (-pi, pi].
inline double heading(const Rigid2& pose) { return std::atan2(pose.R(1, 0), pose.R(0, 0)); }

/// Pose of space from a position and a quaternion, which need not be normalised.
inline Rigid3 rigid3(const Eigen::Vector3d& position, const Eigen::Quaterniond& orientation) {
  Rigid3 out;
  out.R = orientation.normalized().toRotationMatrix();
  out.t = position;
  return out;
}

/// Ad(T): T Exp(xi) T^-1 = Exp(Ad(T) xi) for xi = (translation, rotation).
template <int D, class S>
Mat<kGauge<D>, kGauge<D>, S> adjoint(const Rigid<D, S>& T) {
  Mat<kGauge<D>, kGauge<D>, S> Ad = Mat<kGauge<D>, kGauge<D>, S>::Zero();
  Ad.template topLeftCorner<D, D>() = T.R;
  if constexpr (D == 2) {
    Ad(0, 2) = T.t(1);
    Ad(1, 2) = -T.t(0);
    Ad(2, 2) = S(1);
  } else {
    Ad.template topRightCorner<3, 3>() = skew(T.t) * T.R;
    Ad.template bottomRightCorner<3, 3>() = T.R;
  }
  return Ad;
}

}  // namespace mapjoin
