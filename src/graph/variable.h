#pragma once

#include <cstring>

#include "mapjoin/graph/dual.h"
#include "mapjoin/graph/rigid.h"
#include "mapjoin/graph/variable_requirements.h"

/// \file
/// What a variable type is.
///
/// A *variable type* T is a struct of static members (never instantiated) that says how one kind of
/// unknown behaves. A user adds one by writing such a struct; nothing under src/ changes.
///
///     struct T {
///       static constexpr int ambient = 2;  // it lives in the plane (2) or in space (3)
///       static constexpr int dim = 2;      // of its tangent
///       static constexpr std::string_view name = "wall";  // at most 8 characters: wall:12
///       static constexpr FrameAction action = FrameAction::kGeneral;
///       template <class S>
///       using Value = ...;  // nothing but scalars S inside: doubles in a row in memory
///       template <class S>  // x [+] d
///       static Value<S> retract(const Value<S>& x, const Vec<dim, S>& d);
///       template <class S>  // y [-] x
///       static Vec<dim, S> local(const Value<S>& x, const Value<S>& y);
///       template <class S>  // x as it looks from the frame that T leads into
///       static Value<S> transform(const Rigid<ambient, S>& T, const Value<S>& x);
///     };
///
/// docs/variable_types.md goes through it; examples/line2.h, plane3.h and bias.h are such types. A
/// mistake is a compile error that names the member (graph/variable_requirements.h).
///
/// Laws (the conformance suite checks them):
///   1. local(x, retract(x, d)) = d for small d, and retract(x, 0) = x.
///   2. transform(A * B, x) = transform(A, transform(B, x)).
///   3. D(T, x) = d local(T x, T retract(x, d)) / dd at d = 0 is invertible.
///   4. g(x) = d local(x, Exp(xi) x) / d xi satisfies g(T x) Ad(T) = D(T, x) g(x).
/// All functions are smooth where d, the difference, or the angle is zero: they are differentiated
/// there.
///
/// Optional members, used when present:
///
///     frame_jacobian(T, x) -> dim x dim      D, instead of the derivative by dual numbers
///     gauge(x) -> dim x kGauge<ambient>      g, likewise
///     local_jacobian(x, y) -> dim x dim      d local(x, retract(y, d)) / dd at d = 0, likewise
///     linearized_local(x, y, S, Sg) -> Vec<dim>  local, and by reference S = local_jacobian(x, y)
///                                            and S gauge(y), where together they cost less
///     transport(x, y, d) -> Vec<dim>         the tangent at y that does in the map's frame what d
///                                            does at x; keeps lengths, and transport(y, x, .)
///                                            takes it back. Absent: d itself
///     position(x) -> Vec<ambient>            a point that moves with the variable
///     rotation(x) -> Mat<ambient, ambient>   an orientation that moves with it
///     direction(x) -> Vec<ambient>           a unit vector that turns with it
///     offset(x) -> double                    of a line of the plane or a plane of space: it is the
///                                            points p with direction(x) . p = offset(x)
///
/// The last four are what align() lays maps on one another by. A type without them is estimated all
/// the same; it cannot be all that two maps share.

namespace mapjoin {

/// In signatures: what T lacks is said before anything else can fail.
template <class T, class S = double>
using ValueOf = typename detail::Described<T>::template Value<S>;
template <class T, class S = double>
using TangentOf = Vec<T::dim, S>;

/// Number of doubles in a value.
template <class T>
inline constexpr int kValueSize = static_cast<int>(sizeof(ValueOf<T>) / sizeof(double));

namespace detail {

/// The value with every scalar made a constant of type S. Values are scalars in a row, so this
/// needs no user code.
template <class T, class S>
ValueOf<T, S> lift(const ValueOf<T>& x) {
  static_assert(sizeof(ValueOf<T, S>) == static_cast<std::size_t>(kValueSize<T>) * sizeof(S),
                "Value<S> must hold scalars of type S and nothing else");
  double scalars[static_cast<std::size_t>(kValueSize<T>)];
  std::memcpy(scalars, &x, sizeof(scalars));
  ValueOf<T, S> out;
  S* const to = reinterpret_cast<S*>(&out);
  for (int k = 0; k < kValueSize<T>; ++k) to[k] = S(scalars[k]);
  return out;
}

template <int N>
Vec<N, Dual<N>> seeds() {
  Vec<N, Dual<N>> d;
  for (int k = 0; k < N; ++k) d(k) = Dual<N>::variable(0.0, k);
  return d;
}

template <int Rows, int N>
Mat<Rows, N> gradients(const Vec<Rows, Dual<N>>& r) {
  Mat<Rows, N> J;
  for (int i = 0; i < Rows; ++i) {
    for (int k = 0; k < N; ++k) J(i, k) = r(i).v(k);
  }
  return J;
}

template <class T>
Mat<T::dim, T::dim> frame_jacobian_by_duals(const Rigid<T::ambient>& rigid, const ValueOf<T>& x) {
  using S = Dual<T::dim>;
  const auto moved = T::template transform<S>(
      rigid.template cast<S>(), T::template retract<S>(lift<T, S>(x), seeds<T::dim>()));
  return gradients<T::dim, T::dim>(
      T::template local<S>(lift<T, S>(T::template transform<double>(rigid, x)), moved));
}

template <class T>
Mat<T::dim, kGauge<T::ambient>> gauge_by_duals(const ValueOf<T>& x) {
  constexpr int D = T::ambient;
  constexpr int G = kGauge<D>;
  using S = Dual<G>;
  const Vec<G, S> xi = seeds<G>();
  Rigid<D, S> motion;
  motion.R = rotation_exp<D, S>(xi.template tail<kRotation<D>>());
  motion.t = xi.template head<D>();
  return gradients<T::dim, G>(
      T::template local<S>(lift<T, S>(x), T::template transform<S>(motion, lift<T, S>(x))));
}

template <class T>
Mat<T::dim, T::dim> local_jacobian_by_duals(const ValueOf<T>& x, const ValueOf<T>& y) {
  using S = Dual<T::dim>;
  return gradients<T::dim, T::dim>(
      T::template local<S>(lift<T, S>(x), T::template retract<S>(lift<T, S>(y), seeds<T::dim>())));
}

}  // namespace detail

/// D(T, x) = d local(T x, T retract(x, d)) / dd at d = 0: how tangents at x become tangents at T x.
template <VariableType T>
Mat<T::dim, T::dim> frame_jacobian(const Rigid<T::ambient>& rigid, const ValueOf<T>& x) {
  if constexpr (HasFrameJacobian<T>) {
    return T::frame_jacobian(rigid, x);
  } else if constexpr (T::action == FrameAction::kBody || T::action == FrameAction::kInvariant) {
    return Mat<T::dim, T::dim>::Identity();
  } else if constexpr (T::action == FrameAction::kRotating) {
    return rigid.R;
  } else {
    return detail::frame_jacobian_by_duals<T>(rigid, x);
  }
}

/// Gauge rows g(x) = d local(x, Exp(xi) x) / d xi, xi = (translation, rotation): how x moves when
/// its whole map does.
template <VariableType T>
Mat<T::dim, kGauge<T::ambient>> gauge(const ValueOf<T>& x) {
  if constexpr (HasGauge<T>) {
    return T::gauge(x);
  } else if constexpr (T::action == FrameAction::kInvariant) {
    return Mat<T::dim, kGauge<T::ambient>>::Zero();
  } else {
    return detail::gauge_by_duals<T>(x);
  }
}

/// S = d local(x, retract(y, d)) / dd at d = 0: the block that stands in A where two estimates x, y
/// disagree.
template <VariableType T>
Mat<T::dim, T::dim> local_jacobian(const ValueOf<T>& x, const ValueOf<T>& y) {
  if constexpr (HasLocalJacobian<T>) {
    return T::local_jacobian(x, y);
  } else {
    return detail::local_jacobian_by_duals<T>(x, y);
  }
}

/// local(x, y); sets S = local_jacobian(x, y) and Sg = S gauge(y).
template <VariableType T>
Vec<T::dim> linearized_local(const ValueOf<T>& x, const ValueOf<T>& y, Mat<T::dim, T::dim>& S,
                             Mat<T::dim, kGauge<T::ambient>>& Sg) {
  if constexpr (requires { T::linearized_local(x, y, S, Sg); }) {
    return T::linearized_local(x, y, S, Sg);
  } else {
    S = local_jacobian<T>(x, y);
    Sg.noalias() = S * gauge<T>(y);
    return T::template local<double>(x, y);
  }
}

/// The tangent at y that does in the map's frame what d does at x.
template <VariableType T>
TangentOf<T> transport(const ValueOf<T>& x, const ValueOf<T>& y, const TangentOf<T>& d) {
  if constexpr (HasTransport<T>) {
    return T::transport(x, y, d);
  } else {
    return d;
  }
}

}  // namespace mapjoin
