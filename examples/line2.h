// A variable type of one's own: oriented lines of the plane. (Walls, kerbs, lane markings.)
#pragma once

#include <cmath>

#include "mapjoin/graph/key.h"
#include "mapjoin/graph/variable.h"

namespace own {

using mapjoin::Mat;
using mapjoin::Vec;

/// An oriented line of the plane: it runs in direction (cos a, sin a), and has d to its left of the
/// origin: the points p with (-sin a, cos a) . p = d. Whoever measures walls orients them alike,
/// say with the room to their left.
struct Line {
  static constexpr int ambient = 2;
  static constexpr int dim = 2;
  static constexpr std::string_view name = "line";
  static constexpr mapjoin::FrameAction action = mapjoin::FrameAction::kGeneral;
  template <class S>
  struct Value {
    S a, d;
  };
  template <class S>
  static Value<S> retract(const Value<S>& x, const Vec<2, S>& step) {
    return {x.a + step(0), x.d + step(1)};
  }
  template <class S>
  static Vec<2, S> local(const Value<S>& x, const Value<S>& y) {
    const Mat<2, 2, S> turn = mapjoin::rotation_exp<2, S>(Vec<1, S>(y.a - x.a));
    return {mapjoin::rotation_log<2, S>(turn)(0), y.d - x.d};  // an angle, wrapped
  }
  template <class S>
  static Value<S> transform(const mapjoin::Rigid<2, S>& T, const Value<S>& x) {
    using std::atan2;
    using std::cos;
    using std::sin;
    const Vec<2, S> along = T.R * Vec<2, S>(cos(x.a), sin(x.a));
    return {atan2(along(1), along(0)), x.d + along(0) * T.t(1) - along(1) * T.t(0)};
  }
  // What maps that share lines are laid on one another by.
  static Vec<2> direction(const Value<double>& x) { return {-std::sin(x.a), std::cos(x.a)}; }
  static double offset(const Value<double>& x) { return x.d; }
};
static_assert(mapjoin::VariableType<Line>);

inline mapjoin::Key line_key(std::uint64_t id) { return {"line", 0, id}; }

}  // namespace own
