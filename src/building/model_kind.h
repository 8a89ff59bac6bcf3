#pragma once

#include "mapjoin/building/models.h"
#include "mapjoin/graph/variable_kind.h"

namespace mapjoin {

/// A measurement model at run time: its numbers, and its functions on doubles. What
/// VariableKind is to variable types.
template <int D>
struct ModelKind {
  Tag tag;
  int dim = 0;       ///< of the residual; information is dim x dim
  int measured = 0;  ///< doubles in z
  const VariableKind<D>* target = nullptr;
  bool relative = false;  ///< z is the target in the frame of the pose: RelativeModel<T>

  /// r at pose [+] a, x [+] b; a and b may be null, for zero.
  void (*residual)(const double* z, const double* pose, const double* a, const double* x,
                   const double* b, double* r) = nullptr;
  /// The same, and its derivatives by a and b: dim x kGauge<D> and dim x target dim, row by row.
  void (*linearize)(const double* z, const double* pose, const double* a, const double* x,
                    const double* b, double* r, double* J_pose, double* J_x) = nullptr;
  /// x' with residual zero; null when a measurement says only part of it.
  void (*seen)(const double* z, double* x) = nullptr;
  /// One of many x' with residual zero; null when a measurement says all of it.
  void (*hypothesis)(const double* z, double u, double* x) = nullptr;
};

namespace detail {

template <class M>
inline constexpr bool kIsRelative = false;
template <class T>
inline constexpr bool kIsRelative<RelativeModel<T>> = true;

template <MeasurementModel M>
struct ModelFunctions {
  using T = typename M::Target;
  using Z = typename M::Measurement;
  static constexpr int D = T::ambient;
  static constexpr int G = kGauge<D>;
  static constexpr int N = T::dim;
  static constexpr int R = M::dim;

  static const Z& z_of(const double* z) { return *reinterpret_cast<const Z*>(z); }
  static const Rigid<D>& pose_of(const double* x) { return *reinterpret_cast<const Rigid<D>*>(x); }
  static const ValueOf<T>& value_of(const double* x) {
    return *reinterpret_cast<const ValueOf<T>*>(x);
  }
  template <int Size>
  static Vec<Size> step(const double* d) {
    if (d == nullptr) return Vec<Size>::Zero();
    return Eigen::Map<const Vec<Size>>(d);
  }

  static void residual(const double* z, const double* pose, const double* a, const double* x,
                       const double* b, double* r) {
    Eigen::Map<Vec<R>> out(r);
    out = residual_at<M, double>(z_of(z), pose_of(pose), step<G>(a), value_of(x), step<N>(b));
  }
  static void linearize(const double* z, const double* pose, const double* a, const double* x,
                        const double* b, double* r, double* J_pose, double* J_x) {
    using S = Dual<G + N>;
    const Vec<G> da = step<G>(a);
    const Vec<N> db = step<N>(b);
    Vec<G, S> sa;
    Vec<N, S> sb;
    for (int k = 0; k < G; ++k) sa(k) = S::variable(da(k), k);
    for (int k = 0; k < N; ++k) sb(k) = S::variable(db(k), G + k);
    const Vec<R, S> e = residual_at<M, S>(z_of(z), pose_of(pose), sa, value_of(x), sb);
    for (int i = 0; i < R; ++i) {
      r[i] = e(i).a;
      for (int k = 0; k < G; ++k) J_pose[i * G + k] = e(i).v(k);
      for (int k = 0; k < N; ++k) J_x[i * N + k] = e(i).v(G + k);
    }
  }
  static void seen(const double* z, double* x) {
    if constexpr (CompleteModel<M>) *reinterpret_cast<ValueOf<T>*>(x) = M::seen(z_of(z));
  }
  static void hypothesis(const double* z, double u, double* x) {
    if constexpr (!CompleteModel<M>) *reinterpret_cast<ValueOf<T>*>(x) = M::hypothesis(z_of(z), u);
  }
};

template <MeasurementModel M>
constexpr ModelKind<M::Target::ambient> make_model() {
  using F = ModelFunctions<M>;
  ModelKind<F::D> kind;
  kind.tag = Tag(M::name);
  kind.dim = M::dim;
  kind.measured = kMeasured<M>;
  kind.target = &kind_of<typename M::Target>();
  kind.relative = kIsRelative<M>;
  kind.residual = &F::residual;
  kind.linearize = &F::linearize;
  kind.seen = CompleteModel<M> ? &F::seen : nullptr;
  kind.hypothesis = CompleteModel<M> ? nullptr : &F::hypothesis;
  return kind;
}

template <MeasurementModel M>
inline constexpr ModelKind<M::Target::ambient> kModel = make_model<M>();

// The library's own models are compiled once, in model_kind.cpp.
extern const ModelKind<2> kRelativePose2, kRelativePoint2, kRangeBearing, kBearingOnly, kRangeOnly,
    kVelocityTurnRate;
extern const ModelKind<3> kRelativePose3, kRelativePoint3, kRangeBearingElevation;

template <class M>
inline constexpr const ModelKind<M::Target::ambient>* kCompiledModel = nullptr;
template <>
inline constexpr const ModelKind<2>* kCompiledModel<RelativeModel<Pose2>> = &kRelativePose2;
template <>
inline constexpr const ModelKind<3>* kCompiledModel<RelativeModel<Pose3>> = &kRelativePose3;
template <>
inline constexpr const ModelKind<2>* kCompiledModel<RelativeModel<Point2>> = &kRelativePoint2;
template <>
inline constexpr const ModelKind<3>* kCompiledModel<RelativeModel<Point3>> = &kRelativePoint3;
template <>
inline constexpr const ModelKind<2>* kCompiledModel<RangeBearing> = &kRangeBearing;
template <>
inline constexpr const ModelKind<3>* kCompiledModel<RangeBearingElevation> =
    &kRangeBearingElevation;
template <>
inline constexpr const ModelKind<2>* kCompiledModel<BearingOnly> = &kBearingOnly;
template <>
inline constexpr const ModelKind<2>* kCompiledModel<RangeOnly> = &kRangeOnly;
template <>
inline constexpr const ModelKind<2>* kCompiledModel<VelocityTurnRate> = &kVelocityTurnRate;

}  // namespace detail

/// The one description of model M.
template <MeasurementModel M>
constexpr const ModelKind<M::Target::ambient>& model_of() {
  if constexpr (detail::kCompiledModel<M> != nullptr) {
    return *detail::kCompiledModel<M>;
  } else {
    return detail::kModel<M>;
  }
}

}  // namespace mapjoin
