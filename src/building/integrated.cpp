#include "mapjoin/building/integrated.h"

#include <Eigen/Dense>
#include <algorithm>
#include <utility>
#include <vector>

namespace mapjoin {

namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// A measurement by the pair of variables it is of, the lower number first.
struct Pair {
  int a, b;
  std::size_t measurement;
  bool operator<(const Pair& o) const {
    return std::pair(std::pair(a, b), measurement) < std::pair(std::pair(o.a, o.b), o.measurement);
  }
};

/// Adds J^T I J of a measurement over (pair.a, pair.b).
template <int D>
void add(const LocalProblem<D>& problem, const LocalMeasurement<D>& m, bool turned,
         const RobustLoss& loss, const Values<D>& values, Eigen::MatrixXd& sum) {
  const int n = m.model->dim;
  Eigen::VectorXd r(n);
  RowMajor Ja(n, kGauge<D>), Jx(n, m.model->target->dim);
  m.model->linearize(m.z, values.value(m.from), nullptr, values.value(m.to), nullptr, r.data(),
                     Ja.data(), Jx.data());
  const Eigen::Map<const Eigen::MatrixXd> I(m.info, n, n);
  Eigen::MatrixXd J(n, Ja.cols() + Jx.cols());
  if (turned) {
    J << Jx, Ja;
  } else {
    J << Ja, Jx;
  }
  sum += problem.weight(m, loss, r.dot(I * r)) * (J.transpose() * I * J);
}

}  // namespace

template <int D>
std::shared_ptr<const MeasurementGraph<D>> integrated_observations(const LocalProblem<D>& problem,
                                                                   const RobustLoss& loss,
                                                                   const Map<D>& map) {
  std::vector<Pair> pairs;
  for (std::size_t k = 0; k < problem.measurements.size(); ++k) {
    const auto& m = problem.measurements[k];
    pairs.push_back({std::min(m.from, m.to), std::max(m.from, m.to), k});
  }
  std::sort(pairs.begin(), pairs.end());
  const VariableSet<D>& variables = map.variables();
  const int anchor = variables.require(map.anchor.keys[0], "anchor");

  MeasurementGraphBuilder<D> builder;
  for (std::size_t first = 0; first < pairs.size();) {
    const int ends[2] = {pairs[first].a, pairs[first].b};
    const int dims[2] = {variables.dim(ends[0]), variables.dim(ends[1])};
    Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(dims[0] + dims[1], dims[0] + dims[1]);
    std::size_t next = first;
    for (; next < pairs.size() && pairs[next].a == ends[0] && pairs[next].b == ends[1]; ++next) {
      const auto& m = problem.measurements[pairs[next].measurement];
      add(problem, m, m.from != ends[0], loss, map.values, sum);
    }
    first = next;
    LocalMap<D> part;  // rows and columns of the anchor, which is pinned whole, are left out
    part.anchor = map.anchor;
    std::vector<int> offsets{0};
    for (const int i : ends) {
      if (i == anchor) continue;
      const VariableKind<D>& kind = variables.kind(i);
      part.kinds.push_back(&kind);
      part.keys.push_back(variables.key(i));
      part.values.insert(part.values.end(), map.values.value(i),
                         map.values.value(i) + kind.value_size);
      offsets.push_back(offsets.back() + kind.dim);
    }
    const int start = ends[0] == anchor ? dims[0] : 0;
    part.information = SymmetricBlockMatrix::from_dense(
        offsets, sum.block(start, start, offsets.back(), offsets.back()));
    builder.add(part);
  }
  return std::make_shared<const MeasurementGraph<D>>(std::move(builder).build());
}

template std::shared_ptr<const MeasurementGraph<2>> integrated_observations<2>(
    const LocalProblem<2>&, const RobustLoss&, const Map<2>&);
template std::shared_ptr<const MeasurementGraph<3>> integrated_observations<3>(
    const LocalProblem<3>&, const RobustLoss&, const Map<3>&);

}  // namespace mapjoin
