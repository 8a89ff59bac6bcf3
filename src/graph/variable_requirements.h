#pragma once

#include <concepts>
#include <string_view>
#include <type_traits>

#include "mapjoin/graph/dual.h"
#include "mapjoin/graph/rigid.h"

/// \file
/// What a variable type must have, one requirement at a time, and what the compiler says when it
/// does not. graph/variable.h describes variable types; nobody needs this file but the curious.
///
/// A failed concept makes a compiler list candidates and constraints, and the member at fault
/// stands somewhere below. A failed static_assert is its first error, in words. So the concept
/// VariableType asserts: asked of a type that is none, it is an error that names the function, not
/// false.

namespace mapjoin {

/// How a change of frame x' = T x acts on tangents: the D of law 3, by kind, so that the common
/// ones cost nothing.
enum class FrameAction {
  kBody,       ///< D = E: tangents are written in the variable's own frame (poses)
  kRotating,   ///< D = R, dim = ambient: tangents are vectors of the map frame (points)
  kInvariant,  ///< D = E and g = 0: no frame change touches it (a bias, a scale)
  kGeneral     ///< anything else
};

namespace detail {

template <class M>
concept Matrix = requires {
  M::RowsAtCompileTime;
  M::ColsAtCompileTime;
};

/// May a From be returned where a To is wanted? Eigen converts matrices of any size to any other as
/// far as the type system can see, so their sizes are compared.
template <class From, class To>
constexpr bool gives() {
  using Plain = std::remove_cvref_t<From>;
  if constexpr (Matrix<Plain> && Matrix<To>) {
    return static_cast<int>(Plain::RowsAtCompileTime) == static_cast<int>(To::RowsAtCompileTime) &&
           static_cast<int>(Plain::ColsAtCompileTime) == static_cast<int>(To::ColsAtCompileTime) &&
           std::is_same_v<typename Plain::Scalar, typename To::Scalar>;
  } else {
    return Matrix<Plain> == Matrix<To> && std::is_convertible_v<From, To>;
  }
}
template <class From, class To>
concept Gives = gives<From, To>();

template <class T, class S = double>
using RawValue = typename T::template Value<S>;

template <class T>
concept HasAmbient = requires {
  { T::ambient } -> std::convertible_to<int>;
}
&&(T::ambient == 2 || T::ambient == 3);
template <class T>
concept HasDim = requires {
  { T::dim } -> std::convertible_to<int>;
}
&&(T::dim >= 1);
template <class T>
concept HasName = requires {
  { T::name } -> std::convertible_to<std::string_view>;
}
&&(std::string_view(T::name).size() >= 1 && std::string_view(T::name).size() <= 8);
template <class T>
concept HasAction = requires {
  { T::action } -> std::convertible_to<FrameAction>;
};
template <class T>
concept HasValue = requires {
  typename T::template Value<double>;
  typename T::template Value<Dual<2>>;
}
&&std::is_trivially_destructible_v<RawValue<T>> && (sizeof(RawValue<T>) % sizeof(double) == 0) &&
    (sizeof(RawValue<T, Dual<2>>) == sizeof(RawValue<T>) / sizeof(double) * sizeof(Dual<2>));

// The functions, for one scalar.
template <class T, class S>
concept RetractsBy = requires(const RawValue<T, S>& x, const Vec<T::dim, S>& d) {
  { T::template retract<S>(x, d) } -> Gives<RawValue<T, S>>;
};
template <class T, class S>
concept ComparesBy = requires(const RawValue<T, S>& x, const RawValue<T, S>& y) {
  { T::template local<S>(x, y) } -> Gives<Vec<T::dim, S>>;
};
template <class T, class S>
concept MovesBy = requires(const Rigid<T::ambient, S>& motion, const RawValue<T, S>& x) {
  { T::template transform<S>(motion, x) } -> Gives<RawValue<T, S>>;
};

template <class T>
concept HasRetract = RetractsBy<T, double> && RetractsBy<T, Dual<2>>;
template <class T>
concept HasLocal = ComparesBy<T, double> && ComparesBy<T, Dual<2>>;
template <class T>
concept HasTransform = MovesBy<T, double> && MovesBy<T, Dual<2>>;

// Optional members: absent, or right. One that is there and wrong must not be passed over silently.
template <class T>
concept NamesFrameJacobian = requires {
  &T::frame_jacobian;
};
template <class T>
concept NamesGauge = requires {
  &T::gauge;
};
template <class T>
concept NamesLocalJacobian = requires {
  &T::local_jacobian;
};
template <class T>
concept NamesTransport = requires {
  &T::transport;
};
template <class T>
concept NamesPosition = requires {
  &T::position;
};
template <class T>
concept NamesRotation = requires {
  &T::rotation;
};
template <class T>
concept NamesDirection = requires {
  &T::direction;
};
template <class T>
concept NamesOffset = requires {
  &T::offset;
};

}  // namespace detail

// Optional members, where there are any.
template <class T>
concept HasFrameJacobian = requires(const Rigid<T::ambient>& motion, const detail::RawValue<T>& x) {
  { T::frame_jacobian(motion, x) } -> detail::Gives<Mat<T::dim, T::dim>>;
};
template <class T>
concept HasGauge = requires(const detail::RawValue<T>& x) {
  { T::gauge(x) } -> detail::Gives<Mat<T::dim, kGauge<T::ambient>>>;
};
template <class T>
concept HasLocalJacobian = requires(const detail::RawValue<T>& x, const detail::RawValue<T>& y) {
  { T::local_jacobian(x, y) } -> detail::Gives<Mat<T::dim, T::dim>>;
};
template <class T>
concept HasTransport = requires(const detail::RawValue<T>& x, const detail::RawValue<T>& y,
                                const Vec<T::dim>& d) {
  { T::transport(x, y, d) } -> detail::Gives<Vec<T::dim>>;
};
template <class T>
concept HasPosition = requires(const detail::RawValue<T>& x) {
  { T::position(x) } -> detail::Gives<Vec<T::ambient>>;
};
template <class T>
concept HasRotation = requires(const detail::RawValue<T>& x) {
  { T::rotation(x) } -> detail::Gives<Mat<T::ambient, T::ambient>>;
};
template <class T>
concept HasDirection = requires(const detail::RawValue<T>& x) {
  { T::direction(x) } -> detail::Gives<Vec<T::ambient>>;
};
template <class T>
concept HasOffset = requires(const detail::RawValue<T>& x) {
  { T::offset(x) } -> std::convertible_to<double>;
};

namespace detail {

/// T with its members checked. What depends on something missing is not asked for, so that one
/// mistake is one error.
template <class T>
struct Described {
  static_assert(HasAmbient<T>,
                "variable type: `ambient` is missing or wrong: "
                "public: static constexpr int ambient = 2; (the plane) or 3 (space)");
  static_assert(HasDim<T>,
                "variable type: `dim` is missing or wrong: "
                "public: static constexpr int dim = (numbers in a tangent, at least 1);");
  static_assert(HasName<T>,
                "variable type: `name` is missing or wrong: "
                "public: static constexpr std::string_view name = (1 to 8 characters);");
  static_assert(HasAction<T>,
                "variable type: `action` is missing or wrong: "
                "public: static constexpr FrameAction action = FrameAction::kGeneral;");
  static_assert(HasValue<T>,
                "variable type: `Value` is missing or wrong: public: template <class S> using "
                "Value = ...; (or a struct) holding scalars of type S and nothing else");

  static constexpr bool numbers = HasAmbient<T> && HasDim<T>;
  static constexpr bool stated = numbers && HasName<T> && HasAction<T> && HasValue<T>;
  static_assert(!stated || HasRetract<T>,
                "variable type: `retract` is missing or wrong: public: template <class S> static "
                "Value<S> retract(const Value<S>& x, const Vec<dim, S>& d)");
  static_assert(!stated || HasLocal<T>,
                "variable type: `local` is missing or wrong: public: template <class S> static "
                "Vec<dim, S> local(const Value<S>& x, const Value<S>& y)");
  static_assert(!stated || HasTransform<T>,
                "variable type: `transform` is missing or wrong: public: template <class S> static "
                "Value<S> transform(const Rigid<ambient, S>& T, const Value<S>& x)");

  static constexpr bool complete = stated && HasRetract<T> && HasLocal<T> && HasTransform<T>;
  static_assert(!complete || !NamesFrameJacobian<T> || HasFrameJacobian<T>,
                "variable type: `frame_jacobian` is wrong (leave it out and it is derived): static "
                "Mat<dim, dim> frame_jacobian(const Rigid<ambient>& T, const Value<double>& x)");
  static_assert(!complete || !NamesGauge<T> || HasGauge<T>,
                "variable type: `gauge` is wrong (leave it out and it is derived): static "
                "Mat<dim, kGauge<ambient>> gauge(const Value<double>& x)");
  static_assert(!complete || !NamesLocalJacobian<T> || HasLocalJacobian<T>,
                "variable type: `local_jacobian` is wrong (leave it out and it is derived): static "
                "Mat<dim, dim> local_jacobian(const Value<double>& x, const Value<double>& y)");
  static_assert(!complete || !NamesTransport<T> || HasTransport<T>,
                "variable type: `transport` is wrong (leave it out and tangents stay as they are): "
                "static Vec<dim> transport(const Value<double>& x, const Value<double>& y, "
                "const Vec<dim>& d)");
  static_assert(!complete || !NamesPosition<T> || HasPosition<T>,
                "variable type: `position` is wrong: static Vec<ambient> "
                "position(const Value<double>& x)");
  static_assert(!complete || !NamesRotation<T> || HasRotation<T>,
                "variable type: `rotation` is wrong: static Mat<ambient, ambient> "
                "rotation(const Value<double>& x)");
  static_assert(!complete || !NamesDirection<T> || HasDirection<T>,
                "variable type: `direction` is wrong: static Vec<ambient> "
                "direction(const Value<double>& x)");
  static_assert(!complete || !NamesOffset<T> || HasOffset<T>,
                "variable type: `offset` is wrong: static double offset(const Value<double>& x)");
  static_assert(!complete || !HasOffset<T> || HasDirection<T>,
                "variable type: `direction` is missing: an `offset` is measured along it");
  static constexpr bool rotating_vector() {
    if constexpr (complete) {
      return T::action != FrameAction::kRotating || T::dim == T::ambient;
    } else {
      return true;
    }
  }
  static_assert(rotating_vector(),
                "variable type: `action` is wrong: FrameAction::kRotating is for tangents that are "
                "vectors of the map frame, dim == ambient; say FrameAction::kGeneral");

  template <class S>
  using Value = RawValue<T, S>;
};

}  // namespace detail

/// A type of variable; graph/variable.h says what that is. Not a question but a demand: where T is
/// none, compiling ends with an error that names what is missing or wrong.
template <class T>
concept VariableType = detail::Described<T>::complete;

}  // namespace mapjoin
