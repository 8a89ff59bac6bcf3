// Sequences of local maps as filters take them: each begins where the one before it ends, and holds
// its end pose and the features around.
#pragma once

#include <vector>

#include "tests/support/random_maps.h"

namespace mapjoin::test {

template <int D>
struct Chain {
  Values<D> truth;  ///< in the frame of pose 0
  std::vector<LocalMap<D>> maps;
};

struct ChainShape {
  int maps = 12;
  int features = 40;
  double range = 6.0;   ///< metres around the start pose within which features are in a local map
  double noise = 0.01;  ///< standard deviation of what is measured
  double turn = 0.4;    ///< radians between start and end pose, at most
};

/// A walk that turns back every six local maps, so that features are seen again.
template <int D>
Chain<D> random_chain(std::uint64_t seed, const ChainShape& shape = {}) {
  Dice dice(seed);
  ValuesBuilder<D> builder;
  std::vector<Rigid<D>> pose(1);
  builder.template add<PoseType<D>>(pose_key(0), pose[0]);
  for (int k = 1; k <= shape.maps; ++k) {
    Rigid<D> step = random_pose<D>(dice, 0.3, shape.turn);
    step.t(0) += k % 6 == 0 ? -2.0 : 2.0;
    pose.push_back(pose.back() * step);
    builder.template add<PoseType<D>>(pose_key(static_cast<std::uint64_t>(k)), pose.back());
  }
  std::vector<Vec<D>> feature;
  for (int i = 0; i < shape.features; ++i) {
    const auto home = static_cast<std::size_t>(i % (shape.maps + 1));
    feature.push_back(pose[home] * random_point<D>(dice, 3.0));
    builder.template add<PointType<D>>(point_key(static_cast<std::uint64_t>(i)), feature.back());
  }
  Chain<D> out{std::move(builder).build(), {}};
  for (int k = 0; k < shape.maps; ++k) {
    std::vector<Key> terms{pose_key(static_cast<std::uint64_t>(k + 1))};
    for (int i = 0; i < shape.features; ++i) {
      const Vec<D> away =
          feature[static_cast<std::size_t>(i)] - pose[static_cast<std::size_t>(k)].t;
      if (away.norm() < shape.range) terms.push_back(point_key(static_cast<std::uint64_t>(i)));
    }
    out.maps.push_back(
        random_local_map<D>(dice, out.truth, static_cast<std::uint64_t>(k), terms, shape.noise));
  }
  return out;
}

/// Largest difference of two sets of values over the variables that both have.
template <int D>
double common_distance(const Values<D>& a, const Values<D>& b) {
  double out = 0.0;
  const std::vector<int> in_b = numbers_in(a.variables(), b.variables());
  for (int i = 0; i < a.size(); ++i) {
    const int j = in_b[static_cast<std::size_t>(i)];
    if (j < 0) continue;
    const VariableKind<D>& kind = a.variables().kind(i);
    Eigen::VectorXd d(kind.dim);
    kind.local(a.value(i), b.value(j), 1, d.data());
    out = std::max(out, d.cwiseAbs().maxCoeff());
  }
  return out;
}

template <int D>
std::vector<Key> keys_of(const Values<D>& values) {
  std::vector<Key> out;
  for (int i = 0; i < values.size(); ++i) out.push_back(values.variables().key(i));
  return out;
}

}  // namespace mapjoin::test
