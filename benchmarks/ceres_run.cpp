#include "benchmarks/ceres_run.h"

#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <array>
#include <numbers>

#include "benchmarks/spanning_tree.h"

namespace mapjoin::benchmarks {

namespace {

/// x, y, heading; or x, y, z and the quaternion x, y, z, w.
template <int D>
inline constexpr int kPoseSize = D == 2 ? 3 : 7;

template <int D>
std::array<double, kPoseSize<D>> parameters(const Rigid<D>& pose) {
  if constexpr (D == 2) {
    return {pose.t(0), pose.t(1), heading(pose)};
  } else {
    const Eigen::Quaterniond q(Eigen::Matrix3d(pose.R));
    return {pose.t(0), pose.t(1), pose.t(2), q.x(), q.y(), q.z(), q.w()};
  }
}

/// U with U^T U = information.
template <int N>
Eigen::Matrix<double, N, N> root_of(const double* information) {
  using Matrix = Eigen::Matrix<double, N, N>;
  const Matrix I = Eigen::Map<const Matrix>(information);
  const Eigen::LLT<Matrix> llt(I);
  if (llt.info() == Eigen::Success) return llt.matrixU();
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(I);
  return eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal() *
         eigen.eigenvectors().transpose();
}

template <class T>
T wrapped(const T& angle) {
  using std::floor;
  constexpr double kHalf = std::numbers::pi;
  return angle - 2.0 * kHalf * floor((angle + kHalf) / (2.0 * kHalf));
}

template <int D, class T>
Eigen::Matrix<T, D, D> rotation_of(const T* pose) {
  if constexpr (D == 2) {
    using std::cos;
    using std::sin;
    const T c = cos(pose[2]), s = sin(pose[2]);
    Eigen::Matrix<T, 2, 2> R;
    R << c, -s, s, c;
    return R;
  } else {
    return Eigen::Map<const Eigen::Quaternion<T>>(pose + 3).toRotationMatrix();
  }
}

/// R_a^T (t - t_a): a position as it is seen from a pose.
template <int D, class T>
Eigen::Matrix<T, D, 1> seen_from(const T* pose, const T* position) {
  using Vector = Eigen::Matrix<T, D, 1>;
  const Vector step = Eigen::Map<const Vector>(position) - Eigen::Map<const Vector>(pose);
  return rotation_of<D>(pose).transpose() * step;
}

/// M v without making M's constants numbers with derivatives first.
template <int N, class T>
Eigen::Matrix<T, N, 1> times(const Eigen::Matrix<double, N, N>& M,
                             const Eigen::Matrix<T, N, 1>& v) {
  Eigen::Matrix<T, N, 1> out;
  for (int i = 0; i < N; ++i) {
    out(i) = M(i, 0) * v(0);
    for (int j = 1; j < N; ++j) out(i) += M(i, j) * v(j);
  }
  return out;
}

/// U (R_z^T (t - t_z), rotation vector of R_z^T R) of a measured relative pose.
template <int D>
struct PoseResidual {
  static constexpr int N = kGauge<D>;
  std::array<double, kPoseSize<D>> z;
  Eigen::Matrix<double, D, D> turn;  // R_z^T
  Eigen::Matrix<double, N, N> root;

  PoseResidual(const Rigid<D>& measured, const double* information)
      : z(parameters(measured)), turn(measured.R.transpose()), root(root_of<N>(information)) {}

  template <class T>
  bool operator()(const T* a, const T* b, T* out) const {
    Eigen::Matrix<T, N, 1> r;
    Eigen::Matrix<T, D, 1> seen = seen_from<D>(a, b);
    for (int k = 0; k < D; ++k) seen(k) -= z[static_cast<std::size_t>(k)];
    r.template head<D>() = times(turn, seen);
    if constexpr (D == 2) {
      r(2) = wrapped(T(b[2] - a[2] - z[2]));
    } else {
      using Quaternion = Eigen::Quaternion<T>;
      const Quaternion measured{T(z[6]), T(z[3]), T(z[4]), T(z[5])};
      const Quaternion q = measured.conjugate() * (Eigen::Map<const Quaternion>(a + 3).conjugate() *
                                                   Eigen::Map<const Quaternion>(b + 3));
      const std::array<T, 4> wxyz = {q.w(), q.x(), q.y(), q.z()};
      ceres::QuaternionToAngleAxis(wxyz.data(), r.data() + 3);
    }
    Eigen::Map<Eigen::Matrix<T, N, 1>> result(out);
    result = times(root, r);
    return true;
  }
};

template <int D>
struct PointResidual {
  Eigen::Matrix<double, D, 1> z;
  Eigen::Matrix<double, D, D> root;

  template <class T>
  bool operator()(const T* pose, const T* point, T* out) const {
    Eigen::Map<Eigen::Matrix<T, D, 1>> result(out);
    Eigen::Matrix<T, D, 1> seen = seen_from<D>(pose, point);
    for (int k = 0; k < D; ++k) seen(k) -= z(k);
    result = times(root, seen);
    return true;
  }
};

/// Stops as soon as the cost is low enough.
class Enough : public ceres::IterationCallback {
 public:
  explicit Enough(double chi2) : cost_(0.5 * chi2) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override {
    return summary.cost <= cost_ ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
  }

 private:
  double cost_;
};

template <int D>
struct Estimate {
  std::vector<std::array<double, kPoseSize<D>>> poses;
  std::vector<Vec<D>> points;

  explicit Estimate(Start<D> start) : points(std::move(start.points)) {
    poses.reserve(start.poses.size());
    for (const Rigid<D>& pose : start.poses) poses.push_back(parameters(pose));
  }
};

template <int D>
void add_residuals(const MeasurementGraph<D>& graph, Estimate<D>& x, ceres::Problem& problem) {
  constexpr int G = kGauge<D>, P = kPoseSize<D>;
  if (const auto* edges = measurements_of(graph, Tag("pose"))) {
    const auto* const z = reinterpret_cast<const Rigid<D>*>(edges->z.data());
    for (std::size_t e = 0; e < edges->size(); ++e) {
      auto* residual = new PoseResidual<D>(z[e], edges->info.data() + e * G * G);
      problem.AddResidualBlock(new ceres::AutoDiffCostFunction<PoseResidual<D>, G, P, P>(residual),
                               nullptr, x.poses[place_of(graph, "pose", edges->from[e])].data(),
                               x.poses[place_of(graph, "pose", edges->to[e])].data());
    }
  }
  if (const auto* sightings = measurements_of(graph, Tag("point"))) {
    const auto* const z = reinterpret_cast<const Vec<D>*>(sightings->z.data());
    for (std::size_t e = 0; e < sightings->size(); ++e) {
      auto* residual = new PointResidual<D>{z[e], root_of<D>(sightings->info.data() + e * D * D)};
      problem.AddResidualBlock(new ceres::AutoDiffCostFunction<PointResidual<D>, D, P, D>(residual),
                               nullptr, x.poses[place_of(graph, "pose", sightings->from[e])].data(),
                               x.points[place_of(graph, "point", sightings->to[e])].data());
    }
  }
}

}  // namespace

template <int D>
std::string why_not_ceres(const MeasurementGraph<D>& graph) {
  if (graph.submaps.size() > 0) return "local maps with joint information";
  for (const auto& column : graph.relative) {
    if (column.kind->tag != Tag("pose") && column.kind->tag != Tag("point")) {
      return "variables that are neither poses nor points";
    }
  }
  if (!spanning_tree_start(graph).complete) {
    return "poses that no chain of measurements between poses reaches";
  }
  return {};
}

template <int D>
CeresRun run_ceres(const MeasurementGraph<D>& graph, int threads, double enough, double limit) {
  Laps watch;
  Estimate<D> x(spanning_tree_start(graph));
  ceres::Problem::Options how;
  how.enable_fast_removal = false;
  ceres::Problem problem(how);
  add_residuals(graph, x, problem);
  if constexpr (D == 3) {
    using PoseManifold =
        ceres::ProductManifold<ceres::EuclideanManifold<3>, ceres::EigenQuaternionManifold>;
    auto* const manifold = new PoseManifold;  // the problem owns it, once
    for (auto& pose : x.poses) problem.SetManifold(pose.data(), manifold);
  }
  problem.SetParameterBlockConstant(x.poses.front().data());
  watch.lap();

  Enough stop(enough);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.sparse_linear_algebra_library_type = ceres::SUITE_SPARSE;
  options.num_threads = threads;
  options.max_num_iterations = 1000;
  options.max_solver_time_in_seconds = limit;
  options.function_tolerance = 1e-9;  // Ceres's own 1e-6 can stop before chi2 is right to 1e-6
  options.logging_type = ceres::SILENT;
  options.callbacks.push_back(&stop);
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  watch.lap();
  return {2.0 * summary.final_cost, static_cast<int>(summary.iterations.size()) - 1,
          std::move(watch).measured()};
}

#define MAPJOIN_INSTANTIATE(D)                                       \
  template std::string why_not_ceres<D>(const MeasurementGraph<D>&); \
  template CeresRun run_ceres<D>(const MeasurementGraph<D>&, int, double, double);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin::benchmarks
