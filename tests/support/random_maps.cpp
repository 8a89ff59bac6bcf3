#include "tests/support/random_maps.h"

#include <Eigen/LU>
#include <functional>

namespace mapjoin::test {

Eigen::MatrixXd Dice::matrix(Eigen::Index rows, Eigen::Index columns) {
  return Eigen::MatrixXd::NullaryExpr(rows, columns, [&] { return normal(); });
}

Eigen::MatrixXd Dice::semidefinite(int n, int rank, double scale) {
  const Eigen::MatrixXd J = matrix(rank, n);
  return scale * J.transpose() * J;
}

Eigen::MatrixXd Dice::definite(int n, double scale) {
  return semidefinite(n, n, scale) + scale * 0.3 * Eigen::MatrixXd::Identity(n, n);
}

template <int D>
Mat<D, D> random_rotation(Dice& dice, double most) {
  if constexpr (D == 2) {
    return Eigen::Rotation2Dd(dice.uniform(-most, most)).toRotationMatrix();
  } else {
    const Eigen::Vector3d axis = Eigen::Vector3d(dice.normal(), dice.normal(), dice.normal());
    return Eigen::AngleAxisd(dice.uniform(-most, most), axis.normalized()).toRotationMatrix();
  }
}

template <int D>
Vec<D> random_point(Dice& dice, double size) {
  Vec<D> out;
  for (int k = 0; k < D; ++k) out(k) = dice.uniform(-size, size);
  return out;
}

template <int D>
Rigid<D> random_pose(Dice& dice, double size, double turn) {
  Rigid<D> out;
  out.R = random_rotation<D>(dice, turn);
  out.t = random_point<D>(dice, size);
  return out;
}

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

template <int D>
SymmetricBlockMatrix random_anchored_information(Dice& dice, const Values<D>& values,
                                                 const std::vector<int>& pinned, double scale) {
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

template <int D>
Map<D> map_of(Dice& dice, Values<D> values, const Anchor<D>& anchor, double scale) {
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

template <int D>
Map<D> random_map(Dice& dice, const std::vector<std::uint64_t>& poses,
                  const std::vector<std::uint64_t>& points, std::uint64_t anchor) {
  return map_of(dice, random_values<D>(dice, poses, points), pose_anchor<D>(pose_key(anchor)));
}

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

template <int D>
double distance(const Values<D>& a, const Values<D>& b) {
  return a.local(b).cwiseAbs().maxCoeff();
}

double distance(const Eigen::Ref<const Eigen::MatrixXd>& a,
                const Eigen::Ref<const Eigen::MatrixXd>& b) {
  return (a - b).cwiseAbs().maxCoeff();
}

double relative_distance(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return (a - b).cwiseAbs().maxCoeff() / std::max(1e-300, b.cwiseAbs().maxCoeff());
}

#define MAPJOIN_INSTANTIATE(D)                                                                   \
  template Mat<D, D> random_rotation<D>(Dice&, double);                                          \
  template Vec<D> random_point<D>(Dice&, double);                                                \
  template Rigid<D> random_pose<D>(Dice&, double, double);                                       \
  template Values<D> noisy<D>(Dice&, Values<D>, double);                                         \
  template Values<D> random_values<D>(Dice&, const std::vector<std::uint64_t>&,                  \
                                      const std::vector<std::uint64_t>&);                        \
  template SymmetricBlockMatrix random_anchored_information<D>(Dice&, const Values<D>&,          \
                                                               const std::vector<int>&, double); \
  template Map<D> map_of<D>(Dice&, Values<D>, const Anchor<D>&, double);                         \
  template Map<D> random_map<D>(Dice&, const std::vector<std::uint64_t>&,                        \
                                const std::vector<std::uint64_t>&, std::uint64_t);               \
  template Values<D> part_of<D>(const Values<D>&, const std::vector<std::uint64_t>&,             \
                                const std::vector<std::uint64_t>&);                              \
  template RandomGraph<D> random_graph<D>(Dice&, const GraphShape&);                             \
  template LocalMap<D> random_local_map<D>(Dice&, const Values<D>&, const Anchor<D>&,            \
                                           const std::vector<Key>&, double);                     \
  template LocalMap<D> random_local_map<D>(Dice&, const Values<D>&, std::uint64_t,               \
                                           const std::vector<Key>&, double);                     \
  template double distance<D>(const Values<D>&, const Values<D>&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin::test
