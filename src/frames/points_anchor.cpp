#include "mapjoin/frames/points_anchor.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include "mapjoin/graph/builtin_types.h"

namespace mapjoin {

namespace {

constexpr Tag kPointTags[] = {Tag("point"), Tag("point"), Tag("point")};

/// Distances below this part of the largest coordinate drown in rounding errors.
constexpr double kDistinct = 1e-9;

template <int D>
const Vec<D>& point(const double* x) {
  return *reinterpret_cast<const Vec<D>*>(x);
}

/// The points of an anchor and the axes they span: x along F_X - F_O, y (in space) towards F_Y.
template <int D>
struct Triangle {
  double distance = 0.0;
  double along = 0.0;  ///< x coordinate of F_Y
  double height = 0.0;
  Vec<D> x = Vec<D>::Zero();
  Vec<D> y = Vec<D>::Zero();
};

[[noreturn]] void throw_coincident(const Key* keys, double distance, double size) {
  throw DegenerateFrameError(fmt::format(
      "{} and {} do not fix a frame: they are {:.3g} apart, with coordinates up to {:.3g}, and so "
      "at "
      "the same place but for rounding; choose points that are farther apart, or a pose",
      to_string(keys[0]), to_string(keys[1]), distance, size));
}

[[noreturn]] void throw_collinear(const Key* keys, double height, double sine, double size) {
  throw DegenerateFrameError(fmt::format(
      "{}, {} and {} do not fix a frame: the third is {:.3g} beside the line through the others "
      "(sine of the angle {:.3g}, coordinates up to {:.3g}), and so on it but for rounding; choose "
      "points that are not on one line, or a pose",
      to_string(keys[0]), to_string(keys[1]), to_string(keys[2]), height, sine, size));
}

template <int D>
double size_of(const Vec<D>* points) {
  double size = 0.0;
  for (int k = 0; k < D; ++k) size = std::max(size, points[k].cwiseAbs().maxCoeff());
  return size;
}

/// Lengths that drown in rounding errors are left zero, and so are the axes along them.
template <int D>
Triangle<D> triangle(const Vec<D>* points) {
  const double size = size_of(points);
  Triangle<D> out;
  const Vec<D> to_x = points[1] - points[0];
  out.distance = to_x.norm();
  if (!(out.distance > kDistinct * size)) return out;
  out.x = to_x / out.distance;
  if constexpr (D == 3) {
    const Vec<3> to_y = points[2] - points[0];
    out.along = out.x.dot(to_y);
    Vec<3> beside = to_y - out.along * out.x;
    out.height = beside.norm();
    if (!(out.height > kDistinct * size)) return out;
    beside /= out.height;
    beside -= out.x.dot(beside) * out.x;  // again: of a small height little is left orthogonal
    out.y = beside.normalized();
  }
  return out;
}

/// The same of what an anchor names. \throws DegenerateFrameError.
template <int D>
Triangle<D> triangle(const double* const* values, const Key* keys) {
  std::array<Vec<D>, D> points;
  for (int k = 0; k < D; ++k) points[static_cast<std::size_t>(k)] = point<D>(values[k]);
  const Triangle<D> out = triangle<D>(points.data());
  const double size = size_of<D>(points.data());
  if (out.x.isZero(0.0)) throw_coincident(keys, out.distance, size);
  if constexpr (D == 3) {
    if (out.y.isZero(0.0)) {
      const double reach = (points[2] - points[0]).norm();
      throw_collinear(keys, out.height, reach > 0.0 ? out.height / reach : 0.0, size);
    }
  }
  return out;
}

template <int D>
Rigid<D> points_frame(const double* const* values, const Key* keys) {
  const Triangle<D> axes = triangle<D>(values, keys);
  Rigid<D> into;
  into.R.row(0) = axes.x.transpose();
  if constexpr (D == 2) {
    into.R.row(1) << -axes.x(1), axes.x(0);
  } else {
    into.R.row(1) = axes.y.transpose();
    into.R.row(2) = axes.x.cross(axes.y).transpose();
  }
  into.t = -(into.R * point<D>(values[0]));
  return into;
}

/// Point k keeps its first k coordinates; the others are pinned.
template <int D>
void points_rows(const double* const*, double* P) {
  Eigen::Map<Eigen::Matrix<double, kGauge<D>, D * D>> rows(P);
  rows.setZero();
  int row = 0;
  for (int k = 0; k < D; ++k) {
    for (int s = k; s < D; ++s) rows(row++, k * D + s) = 1.0;
  }
}

template <int D>
void pin_points(double* const* values) {
  for (int k = 0; k < D; ++k) std::fill(values[k] + k, values[k] + D, 0.0);
}

template <int D>
constexpr AnchorKind<D> make_points_anchor() {
  AnchorKind<D> kind;
  kind.tag = Tag("points");
  kind.arity = D;
  kind.types = kPointTags;
  kind.tangent = D * D;
  kind.frame = &points_frame<D>;
  kind.rows = &points_rows<D>;
  kind.pin = &pin_points<D>;
  return kind;
}
template <int D>
constexpr AnchorKind<D> kPointsAnchor = make_points_anchor<D>();

/// The point of largest `score`, the first of equals.
template <int D, class Score>
std::size_t farthest(std::span<const Vec<D>> points, Score&& score) {
  std::size_t best = 0;
  double most = -1.0;
  for (std::size_t k = 0; k < points.size(); ++k) {
    const double s = score(points[k]);
    if (s > most) {
      most = s;
      best = k;
    }
  }
  return best;
}

}  // namespace

template <int D>
const AnchorKind<D>& points_anchor_kind() {
  return kPointsAnchor<D>;
}

Anchor<2> points_anchor(const Key& origin, const Key& on_x) {
  return {&kPointsAnchor<2>, {origin, on_x}};
}
Anchor<3> points_anchor(const Key& origin, const Key& on_x, const Key& at_y) {
  return {&kPointsAnchor<3>, {origin, on_x, at_y}};
}

template <int D>
std::optional<Anchor<D>> farthest_points(const Values<D>& values) {
  const std::span<const Vec<D>> points = values.template column<PointType<D>>();
  if (points.size() < static_cast<std::size_t>(D)) return std::nullopt;
  Vec<D> centroid = Vec<D>::Zero();
  for (const Vec<D>& p : points) centroid += p / static_cast<double>(points.size());
  std::size_t x = farthest<D>(points, [&](const Vec<D>& p) { return (p - centroid).norm(); });
  std::size_t o = farthest<D>(points, [&](const Vec<D>& p) { return (p - points[x]).norm(); });
  if (x < o) std::swap(x, o);
  std::vector<std::size_t> chosen{o, x};
  if constexpr (D == 3) {
    const Vec<3> line = (points[x] - points[o]).normalized();
    chosen.push_back(farthest<3>(points, [&](const Vec<3>& p) {
      const Vec<3> beside = p - points[o];
      return line.cross(beside).norm();
    }));
  }
  const auto& keys = values.variables().column(values.variables().find_column(Tag("point"))).keys;
  Anchor<D> anchor{&kPointsAnchor<D>, {}};
  for (const std::size_t k : chosen) anchor.keys.push_back(keys[k]);
  try {
    motion_into(anchor, values);
  } catch (const Error&) {  // coincident, collinear, or one point twice
    return std::nullopt;
  }
  return anchor;
}

template <int D>
PointsCertainty certainty(const Anchor<D>& anchor, const Values<D>& values,
                          const Eigen::MatrixXd& covariance) {
  if (anchor.kind == nullptr || anchor.kind->tag != kPointsAnchor<D>.tag) {
    throw InputError(to_string(anchor) + " is no anchor of points: only those have a distance");
  }
  if (covariance.rows() != D * D || covariance.cols() != D * D) {
    throw InputError(
        fmt::format("the covariance of {} has to be {} x {}: the points' coordinates, "
                    "stacked; it is {} x {}",
                    to_string(anchor), D * D, D * D, covariance.rows(), covariance.cols()));
  }
  std::vector<Vec<D>> points;
  std::vector<const double*> pointers;
  for (const int i : anchor_variables(anchor, values.variables())) {
    pointers.push_back(values.value(i));
    points.push_back(point<D>(pointers.back()));
  }
  triangle<D>(pointers.data(), anchor.keys.data());  // says what is degenerate
  return certainty<D>(points.data(), covariance);
}

template <int D>
PointsCertainty certainty(const Vec<D>* points, const Eigen::MatrixXd& covariance) {
  const Triangle<D> axes = triangle<D>(points);
  PointsCertainty out;
  if (axes.x.isZero(0.0)) return out;
  const auto sigma = [&](const Mat<D * D, 1>& slope) {
    return std::sqrt(std::max(0.0, slope.dot(covariance * slope)));
  };
  out.distance = axes.distance;
  Mat<D * D, 1> slope = Mat<D * D, 1>::Zero();
  slope.template segment<D>(0) = -axes.x;
  slope.template segment<D>(D) = axes.x;
  out.distance_sigma = sigma(slope);
  if constexpr (D == 3) {
    if (axes.y.isZero(0.0)) return out;
    const double part = axes.along / axes.distance;  // how much of F_X's motion F_Y's foot follows
    out.height = axes.height;
    slope.template segment<3>(0) = -(1.0 - part) * axes.y;
    slope.template segment<3>(3) = -part * axes.y;
    slope.template segment<3>(6) = axes.y;
    out.height_sigma = sigma(slope);
  }
  return out;
}

template <int D>
void expect_distinct(const Anchor<D>& anchor, const Values<D>& values,
                     const Eigen::MatrixXd& covariance) {
  const PointsCertainty known = certainty(anchor, values, covariance);
  if (!(known.distance > kDistinctSigmas * known.distance_sigma)) {
    throw DegenerateFrameError(fmt::format(
        "{} does not fix a frame within what the map can tell: {} and {} are {:.3g} apart with a "
        "standard deviation of {:.3g}; choose points that are farther apart, or a pose",
        to_string(anchor), to_string(anchor.keys[0]), to_string(anchor.keys[1]), known.distance,
        known.distance_sigma));
  }
  if (D == 3 && !(known.height > kDistinctSigmas * known.height_sigma)) {
    throw DegenerateFrameError(fmt::format(
        "{} does not fix a frame within what the map can tell: {} is {:.3g} beside the line "
        "through "
        "the others with a standard deviation of {:.3g}; choose points that are not on one line, "
        "or "
        "a pose",
        to_string(anchor), to_string(anchor.keys.back()), known.height, known.height_sigma));
  }
}

#define MAPJOIN_INSTANTIATE(D)                                                  \
  template const AnchorKind<D>& points_anchor_kind<D>();                        \
  template std::optional<Anchor<D>> farthest_points<D>(const Values<D>&);       \
  template PointsCertainty certainty<D>(const Vec<D>*, const Eigen::MatrixXd&); \
  template PointsCertainty certainty<D>(const Anchor<D>&, const Values<D>&,     \
                                        const Eigen::MatrixXd&);                \
  template void expect_distinct<D>(const Anchor<D>&, const Values<D>&, const Eigen::MatrixXd&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
