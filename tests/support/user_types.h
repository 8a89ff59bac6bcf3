// What a user of the library might add: variable types of their own, and those of the examples.
// Compiled once, in user_types.cpp, as the library's own are: the compiler takes seconds over each,
// so tests include this and not the examples' headers.
#pragma once

#include <cmath>

#include "examples/bias.h"
#include "examples/direction3.h"
#include "examples/line2.h"
#include "examples/plane3.h"
#include "mapjoin/graph/builtin_types.h"
#include "mapjoin/graph/variable_kind.h"

namespace mapjoin::test {

/// A line of the plane: the points x with n . x = offset, n = (cos angle, sin angle). Offers
/// nothing that maps are laid on one another by (own::Line in examples/line2.h does).
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
using BiasType = own::Bias<D>;

static_assert(VariableType<Wall>);

extern const VariableKind<2> kWallKind, kBias2Kind, kLineKind;
extern const VariableKind<3> kBias3Kind, kDirectionKind, kPlaneKind;

}  // namespace mapjoin::test

namespace mapjoin::detail {

template <>
inline constexpr const VariableKind<2>* kCompiledKind<test::Wall> = &test::kWallKind;
template <>
inline constexpr const VariableKind<2>* kCompiledKind<test::BiasType<2>> = &test::kBias2Kind;
template <>
inline constexpr const VariableKind<3>* kCompiledKind<test::BiasType<3>> = &test::kBias3Kind;
template <>
inline constexpr const VariableKind<2>* kCompiledKind<own::Line> = &test::kLineKind;
template <>
inline constexpr const VariableKind<3>* kCompiledKind<own::Direction> = &test::kDirectionKind;
template <>
inline constexpr const VariableKind<3>* kCompiledKind<own::Plane> = &test::kPlaneKind;

}  // namespace mapjoin::detail
