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
};

/// Residual and Jacobians of a measurement from a pose, and their normal equations.
///
/// With the pose a as the local map's anchor: x' = a^-1 x, r = local(z, x'), and by the chain
/// through the change of frame, J_x = S D and J_a = -S g(x'), S = d local(z, x') (the anchor's C
/// and P are identities, DESIGN section 3).
template <VariableType T>
struct RelativeKernel {
  static constexpr int D = T::ambient;
  static constexpr int N = T::dim;
  static constexpr int G = kGauge<D>;
  using Value = ValueOf<T>;

  static const Value& value(const double* x, std::int64_t k) {
    return reinterpret_cast<const Value*>(x)[k];
  }
  static const Rigid<D>& pose(const double* x, std::int64_t k) {
    return reinterpret_cast<const Rigid<D>*>(x)[k];
  }

  /// Adds J^T I J and -J^T I r to the target; returns the sum of r^T I r.
  static double linearize(const RelativeBatch<D>& batch, const DenseTarget& target) {
    double sum = 0.0;
    for (std::size_t k = 0; k < batch.size; ++k) {
      const std::int64_t id = batch.id[k];
      const Rigid<D> from_map = pose(batch.poses, batch.slots[2 * k]).inverse();
      const Value& x = value(batch.values, batch.slots[2 * k + 1]);
      const Value& z = value(batch.z, id);
      const Value seen = T::template transform<double>(from_map, x);
      const Vec<N> r = T::template local<double>(z, seen);
      const Eigen::Map<const Mat<N, N>> info(batch.info + id * (N * N));

      const Mat<N, N> S = local_jacobian<T>(z, seen);
      Mat<N, N> Jx;
      if constexpr (T::action == FrameAction::kBody || T::action == FrameAction::kInvariant) {
        Jx = S;
      } else {
        Jx.noalias() = S * frame_jacobian<T>(from_map, x);
      }
      Mat<N, G> Ja;
      Ja.noalias() = -(S * gauge<T>(seen));
      const Vec<N> weighted = info * r;
      sum += r.dot(weighted);
      add(batch.offsets[2 * k], batch.offsets[2 * k + 1], Ja, Jx, Mat<N, N>(info), weighted,
          target);
    }
    return sum;
  }

  static double chi2(const RelativeBatch<D>& batch) {
    double sum = 0.0;
    for (std::size_t k = 0; k < batch.size; ++k) {
      const std::int64_t id = batch.id[k];
      const Value seen =
          T::template transform<double>(pose(batch.poses, batch.slots[2 * k]).inverse(),
                                        value(batch.values, batch.slots[2 * k + 1]));
      const Vec<N> r = T::template local<double>(value(batch.z, id), seen);
      sum += r.dot(Eigen::Map<const Mat<N, N>>(batch.info + id * (N * N)) * r);
    }
    return sum;
  }

 private:
  template <int Rows, int Cols>
  using Block = Eigen::Map<Mat<Rows, Cols>, 0, Eigen::OuterStride<>>;

  static void add(std::int64_t at_pose, std::int64_t at_value, const Mat<N, G>& Ja,
                  const Mat<N, N>& Jx, const Mat<N, N>& info, const Vec<N>& weighted,
                  const DenseTarget& target) {
    const Mat<N, G> IJa = info * Ja;
    const Mat<N, N> IJx = info * Jx;
    const auto at = [&](std::int64_t row, std::int64_t column) {
      return target.column(column) + row;
    };
    const Eigen::OuterStride<> pose_stride(target.stride(at_pose));
    const Eigen::OuterStride<> value_stride(target.stride(at_value));
    Block<G, G>(at(at_pose, at_pose), pose_stride).noalias() += Ja.transpose() * IJa;
    Block<N, N>(at(at_value, at_value), value_stride).noalias() += Jx.transpose() * IJx;
    if (at_value > at_pose) {
      Block<N, G>(at(at_value, at_pose), pose_stride).noalias() += Jx.transpose() * IJa;
    } else {
      Block<G, N>(at(at_pose, at_value), value_stride).noalias() += Ja.transpose() * IJx;
    }
    const Vec<G> ba = Ja.transpose() * weighted;
    const Vec<N> bx = Jx.transpose() * weighted;
    for (int k = 0; k < G; ++k) target.rhs(at_pose + k) -= ba(k);
    for (int k = 0; k < N; ++k) target.rhs(at_value + k) -= bx(k);
  }
};

}  // namespace mapjoin
