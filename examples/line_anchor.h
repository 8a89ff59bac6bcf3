// A kind of anchor of one's own, in the plane: an oriented line and a point beside it. The line is
// the x axis, and the point says where along it the origin is. (A corridor's wall and a door, say.)
#pragma once

#include <cmath>

#include "line2.h"
#include "mapjoin/frames/anchors.h"
#include "mapjoin/graph/builtin_types.h"

namespace own {

// The kind: three functions of its variables' values, in the order of its keys. They see doubles,
// as one kind serves maps of any types.
namespace detail {

inline const Line::Value<double>& line(const double* x) {
  return *reinterpret_cast<const Line::Value<double>*>(x);
}

/// The motion into the frame. A line has a direction everywhere, so no such frame is degenerate.
inline mapjoin::Rigid2 frame(const double* const* x, const mapjoin::Key*) {
  const auto [a, d] = line(x[0]);
  const Vec<2> along(std::cos(a), std::sin(a));
  const Vec<2> left(-along(1), along(0));
  const double at = along(0) * x[1][0] + along(1) * x[1][1];  // the point, along the line
  mapjoin::Rigid2 into;
  into.R.row(0) = along.transpose();
  into.R.row(1) = left.transpose();
  into.t = Vec<2>(-at, -d);
  return into;
}

/// What the frame pins of the tangents (line: angle, offset; point: x, y).
inline void rows(const double* const*, double* P) {
  Eigen::Map<Eigen::Matrix<double, 3, 4>> pinned(P);
  pinned.setZero();
  pinned(0, 0) = 1.0;  // the angle of the line
  pinned(1, 1) = 1.0;  // its offset
  pinned(2, 2) = 1.0;  // x of the point
}

inline void pin(double* const* x) { x[0][0] = x[0][1] = x[1][0] = 0.0; }

inline constexpr mapjoin::Tag kLineTypes[] = {"line", "point"};

constexpr mapjoin::AnchorKind<2> make_line_anchor() {
  mapjoin::AnchorKind<2> kind;
  kind.tag = "line";
  kind.arity = 2;
  kind.types = kLineTypes;
  kind.tangent = 4;
  kind.frame = &frame;
  kind.rows = &rows;
  kind.pin = &pin;
  return kind;
}

}  // namespace detail

inline constexpr mapjoin::AnchorKind<2> kLineAnchor = detail::make_line_anchor();

/// The frame whose x axis is the line, with its origin beside the point.
inline mapjoin::Anchor<2> line_anchor(std::uint64_t line, std::uint64_t point) {
  return {&kLineAnchor, {line_key(line), mapjoin::point_key(point)}};
}

}  // namespace own
