#include "mapjoin/solvers/relative.h"

#include <fmt/format.h>

#include <cmath>

#include "mapjoin/frames/anchors.h"
#include "mapjoin/graph/dense.h"

namespace mapjoin {

namespace {

constexpr double kStep = 1e-5;  // of central differences, for types of users
constexpr Tag kPose("pose");
constexpr Tag kPoint("point");

template <int D>
Vec<D> position_of(const VariableKind<D>& kind, const double* value) {
  Vec<D> out;
  const int first = 0;
  kind.positions(value, &first, 1, out.data());
  return out;
}

/// Covariance of `a` (its scalars first) and `b` together.
template <int D>
Eigen::MatrixXd joint(const Covariance<D>& covariance, const Key& a, const Key& b) {
  const Key keys[] = {a, b};
  return covariance.of(keys);
}

}  // namespace

template <int D>
Relative relative(const Map<D>& map, const Covariance<D>& covariance, const Key& from,
                  const Key& to) {
  constexpr int G = kGauge<D>;
  if (from.type != kPose)
    throw InputError(
        fmt::format("relative to {}: only a pose has a frame to look from", to_string(from)));
  const VariableSet<D>& variables = map.variables();
  variables.require(from, "relative");
  const int i = variables.require(to, "relative");
  const VariableKind<D>& kind = variables.kind(i);
  const double* const x = map.values.value(i);
  const Rigid<D> into = motion_into(map.values.pose(from));

  Relative out;
  out.value.assign(x, x + kind.value_size);
  Eigen::MatrixXd J(kind.dim, G + kind.dim);
  Eigen::MatrixXd block(kind.dim, kind.dim), g(kind.dim, G);
  kind.frame_jacobian(into, x, 1, block.data());
  kind.transform(into, out.value.data(), 1);
  kind.gauge(out.value.data(), 1, g.data());
  J << -g, block;
  out.covariance = symmetric_part(carried(J, joint(covariance, from, to)));
  return out;
}

template <int D>
Eigen::MatrixXd position_jacobian(const Values<D>& values, int variable) {
  const VariableKind<D>& kind = values.variables().kind(variable);
  if (!kind.has_position)
    throw InputError(fmt::format("{} has no position: its type does not define one",
                                 to_string(values.variables().key(variable))));
  const double* const x = values.value(variable);
  Eigen::MatrixXd J = Eigen::MatrixXd::Zero(D, kind.dim);
  if (kind.tag == kPoint) {
    J.setIdentity();
  } else if (kind.tag == kPose) {
    J.template leftCols<D>() = reinterpret_cast<const Rigid<D>*>(x)->R;
  } else {
    std::vector<double> moved;
    Eigen::VectorXd d = Eigen::VectorXd::Zero(kind.dim);
    for (int k = 0; k < kind.dim; ++k) {
      for (const double step : {kStep, -kStep}) {
        moved.assign(x, x + kind.value_size);
        d(k) = step;
        kind.retract(moved.data(), d.data(), 1);
        J.col(k) += position_of(kind, moved.data()) / (2.0 * step);
      }
      d(k) = 0.0;
    }
  }
  return J;
}

template <int D>
Mat<D, D> position_covariance(const Values<D>& values, int variable,
                              const Eigen::Ref<const Eigen::MatrixXd>& block) {
  return carried(position_jacobian(values, variable), block);
}

template <int D>
Distance distance(const Map<D>& map, const Covariance<D>& covariance, const Key& a, const Key& b) {
  const int i = map.variables().require(a, "distance");
  const int j = map.variables().require(b, "distance");
  const Eigen::MatrixXd Ji = position_jacobian(map.values, i),
                        Jj = position_jacobian(map.values, j);
  const Vec<D> between = position_of(map.variables().kind(j), map.values.value(j)) -
                         position_of(map.variables().kind(i), map.values.value(i));
  Distance out;
  out.value = between.norm();
  if (!(out.value > 0.0))
    throw InputError(
        fmt::format("{} and {} are at the same place, where a distance has no "
                    "derivative; ask for their relative position",
                    to_string(a), to_string(b)));
  Eigen::VectorXd row(Ji.cols() + Jj.cols());
  row << -(Ji.transpose() * between), Jj.transpose() * between;
  row /= out.value;
  out.deviation = std::sqrt(std::max(0.0, row.dot(joint(covariance, a, b) * row)));
  return out;
}

#define MAPJOIN_INSTANTIATE(D)                                                                \
  template Relative relative<D>(const Map<D>&, const Covariance<D>&, const Key&, const Key&); \
  template Eigen::MatrixXd position_jacobian<D>(const Values<D>&, int);                       \
  template Mat<D, D> position_covariance<D>(const Values<D>&, int,                            \
                                            const Eigen::Ref<const Eigen::MatrixXd>&);        \
  template Distance distance<D>(const Map<D>&, const Covariance<D>&, const Key&, const Key&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
