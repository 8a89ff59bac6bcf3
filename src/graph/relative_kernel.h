#pragma once

#include <cstddef>
#include <cstdint>

#include "mapjoin/graph/builtin_types.h"

namespace mapjoin {

/// Where normal equations are added: a dense symmetric matrix, its lower triangle, column-major,
/// with the right-hand side as a row below it. A front of the sparse factorisation (whose columns
/// lie in two pieces of memory), or a small scratch matrix. What is written above the diagonal of a
/// diagonal block is never read.
struct DenseTarget {
  double* panel = nullptr;  ///< columns 0 .. pivots-1
  std::int64_t panel_stride = 0;
  std::int64_t pivots = 0;
  double* update = nullptr;  ///< columns pivots ..., each starting where its row 0 would be
  std::int64_t update_stride = 0;
  std::int64_t rhs_row = 0;  ///< the row that holds b

  double* column(std::int64_t j) const {
    return j < pivots ? panel + j * panel_stride : update + (j - pivots) * update_stride;
  }
  /// Distance between neighbouring columns of one variable's block.
  std::int64_t stride(std::int64_t j) const { return j < pivots ? panel_stride : update_stride; }
  double& rhs(std::int64_t j) const { return column(j)[rhs_row]; }
};

/// A batch of measurements of variables of one type, each taken from a pose and written in that
/// pose's frame.
///
/// Measurement id[k] of the batch says that the variable at values[to[k]] looks like z[id[k]] from
/// poses[from[k]], with information info[id[k]] (dim x dim) in the tangent at z.
template <int D>
struct RelativeBatch {
  std::size_t size = 0;
  const std::int32_t* id = nullptr;       ///< rows of z and info
  const double* z = nullptr;              ///< measured values, value_size doubles each
  const double* info = nullptr;           ///< dim x dim doubles each
  const double* poses = nullptr;          ///< current estimate of the poses
  const double* values = nullptr;         ///< current estimate of the observed type
  const std::int32_t* slots = nullptr;    ///< pairs (from, to): places in poses and values
  const std::int32_t* offsets = nullptr;  ///< pairs (from, to): first scalar rows in the target
  /// Estimates where a matrix was made that is to serve once more.
  const double* poses_then = nullptr;
  const double* values_then = nullptr;
  /// Measurements that come after the batch in `id` and `slots`: those of the next fronts.
  std::size_t following = 0;
};

/// The k-th of an array of values.
template <VariableType T>
const ValueOf<T>& value_at(const double* x, std::int64_t k) {
  return reinterpret_cast<const ValueOf<T>*>(x)[k];
}

/// Has memory fetch what measurement k of a batch will need, or of those that follow the batch.
/// Measurements lie as they came and are taken as fronts need them: otherwise a third of the time
/// that goes into them would be waiting.
template <VariableType T>
void fetch(const RelativeBatch<T::ambient>& batch, std::size_t k) {
  constexpr std::int64_t kPose = sizeof(Rigid<T::ambient>), kValue = sizeof(ValueOf<T>),
                         kInfo = T::dim * T::dim * std::int64_t{sizeof(double)}, kLine = 64;
  if (k >= batch.size + batch.following) return;
  const auto fetch_bytes = [](const double* base, std::int64_t row, std::int64_t bytes) {
    const char* const first = reinterpret_cast<const char*>(base) + row * bytes;
    for (std::int64_t b = 0; b < bytes; b += kLine) __builtin_prefetch(first + b);
    __builtin_prefetch(first + bytes - 1);
  };
  fetch_bytes(batch.z, batch.id[k], kValue);
  fetch_bytes(batch.info, batch.id[k], kInfo);
  fetch_bytes(batch.poses, batch.slots[2 * k], kPose);
  fetch_bytes(batch.values, batch.slots[2 * k + 1], kValue);
}
/// So many measurements before they are taken.
inline constexpr std::size_t kFetchAhead = 4;

/// r of measurement k of a batch, and its derivatives by the observed variable and, negative, by
/// the pose.
///
/// With the pose a as the local map's anchor: x' = a^-1 x, r = local(z, x'), and by the chain
/// through the change of frame, J_x = S D and J_a = -S g(x'), S = d local(z, x') (the anchor's C
/// and P are identities, DESIGN section 3).
template <VariableType T>
Vec<T::dim> relative_residual(const RelativeBatch<T::ambient>& batch, std::size_t k,
                              Mat<T::dim, T::dim>& Jx, Mat<T::dim, kGauge<T::ambient>>& minus_Ja) {
  const auto from_map = value_at<PoseType<T::ambient>>(batch.poses, batch.slots[2 * k]).inverse();
  const ValueOf<T>& x = value_at<T>(batch.values, batch.slots[2 * k + 1]);
  const Vec<T::dim> r = linearized_local<T>(
      value_at<T>(batch.z, batch.id[k]), T::template transform<double>(from_map, x), Jx, minus_Ja);
  if constexpr (T::action != FrameAction::kBody && T::action != FrameAction::kInvariant)
    Jx = Mat<T::dim, T::dim>(Jx * frame_jacobian<T>(from_map, x));
  return r;
}

/// Measurements from poses, and their normal equations. Loops with nothing called inside: calls
/// would be a twentieth of a run.
template <VariableType T>
struct RelativeKernel {
  static constexpr int D = T::ambient;
  static constexpr int N = T::dim;
  static constexpr int G = kGauge<D>;
  using Value = ValueOf<T>;

  /// Adds J^T I J and -J^T I r to the target; returns the sum of r^T I r.
  [[gnu::flatten]] static double linearize(const RelativeBatch<D>& batch,
                                           const DenseTarget& target) {
    double sum = 0.0;
    for (std::size_t k = 0; k < batch.size; ++k) {
      fetch<T>(batch, k + kFetchAhead);
      Mat<N, N> Jx;
      Mat<N, G> minus_Ja;
      const Vec<N> r = relative_residual<T>(batch, k, Jx, minus_Ja);
      const Columns J = columns_of(minus_Ja, Jx, r);
      sum += add(J, batch.info + batch.id[k] * std::int64_t{N * N}, batch.offsets[2 * k],
                 batch.offsets[2 * k + 1], target);
    }
    return sum;
  }

  /// Adds -J^T I r alone, to `rhs`, by the batch's offsets; returns the sum of r^T I r.
  [[gnu::flatten]] static double gradient(const RelativeBatch<D>& batch, double* rhs) {
    double sum = 0.0;
    for (std::size_t k = 0; k < batch.size; ++k) {
      fetch<T>(batch, k + kFetchAhead);
      Mat<N, N> Jx;
      Mat<N, G> minus_Ja;
      const Vec<N> r = relative_residual<T>(batch, k, Jx, minus_Ja);
      const Eigen::Map<const Mat<N, N>> info(batch.info + batch.id[k] * std::int64_t{N * N});
      const Vec<N> weighted = info * r;
      Eigen::Map<Vec<G>>(rhs + batch.offsets[2 * k]).noalias() += minus_Ja.transpose() * weighted;
      Eigen::Map<Vec<N>>(rhs + batch.offsets[2 * k + 1]).noalias() -= Jx.transpose() * weighted;
      sum += r.dot(weighted);
    }
    return sum;
  }

  [[gnu::flatten]] static double chi2(const RelativeBatch<D>& batch) {
    double sum = 0.0;
    for (std::size_t k = 0; k < batch.size; ++k) {
      fetch<T>(batch, k + kFetchAhead);
      const std::int64_t id = batch.id[k];
      const Value seen = T::template transform<double>(
          value_at<PoseType<D>>(batch.poses, batch.slots[2 * k]).inverse(),
          value_at<T>(batch.values, batch.slots[2 * k + 1]));
      const Vec<N> r = T::template local<double>(value_at<T>(batch.z, id), seen);
      sum += r.dot(Eigen::Map<const Mat<N, N>>(batch.info + id * (N * N)) * r);
    }
    return sum;
  }

 private:
  static constexpr int W = G + N;                 ///< scalars of the pose and of the variable
  static constexpr int Padded = (W + 8) / 8 * 8;  ///< with r, to whole vectors

  /// [J_a, J_x, r], row by row, padded with zeros: everything is then one symmetric product of
  /// loops of fixed length, whatever the type.
  struct Columns {
    double v[N][Padded];
  };

  static Columns columns_of(const Mat<N, G>& minus_Ja, const Mat<N, N>& Jx, const Vec<N>& r) {
    Columns J = {};
    for (int i = 0; i < N; ++i) {
      for (int c = 0; c < G; ++c) J.v[i][c] = -minus_Ja(i, c);
      for (int c = 0; c < N; ++c) J.v[i][G + c] = Jx(i, c);
      J.v[i][W] = r(i);
    }
    return J;
  }

  /// Adds [J, r]^T I [J, r] to the target, its last column negative. \returns r^T I r.
  static double add(const Columns& J, const double* info, std::int64_t at_pose,
                    std::int64_t at_value, const DenseTarget& target) {
    double IJ[N][Padded] = {};
    for (int i = 0; i < N; ++i) {
      for (int l = 0; l < N; ++l) {
        for (int c = 0; c < Padded; ++c) IJ[i][c] += info[l * N + i] * J.v[l][c];
      }
    }
    const bool value_below = at_value > at_pose;
    for (int c = 0; c < W; ++c) {
      double H[Padded] = {};  // column c of the product
      for (int l = 0; l < N; ++l) {
        for (int i = 0; i < Padded; ++i) H[i] += IJ[l][c] * J.v[l][i];
      }
      double* const column = c < G ? target.column(at_pose) + c * target.stride(at_pose)
                                   : target.column(at_value) + (c - G) * target.stride(at_value);
      if (c < G || !value_below) {
        for (int i = 0; i < G; ++i) column[at_pose + i] += H[i];
      }
      if (c >= G || value_below) {
        for (int i = 0; i < N; ++i) column[at_value + i] += H[G + i];
      }
      column[target.rhs_row] -= H[W];
    }
    double square = 0.0;
    for (int l = 0; l < N; ++l) square += J.v[l][W] * IJ[l][W];
    return square;
  }
};

extern template struct RelativeKernel<PoseType<2>>;
extern template struct RelativeKernel<PoseType<3>>;
extern template struct RelativeKernel<PointType<2>>;
extern template struct RelativeKernel<PointType<3>>;

}  // namespace mapjoin
