#include "mapjoin/frames/align.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SVD>

#include <cstring>

namespace mapjoin {

namespace {

/// Rotations below this part of the best determined one count as undetermined by the geometry.
constexpr double kRankTolerance = 1e-10;

/// sum over i of the gauge information of values, written about their centroid so that distances do
/// not hide rank.
template <int D>
Mat<kGauge<D>, kGauge<D>> gauge_information(const CommonColumn<D>& common, const Rigid<D>& centre) {
  constexpr int G = kGauge<D>;
  const VariableKind<D>& kind = *common.kind;
  Mat<G, G> N = Mat<G, G>::Zero();
  std::vector<double> x(static_cast<std::size_t>(kind.value_size));
  Eigen::MatrixXd g(kind.dim, G);
  for (const int i : common.in_a) {
    std::memcpy(x.data(), common.a + static_cast<std::ptrdiff_t>(i) * kind.value_size,
                x.size() * sizeof(double));
    kind.transform(centre, x.data(), 1);
    kind.gauge(x.data(), 1, g.data());
    N += g.transpose() * g;
  }
  return N;
}

template <int D>
struct Positions {
  std::vector<double> a, b;  // D a position
  std::size_t size() const { return a.size() / D; }
  Eigen::Map<const Eigen::Matrix<double, D, Eigen::Dynamic>> in_a() const {
    return {a.data(), D, static_cast<Eigen::Index>(size())};
  }
  Eigen::Map<const Eigen::Matrix<double, D, Eigen::Dynamic>> in_b() const {
    return {b.data(), D, static_cast<Eigen::Index>(size())};
  }
};

template <int D>
Positions<D> common_positions(std::span<const CommonColumn<D>> common) {
  Positions<D> out;
  for (const CommonColumn<D>& c : common) {
    if (c.kind->positions == nullptr || c.in_a.empty()) continue;
    const std::size_t at = out.a.size();
    out.a.resize(at + c.in_a.size() * D);
    out.b.resize(at + c.in_a.size() * D);
    c.kind->positions(c.a, c.in_a.data(), c.in_a.size(), out.a.data() + at);
    c.kind->positions(c.b, c.in_b.data(), c.in_b.size(), out.b.data() + at);
  }
  return out;
}

template <int D>
Rigid<D> centring(const Positions<D>& positions) {
  Rigid<D> centre;
  if (positions.size() > 0) centre.t = -positions.in_a().rowwise().mean();
  return centre;
}

template <int D>
bool has_rank(std::span<const CommonColumn<D>> common, const Rigid<D>& centre) {
  for (const CommonColumn<D>& c : common) {
    if (c.kind->has_rotation && c.kind->has_position && !c.in_a.empty()) return true;
  }
  constexpr int G = kGauge<D>;
  Mat<G, G> N = Mat<G, G>::Zero();
  for (const CommonColumn<D>& c : common) N += gauge_information(c, centre);
  // Lengths in units of the spread, so that translations and rotations compare.
  const double spread =
      std::sqrt(N.template bottomRightCorner<kRotation<D>, kRotation<D>>().trace() /
                std::max(1.0, N.template topLeftCorner<D, D>().trace()));
  if (!(spread > 0.0)) return false;
  Eigen::Matrix<double, G, 1> scale = Eigen::Matrix<double, G, 1>::Ones();
  scale.template tail<kRotation<D>>().setConstant(1.0 / spread);
  const Eigen::Matrix<double, G, G> scaled = scale.asDiagonal() * N * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, G, G>> eigen(scaled,
                                                                         Eigen::EigenvaluesOnly);
  return eigen.eigenvalues()(0) > kRankTolerance * eigen.eigenvalues()(G - 1);
}

/// The rotation closest to M.
template <int D>
Mat<D, D> project_rotation(const Eigen::Matrix<double, D, D>& M) {
  Mat<D, D> R;
  if constexpr (D == 2) {
    const double angle = std::atan2(M(1, 0) - M(0, 1), M(0, 0) + M(1, 1));
    return rotation_exp<2, double>(Vec<1>(angle));
  } else {
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(M, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Eigen::Vector3d sign = Eigen::Vector3d::Ones();
    if ((svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0) sign(2) = -1.0;
    return svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
  }
}

}  // namespace

template <int D>
bool fixes_frame(std::span<const CommonColumn<D>> common) {
  return has_rank(common, centring(common_positions(common)));
}

template <int D>
std::optional<Rigid<D>> align(std::span<const CommonColumn<D>> common) {
  const Positions<D> positions = common_positions(common);
  const Rigid<D> centre = centring(positions);
  // Only what takes part in the fit may vouch for it: two walls fix a frame, but not this one.
  std::vector<CommonColumn<D>> fitted;
  for (const CommonColumn<D>& c : common) {
    if (c.kind->positions != nullptr || c.kind->rotations != nullptr) fitted.push_back(c);
  }
  if (positions.size() == 0 || !has_rank<D>(fitted, centre)) return std::nullopt;

  const Vec<D> mean_a = -centre.t;
  const Vec<D> mean_b = positions.in_b().rowwise().mean();
  const Eigen::Matrix<double, D, Eigen::Dynamic> a =
      positions.in_a().colwise() - Eigen::Matrix<double, D, 1>(mean_a);
  const Eigen::Matrix<double, D, Eigen::Dynamic> b =
      positions.in_b().colwise() - Eigen::Matrix<double, D, 1>(mean_b);
  Eigen::Matrix<double, D, D> M = a * b.transpose();
  // Where the two maps disagree about how far apart the common positions are, their direction means
  // little: the spread in both counts, so that orientations always weigh at least twice what
  // positions can.
  const double spread = (a.squaredNorm() + b.squaredNorm()) / static_cast<double>(positions.size());
  const double weight = spread > 0.0 ? spread : 1.0;
  std::vector<double> Ra, Rb;
  for (const CommonColumn<D>& c : common) {
    if (c.kind->rotations == nullptr || c.in_a.empty()) continue;
    Ra.resize(c.in_a.size() * D * D);
    Rb.resize(Ra.size());
    c.kind->rotations(c.a, c.in_a.data(), c.in_a.size(), Ra.data());
    c.kind->rotations(c.b, c.in_b.data(), c.in_b.size(), Rb.data());
    for (std::size_t k = 0; k < c.in_a.size(); ++k) {
      using Matrix = Eigen::Map<const Mat<D, D>>;
      M += weight * (Matrix(Ra.data() + k * D * D) * Matrix(Rb.data() + k * D * D).transpose());
    }
  }
  Rigid<D> T;
  T.R = project_rotation<D>(M);
  T.t = mean_a - T.R * mean_b;
  return T;
}

template <int D>
std::optional<Rigid<D>> align(const Values<D>& a, const Values<D>& b) {
  const std::vector<int> numbers = numbers_in(a.variables(), b.variables());
  std::vector<CommonColumn<D>> common;
  std::vector<std::vector<int>> in_a(a.variables().columns().size()), in_b(in_a.size());
  for (std::size_t c = 0; c < in_a.size(); ++c) {
    const auto& column = a.variables().column(static_cast<int>(c));
    const int other = b.variables().find_column(column.kind->tag);
    if (other < 0) continue;
    for (int k = 0; k < column.size(); ++k) {
      const int number = numbers[static_cast<std::size_t>(column.first + k)];
      if (number < 0) continue;
      in_a[c].push_back(k);
      in_b[c].push_back(number - b.variables().column(other).first);
    }
    common.push_back({column.kind, a.data(static_cast<int>(c)), b.data(other), in_a[c], in_b[c]});
  }
  return align<D>(common);
}

#define MAPJOIN_INSTANTIATE(D)                                                 \
  template bool fixes_frame<D>(std::span<const CommonColumn<D>>);              \
  template std::optional<Rigid<D>> align<D>(std::span<const CommonColumn<D>>); \
  template std::optional<Rigid<D>> align<D>(const Values<D>&, const Values<D>&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
