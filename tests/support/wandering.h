// A robot that wanders among points and builds local maps: each in the frame of its start pose,
// with its end pose and the points near its path, with noise that is just what the information
// says.
#pragma once

#include <Eigen/Cholesky>
#include <cmath>
#include <vector>

#include "tests/support/dense.h"
#include "tests/support/random_maps.h"

namespace mapjoin::test {

struct Walk {
  int maps = 12;
  int points = 0;             ///< in the whole world; 0: 250 in the plane, 500 in space
  double size = 30.0;         ///< the world is a box from -size to size [m], in 3D 10 m high
  double step = 8.0;          ///< length of a local map's path [m]
  double range = 8.0;         ///< within which points are seen [m]
  double sigma = 0.05;        ///< of points and of the end pose's position [m]
  double sigma_turn = 0.005;  ///< of the end pose's orientation [rad]
};

template <int D>
struct Wandering {
  std::vector<LocalMap<D>> maps;  ///< points under their true numbers
  Values<D> truth;                ///< in the frame of pose 0
};

template <int D>
Wandering<D> wander(Dice& dice, const Walk& walk) {
  Wandering<D> out;
  ValuesBuilder<D> truth;
  std::vector<Vec<D>> points;
  const int count = walk.points > 0 ? walk.points : D == 2 ? 250 : 500;
  for (int k = 0; k < count; ++k) {
    Vec<D> p = random_point<D>(dice, walk.size);
    if constexpr (D == 3) p(2) *= 5.0 / walk.size;
    points.push_back(p);
    truth.template add<PointType<D>>(point_key(static_cast<std::uint64_t>(k) + 1), p);
  }
  std::vector<Rigid<D>> poses(1);
  truth.template add<PoseType<D>>(pose_key(0), poses[0]);
  for (int m = 0; m < walk.maps; ++m) {
    // Round and round: the path closes after about nine local maps.
    Rigid<D> step;
    step.t(0) = walk.step;
    const double turn = 0.7 + dice.uniform(-0.2, 0.2);
    step.R.template topLeftCorner<2, 2>() << std::cos(turn), -std::sin(turn), std::sin(turn),
        std::cos(turn);
    const Rigid<D> start = poses.back();
    poses.push_back(start * step);
    const auto end_id = static_cast<std::uint64_t>(m) + 1;
    truth.template add<PoseType<D>>(pose_key(end_id), poses.back());

    LocalMap<D> map;
    map.anchor = pose_anchor<D>(pose_key(end_id - 1));
    map.template add_term<PoseType<D>>(pose_key(end_id), step);
    std::vector<int> offsets{0, kGauge<D>};
    std::vector<double> sigmas(static_cast<std::size_t>(kGauge<D>), walk.sigma_turn);
    for (int k = 0; k < D; ++k) sigmas[static_cast<std::size_t>(k)] = walk.sigma;
    for (std::size_t k = 0; k < points.size(); ++k) {
      const Vec<D> seen = start.inverse() * points[k];
      const Vec<D> middle = 0.5 * step.t;
      if ((seen - middle).norm() > walk.range) continue;
      map.template add_term<PointType<D>>(point_key(k + 1), seen);
      offsets.push_back(offsets.back() + D);
      sigmas.insert(sigmas.end(), static_cast<std::size_t>(D), walk.sigma);
    }
    // Sigma L with a random lower L: correlated, of about these sizes.
    const int n = offsets.back();
    Eigen::MatrixXd L = 0.3 / std::sqrt(n) * dice.matrix(n, n);
    L.diagonal().array() += 1.0;
    const Eigen::MatrixXd root =
        Eigen::Map<const Eigen::VectorXd>(sigmas.data(), n).asDiagonal() * L;
    const Eigen::VectorXd noise = root * dice.matrix(n, 1);
    double* x = map.values.data();
    for (std::size_t i = 0; i < map.kinds.size(); x += map.kinds[i++]->value_size)
      map.kinds[i]->retract(x, noise.data() + offsets[i], 1);
    const Eigen::MatrixXd covariance = root * root.transpose();
    const Eigen::MatrixXd information = dense_inverse(covariance);
    map.information =
        SymmetricBlockMatrix::from_dense(offsets, 0.5 * (information + information.transpose()));
    out.maps.push_back(std::move(map));
  }
  out.truth = std::move(truth).build();
  return out;
}

}  // namespace mapjoin::test
