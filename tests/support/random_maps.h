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
  Eigen::MatrixXd matrix(Eigen::Index rows, Eigen::Index columns);
  /// Symmetric positive semidefinite of the given rank, eigenvalues around `scale`.
  Eigen::MatrixXd semidefinite(int n, int rank, double scale = 1.0);
  Eigen::MatrixXd definite(int n, double scale = 1.0);
  std::mt19937_64& generator() { return generator_; }

 private:
  std::mt19937_64 generator_;
  std::normal_distribution<double> normal_;
};

template <int D>
Mat<D, D> random_rotation(Dice& dice, double most = 3.1);
template <int D>
Vec<D> random_point(Dice& dice, double size = 10.0);
template <int D>
Rigid<D> random_pose(Dice& dice, double size = 10.0, double turn = 3.1);

/// x moved by noise of standard deviation sigma.
template <VariableType T>
ValueOf<T> noisy(Dice& dice, const ValueOf<T>& x, double sigma) {
  TangentOf<T> d;
  for (int k = 0; k < T::dim; ++k) d(k) = sigma * dice.normal();
  return T::template retract<double>(x, d);
}
/// Every variable moved by noise.
template <int D>
Values<D> noisy(Dice& dice, Values<D> x, double sigma);

template <int D>
Values<D> random_values(Dice& dice, const std::vector<std::uint64_t>& poses,
                        const std::vector<std::uint64_t>& points);

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
                                                 double scale = 1.0);

/// A map in the frame of `anchor` with exact gauge-free information: J^T I J, written densely here.
template <int D>
Map<D> map_of(Dice& dice, Values<D> values, const Anchor<D>& anchor, double scale = 1.0);

/// A map of these poses and points, in the frame of one of the poses.
template <int D>
Map<D> random_map(Dice& dice, const std::vector<std::uint64_t>& poses,
                  const std::vector<std::uint64_t>& points, std::uint64_t anchor);

/// Some variables of a larger set of values, by key.
template <int D>
Values<D> part_of(const Values<D>& all, const std::vector<std::uint64_t>& poses,
                  const std::vector<std::uint64_t>& points);

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
RandomGraph<D> random_graph(Dice& dice, const GraphShape& shape);

/// A local map of its own terms: values from `all` in the frame of the anchor, with noise, and a
/// dense random information that couples every term with every other.
template <int D>
LocalMap<D> random_local_map(Dice& dice, const Values<D>& all, const Anchor<D>& anchor,
                             const std::vector<Key>& terms, double noise);
template <int D>
LocalMap<D> random_local_map(Dice& dice, const Values<D>& all, std::uint64_t anchor,
                             const std::vector<Key>& terms, double noise);

/// Largest difference of two sets of values of the same variables, in their tangents.
template <int D>
double distance(const Values<D>& a, const Values<D>& b);
double distance(const Eigen::Ref<const Eigen::MatrixXd>& a,
                const Eigen::Ref<const Eigen::MatrixXd>& b);
/// Largest difference relative to the largest entry.
double relative_distance(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);

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
