#pragma once

#include <Eigen/Core>
#include <cmath>

namespace mapjoin {

/// Forward-mode dual number: a value and its derivative along N directions.
///
/// Enough of one to differentiate a variable type's `local` and `transform`; see graph/variable.h.
/// Comparisons look at the value alone.
template <int N>
struct Dual {
  using Gradient = Eigen::Matrix<double, N, 1, Eigen::DontAlign>;

  double a = 0.0;
  Gradient v = Gradient::Zero();

  Dual() = default;
  Dual(double value) : a(value) {}  // NOLINT(google-explicit-constructor): numbers are constants
  Dual(double value, const Gradient& gradient) : a(value), v(gradient) {}

  /// The independent variable of direction k.
  static Dual variable(double value, int k) {
    Dual out(value);
    out.v(k) = 1.0;
    return out;
  }

  /// A function of x, y with partial derivatives s, t. Loops: expressions of fixed-size vectors
  /// cost the compiler more than all the rest of a variable type, for every N anew.
  static Dual chain(double value, double s, const Dual& x, double t, const Dual& y) {
    Dual out(value);
    for (int k = 0; k < N; ++k) out.v.data()[k] = s * x.v.data()[k] + t * y.v.data()[k];
    return out;
  }
  static Dual chain(double value, double s, const Dual& x) {
    Dual out(value);
    for (int k = 0; k < N; ++k) out.v.data()[k] = s * x.v.data()[k];
    return out;
  }

  Dual operator-() const { return chain(-a, -1.0, *this); }
  Dual& operator+=(const Dual& o) { return *this = *this + o; }
  Dual& operator-=(const Dual& o) { return *this = *this - o; }
  Dual& operator*=(const Dual& o) { return *this = *this * o; }
  Dual& operator/=(const Dual& o) { return *this = *this / o; }

  friend Dual operator+(const Dual& x, const Dual& y) { return chain(x.a + y.a, 1.0, x, 1.0, y); }
  friend Dual operator-(const Dual& x, const Dual& y) { return chain(x.a - y.a, 1.0, x, -1.0, y); }
  friend Dual operator*(const Dual& x, const Dual& y) { return chain(x.a * y.a, y.a, x, x.a, y); }
  friend Dual operator/(const Dual& x, const Dual& y) {
    const double inverse = 1.0 / y.a;
    const double q = x.a * inverse;
    return chain(q, inverse, chain(q, 1.0, x, -q, y));
  }
  friend bool operator<(const Dual& x, const Dual& y) { return x.a < y.a; }
  friend bool operator>(const Dual& x, const Dual& y) { return x.a > y.a; }
  friend bool operator<=(const Dual& x, const Dual& y) { return x.a <= y.a; }
  friend bool operator>=(const Dual& x, const Dual& y) { return x.a >= y.a; }
  friend bool operator==(const Dual& x, const Dual& y) { return x.a == y.a; }
  friend bool operator!=(const Dual& x, const Dual& y) { return x.a != y.a; }
};

template <int N>
Dual<N> sqrt(const Dual<N>& x) {
  const double r = std::sqrt(x.a);
  return Dual<N>::chain(r, 0.5 / r, x);
}
template <int N>
Dual<N> sin(const Dual<N>& x) {
  return Dual<N>::chain(std::sin(x.a), std::cos(x.a), x);
}
template <int N>
Dual<N> cos(const Dual<N>& x) {
  return Dual<N>::chain(std::cos(x.a), -std::sin(x.a), x);
}
template <int N>
Dual<N> tan(const Dual<N>& x) {
  const double t = std::tan(x.a);
  return Dual<N>::chain(t, 1.0 + t * t, x);
}
template <int N>
Dual<N> exp(const Dual<N>& x) {
  const double e = std::exp(x.a);
  return Dual<N>::chain(e, e, x);
}
template <int N>
Dual<N> log(const Dual<N>& x) {
  return Dual<N>::chain(std::log(x.a), 1.0 / x.a, x);
}
template <int N>
Dual<N> atan2(const Dual<N>& y, const Dual<N>& x) {
  const double n = x.a * x.a + y.a * y.a;
  const double angle = std::atan2(y.a, x.a);
  return Dual<N>::chain(angle, x.a / n, y, -y.a / n, x);
}
template <int N>
Dual<N> acos(const Dual<N>& x) {
  return Dual<N>::chain(std::acos(x.a), -1.0 / std::sqrt(1.0 - x.a * x.a), x);
}
template <int N>
Dual<N> asin(const Dual<N>& x) {
  return Dual<N>::chain(std::asin(x.a), 1.0 / std::sqrt(1.0 - x.a * x.a), x);
}
template <int N>
Dual<N> abs(const Dual<N>& x) {
  return x.a < 0 ? -x : x;
}

}  // namespace mapjoin

namespace Eigen {

template <int N>
struct NumTraits<mapjoin::Dual<N>> : NumTraits<double> {
  using Real = mapjoin::Dual<N>;
  using NonInteger = mapjoin::Dual<N>;
  using Nested = mapjoin::Dual<N>;
  using Literal = mapjoin::Dual<N>;
  enum {
    IsComplex = 0,
    IsInteger = 0,
    IsSigned = 1,
    RequireInitialization = 1,
    ReadCost = 1 + N,
    AddCost = 1 + N,
    MulCost = 3 + 2 * N
  };
};

template <int N, class BinaryOp>
struct ScalarBinaryOpTraits<mapjoin::Dual<N>, double, BinaryOp> {
  using ReturnType = mapjoin::Dual<N>;
};
template <int N, class BinaryOp>
struct ScalarBinaryOpTraits<double, mapjoin::Dual<N>, BinaryOp> {
  using ReturnType = mapjoin::Dual<N>;
};

}  // namespace Eigen
