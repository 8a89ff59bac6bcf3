#include "mapjoin/frames/align.h"

#include <Eigen/LU>
#include <Eigen/SVD>

#include <cstring>

#include "mapjoin/graph/dense.h"
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

// Everything here is small and of fixed size. Plain loops: the compiler takes several times as long
// over the expressions of matrices that would say the same.

/// N += sum over i of the gauge information of values, written about their centroid so that
/// distances do not hide rank.
template <int D>
void add_gauge_information(const CommonColumn<D>& common, const Rigid<D>& centre,
                           Eigen::MatrixXd& N) {
  constexpr int G = kGauge<D>;
  const VariableKind<D>& kind = *common.kind;
  std::vector<double> x(static_cast<std::size_t>(kind.value_size));
  Eigen::MatrixXd g(kind.dim, G);
  for (const int i : common.in_a) {
    std::memcpy(x.data(), common.a + static_cast<std::ptrdiff_t>(i) * kind.value_size,
                x.size() * sizeof(double));
    kind.transform(centre, x.data(), 1);
    kind.gauge(x.data(), 1, g.data());
    for (int c = 0; c < G; ++c) {
      for (int r = 0; r < G; ++r) {
        for (int k = 0; k < kind.dim; ++k) N(r, c) += g(k, r) * g(k, c);
      }
    }
  }
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

/// The mean of vectors that lie one after another.
template <int D>
Vec<D> mean(const std::vector<double>& v) {
  Vec<D> out = Vec<D>::Zero();
  for (std::size_t k = 0; k < v.size(); k += D) {
    for (int i = 0; i < D; ++i) out(i) += v[k + static_cast<std::size_t>(i)];
  }
  for (int i = 0; i < D; ++i) out(i) /= static_cast<double>(v.size() / D);
  return out;
}

template <int D>
Rigid<D> centring(const Pairs<D>& positions) {
  Rigid<D> centre;
  if (positions.size() > 0) centre.t = -mean<D>(positions.a);
  return centre;
}

template <int D>
bool has_rank(std::span<const CommonColumn<D>> common, const Rigid<D>& centre) {
  for (const CommonColumn<D>& c : common) {
    if (c.kind->has_rotation && c.kind->has_position && !c.in_a.empty()) return true;
  }
  constexpr int G = kGauge<D>;
  Eigen::MatrixXd N = Eigen::MatrixXd::Zero(G, G);
  for (const CommonColumn<D>& c : common) add_gauge_information(c, centre, N);
  // Lengths in units of the spread, so that translations and rotations compare.
  double of_rotations = 0.0, of_translations = 0.0;
  for (int k = 0; k < G; ++k) (k < D ? of_translations : of_rotations) += N(k, k);
  const double spread = std::sqrt(of_rotations / std::max(1.0, of_translations));
  if (!(spread > 0.0)) return false;
  const double scale = 1.0 / spread;
  for (int c = 0; c < G; ++c) {
    for (int r = 0; r < G; ++r) N(r, c) = (r < D ? 1.0 : scale) * N(r, c) * (c < D ? 1.0 : scale);
  }
  const Eigen::VectorXd values = eigenvalues(N);
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

template <int D>
std::vector<double> about(const std::vector<double>& v, const Vec<D>& mean) {
  std::vector<double> out(v.size());
  for (std::size_t k = 0; k < v.size(); ++k) out[k] = v[k] - mean(k % D);
  return out;
}

double sum_of_squares(const std::vector<double>& v) {
  double out = 0.0;
  for (const double x : v) out += x * x;
  return out;
}

double largest(const std::vector<double>& v) {
  double out = 0.0;
  for (const double x : v) out = std::max(out, std::abs(x));
  return out;
}

/// sum a b^T over vectors of D that lie one after another.
template <int D>
Mat<D, D> products(std::span<const double> a, std::span<const double> b) {
  Mat<D, D> out = Mat<D, D>::Zero();
  for (std::size_t k = 0; k < a.size(); k += D) {
    for (int c = 0; c < D; ++c) {
      for (int r = 0; r < D; ++r)
        out(r, c) += a[k + static_cast<std::size_t>(r)] * b[k + static_cast<std::size_t>(c)];
    }
  }
  return out;
}

/// What vectors tell of a rotation: sum [v]x^T [v]x, in the plane sum |v|^2.
template <int D>
Mat<kRotation<D>, kRotation<D>> rotation_information(const std::vector<double>& v) {
  const double squares = sum_of_squares(v);
  if constexpr (D == 2) {
    return Mat<1, 1>(squares);
  } else {
    Mat<3, 3> out = -products<3>(v, v);
    for (int k = 0; k < 3; ++k) out(k, k) += squares;
    return out;
  }
}

/// \returns false when the rotation is not determined.
template <int D>
bool fit_rotation(const CommonGeometry<D>& common, Rigid<D>& T) {
  constexpr int K = kRotation<D>;
  Mat<D, D> M = Mat<D, D>::Zero();
  Mat<K, K> positions = Mat<K, K>::Zero();
  double weight = 1.0;
  if (const Eigen::Index n = common.positions.size(); n > 0) {
    const auto& [in_a, in_b] = common.positions;
    const std::vector<double> a = about<D>(in_a, mean<D>(in_a));
    const std::vector<double> b = about<D>(in_b, mean<D>(in_b));
    // Where the two maps disagree about how far apart the common positions are, their direction
    // means little: the spread in both counts, so that orientations always weigh at least twice
    // what positions can.
    const double spread = (sum_of_squares(a) + sum_of_squares(b)) / static_cast<double>(n);
    const double rounding = kRounding * std::max(largest(in_a), largest(in_b));
    if (spread > rounding * rounding) {
      weight = spread;
      M = products<D>(a, b);
      positions = rotation_information<D>(a);
      for (int k = 0; k < K * K; ++k) positions.data()[k] /= weight;
    }
  }
  Mat<K, K> turning = positions;
  // A matrix is D vectors.
  const auto add = [&](const std::vector<double>& a, const std::vector<double>& b) {
    const Mat<D, D> more = products<D>(a, b);
    for (int k = 0; k < D * D; ++k) M.data()[k] += weight * more.data()[k];
    turning += rotation_information<D>(a);
  };
  add(common.rotations.a, common.rotations.b);
  add(common.directions.a, common.directions.b);
  const Eigen::VectorXd by_positions = eigenvalues(positions);
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
    const Vec<D> turned = T.R * mean<D>(common.positions.b);
    T.t = mean<D>(common.positions.a) - turned;
  }
  if (common.offsets.size() == 0) return n > 0;
  Mat<D, D> N = products<D>(common.normals.a, common.normals.a);
  if (n == 0 && !(eigenvalues(N)(0) > kCrossing)) return false;
  Eigen::VectorXd missing = Eigen::VectorXd::Zero(D);
  for (std::size_t k = 0; k < common.offsets.a.size(); ++k) {
    const double* const normal = common.normals.a.data() + k * D;
    double distance = common.offsets.a[k] - common.offsets.b[k];
    for (int i = 0; i < D; ++i) distance -= normal[i] * T.t(i);
    for (int i = 0; i < D; ++i) missing(i) += normal[i] * distance;
  }
  for (int i = 0; i < D; ++i) N(i, i) += n;
  const Eigen::VectorXd step = solve_definite(N, missing);
  for (int i = 0; i < D; ++i) T.t(i) += step(i);
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
    Eigen::Matrix3d U = svd.matrixU();
    const auto rotation = [&] { return products<3>({U.data(), 9}, {svd.matrixV().data(), 9}); };
    if (rotation().determinant() < 0.0) U.col(2) = -U.col(2);
    return rotation();
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
