#pragma once

#include "mapjoin/graph/relative_kernel.h"

namespace mapjoin {

/// Adds the right-hand side for a matrix of then, after the step d that it asked for:
///
///     -J_then^T I (r - l) - J^T I l,    l = r_then + J_then d,
///
/// in tangents at the values of then. l is what the linear model of then leaves of the residuals,
/// r - l what their curvature adds. (-J^T I r, the gradient of now, would be the chord step's. It
/// differs by (J - J_then)^T I (r - l), of third order in d; but where J is stiffer than J_then,
/// J_then's softest motions make much of it.) Returns the sum of r^T I r.
///
/// In a file of its own, as every call counts in the loops of RelativeKernel: compilers put fewer
/// of them in place the more callers there are.
template <VariableType T>
double relative_correction(const RelativeBatch<T::ambient>& batch, double* rhs) {
  constexpr int D = T::ambient, N = T::dim, G = kGauge<D>;
  using Value = ValueOf<T>;
  RelativeBatch<D> then = batch;
  then.poses = batch.poses_then;
  then.values = batch.values_then;
  double sum = 0.0;
  for (std::size_t k = 0; k < batch.size; ++k) {
    fetch<T>(batch, k + kFetchAhead);
    const std::int32_t from = batch.slots[2 * k], to = batch.slots[2 * k + 1];
    const auto &pose_then = value_at<PoseType<D>>(then.poses, from),
               &pose_now = value_at<PoseType<D>>(batch.poses, from);
    const Value &value_then = value_at<T>(then.values, to),
                &value_now = value_at<T>(batch.values, to);
    Mat<N, N> Jx_then, Jx;
    Mat<N, G> minus_Ja_then, minus_Ja;
    const Vec<N> r_then = relative_residual<T>(then, k, Jx_then, minus_Ja_then);
    const Vec<N> r = relative_residual<T>(batch, k, Jx, minus_Ja);
    const Vec<N> l = r_then + Jx_then * T::template local<double>(value_then, value_now) -
                     minus_Ja_then * PoseType<D>::template local<double>(pose_then, pose_now);
    const Eigen::Map<const Mat<N, N>> info(batch.info + batch.id[k] * std::int64_t{N * N});
    const Vec<N> Ir = info * r, Il = info * l;
    const Vec<G> by_pose = minus_Ja.transpose() * Il;
    const Vec<N> by_value = Jx.transpose() * Il;
    Eigen::Map<Vec<G>>(rhs + batch.offsets[2 * k]) +=
        minus_Ja_then.transpose() * (Ir - Il) +
        transport<PoseType<D>>(pose_now, pose_then, by_pose);
    Eigen::Map<Vec<N>>(rhs + batch.offsets[2 * k + 1]) -=
        Jx_then.transpose() * (Ir - Il) + transport<T>(value_now, value_then, by_value);
    sum += r.dot(Ir);
  }
  return sum;
}

extern template double relative_correction<PoseType<2>>(const RelativeBatch<2>&, double*);
extern template double relative_correction<PoseType<3>>(const RelativeBatch<3>&, double*);
extern template double relative_correction<PointType<2>>(const RelativeBatch<2>&, double*);
extern template double relative_correction<PointType<3>>(const RelativeBatch<3>&, double*);

}  // namespace mapjoin
