#include "mapjoin/building/nonlinear.h"

#include <ceres/ceres.h>
#include <fmt/format.h>

#include <Eigen/Dense>
#include <memory>
#include <utility>
#include <vector>

#include "mapjoin/graph/error.h"

namespace mapjoin {

namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// A measurement whitened, U r with U^T U = I, as a function of the increments of its pose and its
/// target.
template <int D>
class IncrementCost : public ceres::CostFunction {
 public:
  IncrementCost(const LocalMeasurement<D>& m, const double* pose, const double* x)
      : m_(m), pose_(pose), x_(x) {
    const int n = m.model->dim;
    set_num_residuals(n);
    mutable_parameter_block_sizes()->push_back(kGauge<D>);
    mutable_parameter_block_sizes()->push_back(m.model->target->dim);
    U_ = Eigen::Map<const Eigen::MatrixXd>(m.info, n, n).llt().matrixU();
  }

  bool Evaluate(double const* const* d, double* r, double** J) const override {
    const int n = num_residuals();
    Eigen::Map<Eigen::VectorXd> residual(r, n);
    if (J == nullptr) {
      m_.model->residual(m_.z, pose_, d[0], x_, d[1], r);
    } else {
      RowMajor Jp(n, kGauge<D>), Jx(n, m_.model->target->dim);
      m_.model->linearize(m_.z, pose_, d[0], x_, d[1], r, Jp.data(), Jx.data());
      if (J[0] != nullptr) Eigen::Map<RowMajor>(J[0], n, Jp.cols()).noalias() = U_ * Jp;
      if (J[1] != nullptr) Eigen::Map<RowMajor>(J[1], n, Jx.cols()).noalias() = U_ * Jx;
    }
    residual = (U_ * residual).eval();
    return residual.allFinite();
  }

 private:
  const LocalMeasurement<D>& m_;
  const double* pose_;
  const double* x_;
  Eigen::MatrixXd U_;
};

class Loss : public ceres::LossFunction {
 public:
  explicit Loss(const RobustLoss& loss) : loss_(loss) {}
  void Evaluate(double s, double out[3]) const override { loss_.evaluate(s, out); }

 private:
  RobustLoss loss_;
};

ceres::Solver::Options solver_options(int scalars, int max_iterations) {
  constexpr int kSmall = 60;
  ceres::Solver::Options options;
  options.linear_solver_type =
      scalars < kSmall ? ceres::DENSE_NORMAL_CHOLESKY : ceres::SPARSE_NORMAL_CHOLESKY;
  options.max_num_iterations = max_iterations;
  options.function_tolerance = 1e-12;
  options.gradient_tolerance = 1e-12;
  options.parameter_tolerance = 1e-13;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  return options;
}

template <int D>
bool fits_exactly(const LocalProblem<D>& problem) {
  int measured = 0;
  for (const auto& m : problem.measurements) measured += m.model->dim;
  return measured == problem.variables.scalars() - kGauge<D>;
}

}  // namespace

template <int D>
SolveSummary minimise(const LocalProblem<D>& problem, const RobustLoss& loss, int max_iterations,
                      Values<D>& values) {
  if (fits_exactly(problem)) return {};
  const std::vector<int> offsets = problem.variables.offsets();
  std::vector<double> d(static_cast<std::size_t>(problem.variables.scalars()), 0.0);
  const auto block = [&](int i) {
    return &d[static_cast<std::size_t>(offsets[static_cast<std::size_t>(i)])];
  };

  const bool robust = loss.shape != RobustLoss::Shape::kNone;
  Loss robust_loss(loss);
  ceres::Problem::Options ownership;
  ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ownership.enable_fast_removal = false;
  ceres::Problem ceres_problem(ownership);
  for (const auto& m : problem.measurements) {
    auto cost = std::make_unique<IncrementCost<D>>(m, values.value(m.from), values.value(m.to));
    ceres_problem.AddResidualBlock(cost.release(),
                                   robust && !problem.is_odometry(m) ? &robust_loss : nullptr,
                                   block(m.from), block(m.to));
  }
  ceres_problem.SetParameterBlockConstant(block(problem.first_pose()));
  ceres::Solver::Summary summary;
  ceres::Solve(solver_options(problem.variables.scalars(), max_iterations), &ceres_problem,
               &summary);
  if (!summary.IsSolutionUsable() || summary.termination_type != ceres::CONVERGENCE) {
    throw Error(
        fmt::format("the local map from {} to {} did not converge: {}. Build shorter local maps",
                    to_string(problem.variables.key(problem.first_pose())),
                    to_string(problem.variables.key(problem.last_pose())), summary.message));
  }
  values.retract(d);
  return {2.0 * summary.final_cost, static_cast<int>(summary.iterations.size()) - 1};
}

template <int D>
SymmetricBlockMatrix information_at(const LocalProblem<D>& problem, const RobustLoss& loss,
                                    const Values<D>& values) {
  std::vector<std::pair<int, int>> pairs;
  for (const auto& m : problem.measurements) pairs.emplace_back(m.from, m.to);
  SymmetricBlockMatrix out(problem.variables.offsets(), pairs);
  Eigen::VectorXd r;
  RowMajor Ja, Jx;
  for (const auto& m : problem.measurements) {
    const int n = m.model->dim;
    r.resize(n);
    Ja.resize(n, kGauge<D>);
    Jx.resize(n, m.model->target->dim);
    m.model->linearize(m.z, values.value(m.from), nullptr, values.value(m.to), nullptr, r.data(),
                       Ja.data(), Jx.data());
    const Eigen::Map<const Eigen::MatrixXd> given(m.info, n, n);
    const Eigen::MatrixXd info = problem.weight(m, loss, r.dot(given * r)) * given;
    const Eigen::MatrixXd IJa = info * Ja;
    const Eigen::MatrixXd IJx = info * Jx;
    out.add(m.from, m.from, Ja.transpose() * IJa);
    out.add(m.to, m.to, Jx.transpose() * IJx);
    out.add(m.to, m.from, Jx.transpose() * IJa);
  }
  return out;
}

#define MAPJOIN_INSTANTIATE(D)                                                                   \
  template SolveSummary minimise<D>(const LocalProblem<D>&, const RobustLoss&, int, Values<D>&); \
  template SymmetricBlockMatrix information_at<D>(const LocalProblem<D>&, const RobustLoss&,     \
                                                  const Values<D>&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
