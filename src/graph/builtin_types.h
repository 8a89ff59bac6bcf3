#pragma once

#include "mapjoin/graph/variable.h"

namespace mapjoin {

/// A pose: the rigid motion from a body frame to the map frame. Tangent (rho, phi), both in the
/// body frame, in the decoupled chart T [+] (rho, phi) = (t + R rho, R Exp phi).
///
/// Decoupled, so that positions of poses move in straight lines exactly as points do: that is what
/// makes one linear solve of a pose-feature join good.
template <int D>
struct PoseType {
  static constexpr int ambient = D;
  static constexpr int dim = kGauge<D>;
  static constexpr std::string_view name = "pose";
  static constexpr FrameAction action = FrameAction::kBody;
  static constexpr int kRot = kRotation<D>;

  template <class S>
  using Value = Rigid<D, S>;

  template <class S>
  static Rigid<D, S> retract(const Rigid<D, S>& x, const Vec<dim, S>& d) {
    Rigid<D, S> out;
    const Vec<kRot, S> phi = d.template tail<kRot>();
    out.t = x.t;
    out.t.noalias() += x.R * d.template head<D>();
    out.R.noalias() = x.R * rotation_exp<D, S>(phi);
    return out;
  }
  template <class S>
  static Vec<dim, S> local(const Rigid<D, S>& x, const Rigid<D, S>& y) {
    Vec<dim, S> d;
    const Vec<D, S> step = y.t - x.t;
    const Mat<D, D, S> turn = x.R.transpose() * y.R;
    d.template head<D>().noalias() = x.R.transpose() * step;
    d.template tail<kRot>() = rotation_log<D, S>(turn);
    return d;
  }
  template <class S>
  static Rigid<D, S> transform(const Rigid<D, S>& T, const Rigid<D, S>& x) {
    return T * x;
  }
  /// Ad(x^-1).
  static Mat<dim, dim> gauge(const Rigid<D>& x) {
    Mat<dim, dim> g = Mat<dim, dim>::Zero();
    g.template topLeftCorner<D, D>() = x.R.transpose();
    if constexpr (D == 2) {
      const Vec<2> side(-x.t(1), x.t(0));
      g.template topRightCorner<2, 1>().noalias() = x.R.transpose() * side;
      g(2, 2) = 1.0;
    } else {
      g.template topRightCorner<3, 3>().noalias() = -(x.R.transpose() * skew(x.t));
      g.template bottomRightCorner<3, 3>() = x.R.transpose();
    }
    return g;
  }
  static Mat<dim, dim> local_jacobian(const Rigid<D>& x, const Rigid<D>& y) {
    Mat<dim, dim> S = Mat<dim, dim>::Zero();
    const Mat<D, D> turn = x.R.transpose() * y.R;
    S.template topLeftCorner<D, D>() = turn;
    S.template bottomRightCorner<kRot, kRot>() =
        inverse_right_jacobian<D, double>(rotation_log<D, double>(turn));
    return S;
  }
  /// local, local_jacobian and S g in one: the rotations that S and g share cancel.
  static Vec<dim> linearized_local(const Rigid<D>& x, const Rigid<D>& y, Mat<dim, dim>& S,
                                   Mat<dim, dim>& Sg) {
    const Mat<D, D> back = x.R.transpose();
    const Mat<D, D> turn = back * y.R;
    const Vec<kRot> phi = rotation_log<D, double>(turn);
    Vec<dim> r;
    r.template head<D>().noalias() = back * (y.t - x.t);
    r.template tail<kRot>() = phi;
    S.setZero();
    S.template topLeftCorner<D, D>() = turn;
    Sg.setZero();
    Sg.template topLeftCorner<D, D>() = back;
    if constexpr (D == 2) {
      S(2, 2) = 1.0;
      Sg.template topRightCorner<2, 1>().noalias() = back * Vec<2>(-y.t(1), y.t(0));
      Sg(2, 2) = 1.0;
    } else {
      const Mat<3, 3> J = inverse_right_jacobian<3, double>(phi);
      S.template bottomRightCorner<3, 3>() = J;
      for (int k = 0; k < 3; ++k)  // a row of -(back [y.t]x): y.t x back's
        Sg.template block<1, 3>(k, 3) = y.t.cross(Vec<3>(back.row(k).transpose())).transpose();
      Sg.template bottomRightCorner<3, 3>().noalias() = J * y.R.transpose();
    }
    return r;
  }
  static Vec<dim> transport(const Rigid<D>& x, const Rigid<D>& y, const Vec<dim>& d) {
    Vec<dim> out = d;
    out.template head<D>().noalias() = y.R.transpose() * Vec<D>(x.R * d.template head<D>());
    if constexpr (D == 3)
      out.template tail<3>().noalias() = y.R.transpose() * Vec<3>(x.R * d.template tail<3>());
    return out;
  }
  static Vec<D> position(const Rigid<D>& x) { return x.t; }
  static Mat<D, D> rotation(const Rigid<D>& x) { return x.R; }
};

/// A point feature. Tangent: its displacement in the map frame.
template <int D>
struct PointType {
  static constexpr int ambient = D;
  static constexpr int dim = D;
  static constexpr std::string_view name = "point";
  static constexpr FrameAction action = FrameAction::kRotating;

  template <class S>
  using Value = Vec<D, S>;

  template <class S>
  static Vec<D, S> retract(const Vec<D, S>& x, const Vec<D, S>& d) {
    return x + d;
  }
  template <class S>
  static Vec<D, S> local(const Vec<D, S>& x, const Vec<D, S>& y) {
    return y - x;
  }
  template <class S>
  static Vec<D, S> transform(const Rigid<D, S>& T, const Vec<D, S>& x) {
    return T * x;
  }
  /// [I, -[p]x]; in the plane [I, (-y, x)^T].
  static Mat<D, kGauge<D>> gauge(const Vec<D>& p) {
    Mat<D, kGauge<D>> g;
    g.template leftCols<D>().setIdentity();
    if constexpr (D == 2) {
      g(0, 2) = -p(1);
      g(1, 2) = p(0);
    } else {
      g.template rightCols<3>() = -skew(p);
    }
    return g;
  }
  static Mat<D, D> local_jacobian(const Vec<D>&, const Vec<D>&) { return Mat<D, D>::Identity(); }
  static Vec<D> position(const Vec<D>& p) { return p; }
};

using Pose2 = PoseType<2>;
using Pose3 = PoseType<3>;
using Point2 = PointType<2>;
using Point3 = PointType<3>;

static_assert(VariableType<Pose2> && VariableType<Pose3> && VariableType<Point2> &&
              VariableType<Point3>);

}  // namespace mapjoin
