// A variable type of one's own: directions of space. (Which way is up, where the sun stands.)
#pragma once

#include <cmath>

#include "mapjoin/graph/key.h"
#include "mapjoin/graph/variable.h"

namespace own {

using mapjoin::Mat;
using mapjoin::Vec;

/// A direction of space: a unit vector, which turns with the map and does not move with it.
/// Tangent: two numbers, stereographic (twice the tangent of half the angle), so that the functions
/// are rational and smooth but for the opposite direction.
struct Direction {
  static constexpr int ambient = 3;
  static constexpr int dim = 2;
  static constexpr std::string_view name = "up";
  static constexpr mapjoin::FrameAction action = mapjoin::FrameAction::kGeneral;
  template <class S>
  using Value = Vec<3, S>;

  /// Two unit vectors across x. Next to z they hardly change with x: in the level frame, up is z
  /// but for rounding errors, and must not find itself in another chart for them.
  template <class S>
  static Mat<3, 2, S> across(const Vec<3, S>& x) {
    const int k = x(0) * x(0) > S(0.8) ? 1 : 0;
    using std::sqrt;
    Vec<3, S> u = Vec<3, S>::Zero();
    u(k) = S(1.0);
    u -= x * x(k);
    u /= sqrt(u.dot(u));
    Mat<3, 2, S> out;
    out.col(0) = u;
    out.col(1) =
        Vec<3, S>(x(1) * u(2) - x(2) * u(1), x(2) * u(0) - x(0) * u(2), x(0) * u(1) - x(1) * u(0));
    return out;
  }
  template <class S>
  static Vec<3, S> retract(const Vec<3, S>& x, const Vec<2, S>& d) {
    const S q = d.dot(d) * S(0.25);
    const Vec<3, S> side = across<S>(x) * d;
    return (x * (S(1.0) - q) + side) / (S(1.0) + q);
  }
  template <class S>
  static Vec<2, S> local(const Vec<3, S>& x, const Vec<3, S>& y) {
    const Vec<2, S> side = across<S>(x).transpose() * y;
    return side * (S(2.0) / (S(1.0) + x.dot(y)));
  }
  template <class S>
  static Vec<3, S> transform(const mapjoin::Rigid<3, S>& T, const Vec<3, S>& x) {
    return T.R * x;
  }
  static Vec<3> direction(const Vec<3>& x) { return x; }  // helps to lay maps on one another
};
static_assert(mapjoin::VariableType<Direction>);

inline mapjoin::Key up_key(std::uint64_t id) { return {"up", 0, id}; }

}  // namespace own
