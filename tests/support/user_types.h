// What a user of the library might add: variable types and a kind of anchor of their own.
#pragma once

#include <cmath>
#include <vector>

#include "mapjoin/frames/anchors.h"
#include "mapjoin/graph/builtin_types.h"
#include "mapjoin/graph/error.h"

namespace mapjoin::test {

/// A line of the plane: the points x with n . x = offset, n = (cos angle, sin angle).
struct Wall {
  static constexpr int ambient = 2;
  static constexpr int dim = 2;
  static constexpr std::string_view name = "wall";
  static constexpr FrameAction action = FrameAction::kGeneral;
  template <class S>
  struct Value {
    S angle, offset;
  };
  template <class S>
  static Value<S> retract(const Value<S>& x, const Vec<2, S>& d) {
    return {x.angle + d(0), x.offset + d(1)};
  }
  template <class S>
  static Vec<2, S> local(const Value<S>& x, const Value<S>& y) {
    using std::atan2;
    using std::cos;
    using std::sin;
    const S turn = y.angle - x.angle;
    return {atan2(sin(turn), cos(turn)), y.offset - x.offset};
  }
  template <class S>
  static Value<S> transform(const Rigid<2, S>& T, const Value<S>& x) {
    using std::atan2;
    using std::cos;
    using std::sin;
    const S angle = x.angle + atan2(T.R(1, 0), T.R(0, 0));
    return {angle, x.offset + cos(angle) * T.t(0) + sin(angle) * T.t(1)};
  }
};

/// A number that no frame touches, in D dimensions: the bias of a sensor.
template <int D>
struct BiasType {
  static constexpr int ambient = D;
  static constexpr int dim = 1;
  static constexpr std::string_view name = "bias";
  static constexpr FrameAction action = FrameAction::kInvariant;
  template <class S>
  using Value = Vec<1, S>;
  template <class S>
  static Vec<1, S> retract(const Vec<1, S>& x, const Vec<1, S>& d) {
    return x + d;
  }
  template <class S>
  static Vec<1, S> local(const Vec<1, S>& x, const Vec<1, S>& y) {
    return y - x;
  }
  template <class S>
  static Vec<1, S> transform(const Rigid<D, S>&, const Vec<1, S>& x) {
    return x;
  }
};

static_assert(VariableType<Wall> && VariableType<BiasType<2>> && VariableType<BiasType<3>>);

/// The frame of two points of the plane: one at the origin, the other on the x axis.
inline constexpr Tag kTwoPoints[] = {Tag("point"), Tag("point")};
inline const AnchorKind<2>& two_points_kind() {
  static const AnchorKind<2> kind = [] {
    AnchorKind<2> out;
    out.tag = Tag("points");
    out.arity = 2;
    out.types = kTwoPoints;
    out.tangent = 4;
    out.frame = [](const double* const* x, const Key* keys) {
      const double dx = x[1][0] - x[0][0];
      const double dy = x[1][1] - x[0][1];
      if (std::hypot(dx, dy) < 1e-9) {
        throw DegenerateFrameError(to_string(keys[0]) + " and " + to_string(keys[1]) +
                                   " are at the same place");
      }
      const Rigid2 pose = rigid2(x[0][0], x[0][1], std::atan2(dy, dx));
      return pose.inverse();
    };
    out.rows = [](const double* const*, double* P) {
      Eigen::Map<Eigen::Matrix<double, 3, 4>> rows(P);
      rows.setZero();
      rows(0, 0) = rows(1, 1) = rows(2, 3) = 1.0;
    };
    out.pin = [](double* const* x) { x[0][0] = x[0][1] = x[1][1] = 0.0; };
    return out;
  }();
  return kind;
}
inline Anchor<2> two_points(std::uint64_t origin, std::uint64_t axis) {
  return {&two_points_kind(), {point_key(origin), point_key(axis)}};
}

}  // namespace mapjoin::test
