#include "mapjoin/frames/align.h"

#include <Eigen/LU>
#include <Eigen/SVD>

#include <cstring>

#include "mapjoin/graph/symmetric.h"

namespace mapjoin {

namespace {

/// Rotations below this part of the best determined one count as undetermined by the geometry.
constexpr double kRankTolerance = 1e-10;
/// Spreads below this part of the coordinates are rounding errors.
constexpr double kRounding = 1e-12;
/// Least eigenvalue of sum u u^T over unit vectors that tell all directions: two at some three
/// degrees.
constexpr double kCrossing = 1e-3;

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

/// What common variables of a column offer of one kind.
template <int D, int Rows>
void append(void (*get)(const double* x, const int* index, std::size_t n, double* out),
            const CommonColumn<D>& common, Pairs<Rows>& pairs) {
  if (get == nullptr || common.in_a.empty()) return;
  const std::size_t at = pairs.a.size();
  pairs.a.resize(at + common.in_a.size() * Rows);
  pairs.b.resize(pairs.a.size());
  get(common.a, common.in_a.data(), common.in_a.size(), pairs.a.data() + at);
  get(common.b, common.in_b.data(), common.in_b.size(), pairs.b.data() + at);
}

template <int D>
Pairs<D> common_positions(std::span<const CommonColumn<D>> common) {
  Pairs<D> out;
  for (const CommonColumn<D>& c : common) append(c.kind->positions, c, out);
  return out;
}

template <int D>
Rigid<D> centring(const Pairs<D>& positions) {
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
  const Eigen::VectorXd values = eigenvalues(scaled);
  return values(0) > kRankTolerance * values(G - 1);
}

/// What takes part in a fit. Only that may vouch for it: what else the maps share can fix a frame,
/// but not this one.
template <int D>
CommonGeometry<D> collect(std::span<const CommonColumn<D>> common) {
  CommonGeometry<D> out;
  out.positions = common_positions(common);
  for (const CommonColumn<D>& c : common) {
    append(c.kind->rotations, c, out.rotations);
    append(c.kind->directions, c, out.directions);
    if (c.kind->offsets == nullptr) continue;
    append(c.kind->directions, c, out.normals);
    append(c.kind->offsets, c, out.offsets);
  }
  return out;
}

/// What vectors, as columns, tell of a rotation: sum [v]x^T [v]x, in the plane sum |v|^2.
template <int D, class Vectors>
Mat<kRotation<D>, kRotation<D>> rotation_information(const Vectors& v) {
  Mat<kRotation<D>, kRotation<D>> out;
  if constexpr (D == 2) {
    out(0, 0) = v.squaredNorm();
  } else {
    out = v.squaredNorm() * Mat<3, 3>::Identity();
    out.noalias() -= v * v.transpose();
  }
  return out;
}

/// \returns false when the rotation is not determined.
template <int D>
bool fit_rotation(const CommonGeometry<D>& common, Rigid<D>& T) {
  constexpr int K = kRotation<D>;
  Eigen::Matrix<double, D, D> M = Eigen::Matrix<double, D, D>::Zero();
  Mat<K, K> positions = Mat<K, K>::Zero();
  double weight = 1.0;
  if (const Eigen::Index n = common.positions.size(); n > 0) {
    const auto in_a = common.positions.in_a();
    const auto in_b = common.positions.in_b();
    const auto mean = [](const auto& p) -> Eigen::Matrix<double, D, 1> {
      return p.rowwise().mean();
    };
    const Eigen::Matrix<double, D, Eigen::Dynamic> a = in_a.colwise() - mean(in_a);
    const Eigen::Matrix<double, D, Eigen::Dynamic> b = in_b.colwise() - mean(in_b);
    // Where the two maps disagree about how far apart the common positions are, their direction
    // means little: the spread in both counts, so that orientations always weigh at least twice
    // what positions can.
    const double spread = (a.squaredNorm() + b.squaredNorm()) / static_cast<double>(n);
    const double rounding =
        kRounding * std::max(in_a.cwiseAbs().maxCoeff(), in_b.cwiseAbs().maxCoeff());
    if (spread > rounding * rounding) {
      weight = spread;
      M = a * b.transpose();
      positions = rotation_information<D>(a) / weight;
    }
  }
  Mat<K, K> turning = positions;
  for (Eigen::Index k = 0; k < common.rotations.size(); ++k) {
    const Eigen::Map<const Mat<D, D>> a(common.rotations.a.data() + k * D * D);
    const Eigen::Map<const Mat<D, D>> b(common.rotations.b.data() + k * D * D);
    M.noalias() += weight * (a * b.transpose());
    turning += Mat<K, K>::Identity() * (D - 1);
  }
  if (common.directions.size() > 0) {
    M.noalias() += weight * (common.directions.in_a() * common.directions.in_b().transpose());
    turning += rotation_information<D>(common.directions.in_a());
  }
  const auto by_positions = eigenvalues(positions);
  if (!(by_positions(0) > kRankTolerance * by_positions(K - 1)) &&
      !(eigenvalues(turning)(0) > kCrossing))
    return false;
  T.R = nearest_rotation<D>(M);
  return true;
}

/// With the rotation known. \returns false when the translation is not determined.
template <int D>
bool fit_translation(const CommonGeometry<D>& common, Rigid<D>& T) {
  const auto n = static_cast<double>(common.positions.size());
  if (n > 0) {
    const Vec<D> mean_a = common.positions.in_a().rowwise().mean();
    const Vec<D> mean_b = common.positions.in_b().rowwise().mean();
    T.t = mean_a - T.R * mean_b;
  }
  if (common.offsets.size() == 0) return n > 0;
  const auto normals = common.normals.in_a();
  const Mat<D, D> crossing = normals * normals.transpose();
  if (n == 0 && !(eigenvalues(crossing)(0) > kCrossing)) return false;
  const Eigen::VectorXd missing = (common.offsets.in_a() - common.offsets.in_b()).transpose() -
                                  normals.transpose() * Eigen::Matrix<double, D, 1>(T.t);
  const Eigen::Matrix<double, D, D> N = crossing + n * Mat<D, D>::Identity();
  T.t += N.ldlt().solve(normals * missing);
  return true;
}

}  // namespace

template <int D>
Mat<D, D> nearest_rotation(const Mat<D, D>& M) {
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

template <int D>
bool fixes_frame(std::span<const CommonColumn<D>> common) {
  return has_rank(common, centring(common_positions(common)));
}

template <int D>
std::optional<Rigid<D>> align(std::span<const CommonColumn<D>> common) {
  return align(collect(common));
}

template <int D>
std::optional<Rigid<D>> align(const CommonGeometry<D>& common) {
  Rigid<D> T;
  if (!fit_rotation(common, T) || !fit_translation(common, T)) return std::nullopt;
  return T;
}

template <int D>
CommonGeometry<D> common_geometry(const Values<D>& a, const Values<D>& b) {
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
  return collect(std::span<const CommonColumn<D>>(common));
}

template <int D>
std::optional<Rigid<D>> align(const Values<D>& a, const Values<D>& b) {
  return align(common_geometry(a, b));
}

#define MAPJOIN_INSTANTIATE(D)                                                       \
  template Mat<D, D> nearest_rotation<D>(const Mat<D, D>&);                          \
  template bool fixes_frame<D>(std::span<const CommonColumn<D>>);                    \
  template std::optional<Rigid<D>> align<D>(std::span<const CommonColumn<D>>);       \
  template std::optional<Rigid<D>> align<D>(const CommonGeometry<D>&);               \
  template CommonGeometry<D> common_geometry<D>(const Values<D>&, const Values<D>&); \
  template std::optional<Rigid<D>> align<D>(const Values<D>&, const Values<D>&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
