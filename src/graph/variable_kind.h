#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "mapjoin/graph/builtin_types.h"
#include "mapjoin/graph/correction_kernel.h"
#include "mapjoin/graph/key.h"
#include "mapjoin/graph/relative_kernel.h"

namespace mapjoin {

/// A variable type at run time: its numbers, and its functions over *arrays* of values.
///
/// Maps hold columns of values of types they do not know. One indirect call handles a whole column
/// (or a batch of measurements), never a single variable. Values are `value_size` doubles in a row,
/// tangents `dim`, gauge rows dim x kGauge<D> column-major, Jacobians dim x dim column-major.
template <int D>
struct VariableKind {
  Tag tag;
  int dim = 0;
  int value_size = 0;
  FrameAction action = FrameAction::kGeneral;
  bool has_position = false;
  bool has_rotation = false;

  /// x[k] = T x[k].
  void (*transform)(const Rigid<D>& T, double* x, std::size_t n) = nullptr;
  /// out[k] = D(T, x[k]), x before the motion.
  void (*frame_jacobian)(const Rigid<D>& T, const double* x, std::size_t n, double* out) = nullptr;
  /// out[k] = g(x[k]).
  void (*gauge)(const double* x, std::size_t n, double* out) = nullptr;
  /// x[k] = x[k] [+] d[k].
  void (*retract)(double* x, const double* d, std::size_t n) = nullptr;
  /// d[k] = transport(x[k], y[k], d[k]). Null where tangents stay as they are.
  void (*transport)(const double* x, const double* y, double* d, std::size_t n) = nullptr;
  /// r[k] = local(x[k], y[k]).
  void (*local)(const double* x, const double* y, std::size_t n, double* r) = nullptr;
  /// S[k] = d local(x[k], y[k] [+] d) / dd.
  void (*local_jacobian)(const double* x, const double* y, std::size_t n, double* S) = nullptr;
  /// out[k] = position of x[index[k]], D doubles. Null when the type has none.
  void (*positions)(const double* x, const int* index, std::size_t n, double* out) = nullptr;
  /// out[k] = orientation of x[index[k]], D x D column-major. Null when the type has none.
  void (*rotations)(const double* x, const int* index, std::size_t n, double* out) = nullptr;
  /// out[k] = direction of x[index[k]], D doubles. Null when the type has none.
  void (*directions)(const double* x, const int* index, std::size_t n, double* out) = nullptr;
  /// out[k] = offset of x[index[k]] along its direction. Null when the type has none.
  void (*offsets)(const double* x, const int* index, std::size_t n, double* out) = nullptr;
  /// Normal equations of measurements of this type taken from poses; see relative_kernel.h.
  double (*linearize_relative)(const RelativeBatch<D>&, const DenseTarget&) = nullptr;
  /// Their right-hand side alone, and chi2.
  double (*gradient_relative)(const RelativeBatch<D>&, double* rhs) = nullptr;
  /// That for a matrix of batch.poses_then and values_then, and chi2 of now.
  double (*correction_relative)(const RelativeBatch<D>&, double* rhs) = nullptr;
  /// Their chi2 alone.
  double (*chi2_relative)(const RelativeBatch<D>&) = nullptr;
};

namespace detail {

template <VariableType T>
struct KindFunctions {
  static constexpr int D = T::ambient;
  static constexpr int N = T::dim;
  static constexpr int G = kGauge<D>;
  using Value = ValueOf<T>;

  static const Value* values(const double* x) { return reinterpret_cast<const Value*>(x); }
  static Value* values(double* x) { return reinterpret_cast<Value*>(x); }

  static void transform(const Rigid<D>& rigid, double* x, std::size_t n) {
    Value* const v = values(x);
    for (std::size_t k = 0; k < n; ++k) v[k] = T::template transform<double>(rigid, v[k]);
  }
  static void frame_jacobian(const Rigid<D>& rigid, const double* x, std::size_t n, double* out) {
    for (std::size_t k = 0; k < n; ++k, out += N * N) {
      Eigen::Map<Mat<N, N>> J(out);
      J = mapjoin::frame_jacobian<T>(rigid, values(x)[k]);
    }
  }
  static void gauge(const double* x, std::size_t n, double* out) {
    for (std::size_t k = 0; k < n; ++k, out += N * G) {
      Eigen::Map<Mat<N, G>> g(out);
      g = mapjoin::gauge<T>(values(x)[k]);
    }
  }
  static void retract(double* x, const double* d, std::size_t n) {
    Value* const v = values(x);
    for (std::size_t k = 0; k < n; ++k, d += N) {
      v[k] = T::template retract<double>(v[k], TangentOf<T>(Eigen::Map<const TangentOf<T>>(d)));
    }
  }
  static void transport(const double* x, const double* y, double* d, std::size_t n) {
    for (std::size_t k = 0; k < n; ++k, d += N) {
      Eigen::Map<TangentOf<T>> out(d);
      out = mapjoin::transport<T>(values(x)[k], values(y)[k], TangentOf<T>(out));
    }
  }
  static void local(const double* x, const double* y, std::size_t n, double* r) {
    for (std::size_t k = 0; k < n; ++k, r += N) {
      Eigen::Map<TangentOf<T>> out(r);
      out = T::template local<double>(values(x)[k], values(y)[k]);
    }
  }
  static void local_jacobian(const double* x, const double* y, std::size_t n, double* S) {
    for (std::size_t k = 0; k < n; ++k, S += N * N) {
      Eigen::Map<Mat<N, N>> out(S);
      out = mapjoin::local_jacobian<T>(values(x)[k], values(y)[k]);
    }
  }
  static void positions(const double* x, const int* index, std::size_t n, double* out) {
    if constexpr (HasPosition<T>) {
      for (std::size_t k = 0; k < n; ++k, out += D) {
        Eigen::Map<Vec<D>> p(out);
        p = T::position(values(x)[index[k]]);
      }
    }
  }
  static void rotations(const double* x, const int* index, std::size_t n, double* out) {
    if constexpr (HasRotation<T>) {
      for (std::size_t k = 0; k < n; ++k, out += D * D) {
        Eigen::Map<Mat<D, D>> R(out);
        R = T::rotation(values(x)[index[k]]);
      }
    }
  }
  static void directions(const double* x, const int* index, std::size_t n, double* out) {
    if constexpr (HasDirection<T>) {
      for (std::size_t k = 0; k < n; ++k, out += D) {
        Eigen::Map<Vec<D>> u(out);
        u = T::direction(values(x)[index[k]]);
      }
    }
  }
  static void offsets(const double* x, const int* index, std::size_t n, double* out) {
    if constexpr (HasOffset<T>) {
      for (std::size_t k = 0; k < n; ++k) out[k] = T::offset(values(x)[index[k]]);
    }
  }
};

template <VariableType T>
constexpr VariableKind<T::ambient> make_kind() {
  using F = KindFunctions<T>;
  VariableKind<T::ambient> kind;
  kind.tag = Tag(T::name);
  kind.dim = T::dim;
  kind.value_size = kValueSize<T>;
  kind.action = T::action;
  kind.has_position = HasPosition<T>;
  kind.has_rotation = HasRotation<T>;
  kind.transform = &F::transform;
  kind.frame_jacobian = &F::frame_jacobian;
  kind.gauge = &F::gauge;
  kind.retract = &F::retract;
  kind.transport = HasTransport<T> ? &F::transport : nullptr;
  kind.local = &F::local;
  kind.local_jacobian = &F::local_jacobian;
  kind.positions = HasPosition<T> ? &F::positions : nullptr;
  kind.rotations = HasRotation<T> ? &F::rotations : nullptr;
  kind.directions = HasDirection<T> ? &F::directions : nullptr;
  kind.offsets = HasOffset<T> ? &F::offsets : nullptr;
  kind.linearize_relative = &RelativeKernel<T>::linearize;
  kind.gradient_relative = &RelativeKernel<T>::gradient;
  kind.correction_relative = &relative_correction<T>;
  kind.chi2_relative = &RelativeKernel<T>::chi2;
  return kind;
}

template <VariableType T>
inline constexpr VariableKind<T::ambient> kKind = make_kind<T>();

// The library's own types are compiled once, in variable_kind.cpp: nearly every file names them.
extern const VariableKind<2> kPose2, kPoint2;
extern const VariableKind<3> kPose3, kPoint3;

template <class T>
inline constexpr const VariableKind<T::ambient>* kCompiledKind = nullptr;
template <>
inline constexpr const VariableKind<2>* kCompiledKind<Pose2> = &kPose2;
template <>
inline constexpr const VariableKind<3>* kCompiledKind<Pose3> = &kPose3;
template <>
inline constexpr const VariableKind<2>* kCompiledKind<Point2> = &kPoint2;
template <>
inline constexpr const VariableKind<3>* kCompiledKind<Point3> = &kPoint3;

}  // namespace detail

/// The one description of type T. Types are the same when their tags are.
template <VariableType T>
constexpr const VariableKind<T::ambient>& kind_of() {
  if constexpr (detail::kCompiledKind<T> != nullptr) {
    return *detail::kCompiledKind<T>;
  } else {
    return detail::kKind<T>;
  }
}

}  // namespace mapjoin
