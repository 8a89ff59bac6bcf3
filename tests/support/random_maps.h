// Random maps and graphs with poses and points, in the plane and in space: what properties are
// tested on.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <cstdint>
#include <functional>
#include <numeric>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "mapjoin/frames/anchors.h"
#include "mapjoin/frames/gauge.h"
#include "mapjoin/frames/points_anchor.h"
#include "mapjoin/graph/builtin_types.h"
#include "mapjoin/graph/map.h"
#include "mapjoin/graph/measurement_graph.h"

namespace mapjoin::test {

/// Random numbers from a fixed seed.
class Dice {
 public:
  explicit Dice(std::uint64_t seed) : generator_(seed) {}
  double uniform(double low = 0.0, double high = 1.0) {
    return low + (high - low) * static_cast<double>(generator_() >> 11) * 0x1.0p-53;
  }
  int below(int n) { return static_cast<int>(generator_() % static_cast<std::uint64_t>(n)); }
  double normal() { return normal_(generator_); }
  Eigen::MatrixXd matrix(Eigen::Index rows, Eigen::Index columns) {
    return Eigen::MatrixXd::NullaryExpr(rows, columns, [&] { return normal(); });
  }
  /// Symmetric positive semidefinite of the given rank, eigenvalues around `scale`.
  Eigen::MatrixXd semidefinite(int n, int rank, double scale = 1.0) {
    const Eigen::MatrixXd J = matrix(rank, n);
    return scale * J.transpose() * J;
  }
  Eigen::MatrixXd definite(int n, double scale = 1.0) {
    return semidefinite(n, n, scale) + scale * 0.3 * Eigen::MatrixXd::Identity(n, n);
  }
  std::mt19937_64& generator() { return generator_; }

 private:
  std::mt19937_64 generator_;
  std::normal_distribution<double> normal_;
};

template <int D>
Mat<D, D> random_rotation(Dice& dice, double most = 3.1) {
  if constexpr (D == 2) {
    return Eigen::Rotation2Dd(dice.uniform(-most, most)).toRotationMatrix();
  } else {
    const Eigen::Vector3d axis = Eigen::Vector3d(dice.normal(), dice.normal(), dice.normal());
    return Eigen::AngleAxisd(dice.uniform(-most, most), axis.normalized()).toRotationMatrix();
  }
}
template <int D>
Vec<D> random_point(Dice& dice, double size = 10.0) {
  Vec<D> out;
  for (int k = 0; k < D; ++k) out(k) = dice.uniform(-size, size);
  return out;
}
template <int D>
Rigid<D> random_pose(Dice& dice, double size = 10.0, double turn = 3.1) {
  Rigid<D> out;
  out.R = random_rotation<D>(dice, turn);
  out.t = random_point<D>(dice, size);
  return out;
}

/// x moved by noise of standard deviation sigma.
template <VariableType T>
ValueOf<T> noisy(Dice& dice, const ValueOf<T>& x, double sigma) {
  TangentOf<T> d;
  for (int k = 0; k < T::dim; ++k) d(k) = sigma * dice.normal();
  return T::template retract<double>(x, d);
}
/// Every variable moved by noise.
template <int D>
Values<D> noisy(Dice& dice, Values<D> x, double sigma) {
  std::vector<double> d(static_cast<std::size_t>(x.variables().scalars()));
  for (double& v : d) v = sigma * dice.normal();
  x.retract(d);
  return x;
}

template <int D>
Values<D> random_values(Dice& dice, const std::vector<std::uint64_t>& poses,
                        const std::vector<std::uint64_t>& points) {
  ValuesBuilder<D> builder;
  for (const auto id : poses) builder.template add<PoseType<D>>(pose_key(id), random_pose<D>(dice));
  for (const auto id : points)
    builder.template add<PointType<D>>(point_key(id), random_point<D>(dice));
  return std::move(builder).build();
}

/// 0, 1, ... n-1, from `first` on.
inline std::vector<std::uint64_t> ids(int n, std::uint64_t first = 0) {
  std::vector<std::uint64_t> out(static_cast<std::size_t>(n));
  std::iota(out.begin(), out.end(), first);
  return out;
}

/// The frame of points, by their ids.
inline Anchor<2> two_points(std::uint64_t origin, std::uint64_t on_x) {
  return points_anchor(point_key(origin), point_key(on_x));
}
inline Anchor<3> three_points(std::uint64_t origin, std::uint64_t on_x, std::uint64_t at_y) {
  return points_anchor(point_key(origin), point_key(on_x), point_key(at_y));
}
/// The frame of the first of the given points, two or three of them.
template <int D>
Anchor<D> points_of(const std::vector<std::uint64_t>& points) {
  if constexpr (D == 2) return two_points(points.at(0), points.at(1));
  if constexpr (D == 3) return three_points(points.at(0), points.at(1), points.at(2));
}

/// Random sparse information over all variables, zero where the anchor pins: definite without the
/// pinned rows.
template <int D>
SymmetricBlockMatrix random_anchored_information(Dice& dice, const Values<D>& values,
                                                 const std::vector<int>& pinned,
                                                 double scale = 1.0) {
  const std::vector<int> offsets = values.variables().offsets();
  const int n = values.size();
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(offsets.back(), offsets.back());
  const auto add = [&](int i, int j) {
    const int a = values.variables().dim(i), b = values.variables().dim(j);
    const Eigen::MatrixXd I = dice.definite(a + b, scale);
    const int p = offsets[static_cast<std::size_t>(i)], q = offsets[static_cast<std::size_t>(j)];
    dense.block(p, p, a, a) += I.topLeftCorner(a, a);
    dense.block(q, q, b, b) += I.bottomRightCorner(b, b);
    dense.block(p, q, a, b) += I.topRightCorner(a, b);
    dense.block(q, p, b, a) += I.bottomLeftCorner(b, a);
  };
  for (int i = 0; i + 1 < n; ++i) add(i, i + 1);
  for (int k = 0; k < n / 2; ++k) {
    const int i = dice.below(n);
    const int j = dice.below(n);
    if (i != j) add(i, j);
  }
  for (const int s : pinned) {
    dense.row(s).setZero();
    dense.col(s).setZero();
  }
  return SymmetricBlockMatrix::from_dense(offsets, dense);
}

/// A map in the frame of `anchor` with exact gauge-free information: J^T I J, written densely here.
template <int D>
Map<D> map_of(Dice& dice, Values<D> values, const Anchor<D>& anchor, double scale = 1.0) {
  Map<D> map;
  values.transform(motion_into(anchor, values));
  std::vector<double*> pinned;
  for (const int i : anchor_variables(anchor, values.variables()))
    pinned.push_back(values.value(i));
  anchor.kind->pin(pinned.data());
  map.anchor = anchor;
  map.solved_in = anchor;
  const AnchorRows rows = anchor_rows(anchor, values);
  const SymmetricBlockMatrix I = random_anchored_information(dice, values, rows.pinned, scale);
  const int n = values.variables().scalars();
  Eigen::MatrixXd P = Eigen::MatrixXd::Zero(rows.P.rows(), n);
  for (std::size_t k = 0; k < rows.scalars.size(); ++k)
    P.col(rows.scalars[k]) = rows.P.col(static_cast<Eigen::Index>(k));
  const Eigen::MatrixXd g = values.gauge();
  const Eigen::MatrixXd J = Eigen::MatrixXd::Identity(n, n) - g * (P * g).fullPivLu().solve(P);
  map.information =
      SymmetricBlockMatrix::from_dense(values.variables().offsets(), J.transpose() * I.dense() * J);
  map.values = std::move(values);
  return map;
}

/// A map of these poses and points, in the frame of one of the poses.
template <int D>
Map<D> random_map(Dice& dice, const std::vector<std::uint64_t>& poses,
                  const std::vector<std::uint64_t>& points, std::uint64_t anchor) {
  return map_of(dice, random_values<D>(dice, poses, points), pose_anchor<D>(pose_key(anchor)));
}

/// Some variables of a larger set of values, by key.
template <int D>
Values<D> part_of(const Values<D>& all, const std::vector<std::uint64_t>& poses,
                  const std::vector<std::uint64_t>& points) {
  ValuesBuilder<D> builder;
  for (const auto id : poses)
    builder.template add<PoseType<D>>(pose_key(id), all.pose(pose_key(id)));
  for (const auto id : points)
    builder.template add<PointType<D>>(point_key(id), all.point(point_key(id)));
  return std::move(builder).build();
}

template <int D>
struct RandomGraph {
  MeasurementGraph<D> graph;
  Values<D> truth;
};

struct GraphShape {
  int poses = 20;
  int points = 10;
  int closures = 15;  ///< relative poses besides the chain
  int sightings = 4;  ///< of every point, from different poses where there are enough
  double noise = 0.02;
  bool shuffle = false;  ///< permute ids, and the order of measurements
};

/// Poses along a random walk, each measured from the one before, with loop closures and points.
template <int D>
RandomGraph<D> random_graph(Dice& dice, const GraphShape& shape) {
  std::vector<std::uint64_t> pose_ids = ids(shape.poses), point_ids = ids(shape.points);
  if (shape.shuffle) {
    std::shuffle(pose_ids.begin(), pose_ids.end(), dice.generator());
    std::shuffle(point_ids.begin(), point_ids.end(), dice.generator());
  }
  std::vector<Rigid<D>> pose(1);
  for (int k = 1; k < shape.poses; ++k) {
    Rigid<D> step = random_pose<D>(dice, 0.2, 0.4);
    step.t(0) += 1.0;
    pose.push_back(pose.back() * step);
  }
  std::vector<std::function<void(MeasurementGraphBuilder<D>&)>> adds;
  constexpr int G = kGauge<D>;
  const auto id = [](const auto& list, int k) { return list[static_cast<std::size_t>(k)]; };
  const auto link = [&](int a, int b) {
    const Rigid<D> z = noisy<PoseType<D>>(
        dice, pose[static_cast<std::size_t>(a)].inverse() * pose[static_cast<std::size_t>(b)],
        shape.noise);
    const Mat<G, G> I = dice.definite(G, 100.0);
    adds.push_back([=](auto& builder) {
      builder.template add<PoseType<D>>(pose_key(id(pose_ids, a)), pose_key(id(pose_ids, b)), z, I);
    });
  };
  for (int k = 1; k < shape.poses; ++k) link(k - 1, k);
  for (int k = 0; k < shape.closures; ++k) {
    const int a = dice.below(shape.poses), b = dice.below(shape.poses);
    if (a != b) link(a, b);
  }
  ValuesBuilder<D> truth;
  for (int k = 0; k < shape.poses; ++k)
    truth.template add<PoseType<D>>(pose_key(id(pose_ids, k)), pose[static_cast<std::size_t>(k)]);
  for (int p = 0; p < shape.points; ++p) {
    const int home = dice.below(shape.poses);
    const Vec<D> x = pose[static_cast<std::size_t>(home)] * random_point<D>(dice, 3.0);
    truth.template add<PointType<D>>(point_key(id(point_ids, p)), x);
    for (int s = 0; s < shape.sightings; ++s) {
      const int from = std::clamp(home + s - shape.sightings / 2, 0, shape.poses - 1);
      const Vec<D> z = noisy<PointType<D>>(dice, pose[static_cast<std::size_t>(from)].inverse() * x,
                                           shape.noise);
      const Mat<D, D> I = dice.definite(D, 100.0);
      adds.push_back([=](auto& builder) {
        builder.template add<PointType<D>>(pose_key(id(pose_ids, from)),
                                           point_key(id(point_ids, p)), z, I);
      });
    }
  }
  if (shape.shuffle) std::shuffle(adds.begin(), adds.end(), dice.generator());
  MeasurementGraphBuilder<D> builder;
  for (const auto& add : adds) add(builder);
  return {std::move(builder).build(), std::move(truth).build()};
}

/// A local map of its own terms: values from `all` in the frame of the anchor, with noise, and a
/// dense random information that couples every term with every other.
template <int D>
LocalMap<D> random_local_map(Dice& dice, const Values<D>& all, const Anchor<D>& anchor,
                             const std::vector<Key>& terms, double noise) {
  LocalMap<D> map;
  map.anchor = anchor;
  const Rigid<D> into = motion_into(anchor, all);
  std::vector<int> offsets{0};
  for (const Key& key : terms) {
    if (key.type == Tag("pose")) {
      map.template add_term<PoseType<D>>(key,
                                         noisy<PoseType<D>>(dice, into * all.pose(key), noise));
    } else {
      map.template add_term<PointType<D>>(key,
                                          noisy<PointType<D>>(dice, into * all.point(key), noise));
    }
    offsets.push_back(offsets.back() + map.kinds.back()->dim);
  }
  Eigen::MatrixXd I = dice.definite(offsets.back(), 100.0);
  // Points of the frame: point k keeps its first k coordinates, the others are what they are.
  double* x = map.values.data();
  for (std::size_t k = 0; k < terms.size(); x += map.kinds[k++]->value_size) {
    if (is_pose_anchor(anchor)) break;
    const auto found = std::find(anchor.keys.begin(), anchor.keys.end(), terms[k]);
    for (auto s = found - anchor.keys.begin(); s < D; ++s) {
      x[s] = 0.0;
      I.row(offsets[k] + s).setZero();
      I.col(offsets[k] + s).setZero();
    }
  }
  map.information = SymmetricBlockMatrix::from_dense(offsets, I);
  return map;
}
template <int D>
LocalMap<D> random_local_map(Dice& dice, const Values<D>& all, std::uint64_t anchor,
                             const std::vector<Key>& terms, double noise) {
  return random_local_map(dice, all, pose_anchor<D>(pose_key(anchor)), terms, noise);
}

/// Largest difference of two sets of values of the same variables, in their tangents.
template <int D>
double distance(const Values<D>& a, const Values<D>& b) {
  return a.local(b).cwiseAbs().maxCoeff();
}
template <class A, class B>
double distance(const Eigen::MatrixBase<A>& a, const Eigen::MatrixBase<B>& b) {
  return (a - b).cwiseAbs().maxCoeff();
}
/// Largest difference relative to the largest entry.
inline double relative_distance(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return (a - b).cwiseAbs().maxCoeff() / std::max(1e-300, b.cwiseAbs().maxCoeff());
}

/// What f says when it throws an E; "nothing was thrown" otherwise.
template <class E, class F>
std::string complaint_of(F&& f) {
  try {
    f();
  } catch (const E& error) {
    return error.what();
  }
  return "nothing was thrown";
}

}  // namespace mapjoin::test
