#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

namespace mapjoin {

/// Fixed-size unaligned matrix and vector: what variables are made of.
template <int Rows, int Cols, class S = double>
using Mat =
    Eigen::Matrix<S, Rows, Cols,
                  Eigen::DontAlign | (Rows == 1 && Cols > 1 ? Eigen::RowMajor : Eigen::ColMajor)>;
template <int Rows, class S = double>
using Vec = Mat<Rows, 1, S>;

/// Number of rotational degrees of freedom: 1 in the plane, 3 in space.
template <int D>
inline constexpr int kRotation = D == 2 ? 1 : 3;

/// [v]x: skew(v) w = v x w.
template <class Derived>
Mat<3, 3, typename Derived::Scalar> skew(const Eigen::MatrixBase<Derived>& v) {
  using S = typename Derived::Scalar;
  Mat<3, 3, S> out;
  out << S(0), -v(2), v(1), v(2), S(0), -v(0), -v(1), v(0), S(0);
  return out;
}

namespace detail {

// Of a vector of three. Like all below by components: as expressions of vectors these few functions
// cost the compiler most of a second for every scalar type.
template <class S>
S square_of(const Vec<3, S>& v) {
  return v(0) * v(0) + v(1) * v(1) + v(2) * v(2);
}

// A = s v v^T.
template <class S>
void set_symmetric(Mat<3, 3, S>& A, const S& s, const Vec<3, S>& v) {
  A(0, 0) = s * (v(0) * v(0));
  A(1, 1) = s * (v(1) * v(1));
  A(2, 2) = s * (v(2) * v(2));
  A(1, 0) = A(0, 1) = s * (v(0) * v(1));
  A(2, 0) = A(0, 2) = s * (v(0) * v(2));
  A(2, 1) = A(1, 2) = s * (v(1) * v(2));
}

// A += s [v]x.
template <class S>
void add_skew(Mat<3, 3, S>& A, const S& s, const Vec<3, S>& v) {
  const S x = s * v(0), y = s * v(1), z = s * v(2);
  A(0, 1) -= z;
  A(0, 2) += y;
  A(1, 0) += z;
  A(1, 2) -= x;
  A(2, 0) -= y;
  A(2, 1) += x;
}

// sin(x)/x and (1-cos(x))/x^2 as functions of q = x^2: smooth at zero, so derivatives by dual
// numbers exist there.
template <class S>
S sinc_of_square(const S& q) {
  using std::sin;
  using std::sqrt;
  if (q < 1e-6) return S(1) - q / S(6) + q * q / S(120);
  const S x = sqrt(q);
  return sin(x) / x;
}
template <class S>
S cosc_of_square(const S& q) {
  using std::cos;
  using std::sqrt;
  if (q < 1e-6) return S(0.5) - q / S(24) + q * q / S(720);
  const S x = sqrt(q);
  return (S(1) - cos(x)) / q;
}

// atan(sqrt(u)) / sqrt(u) for |u| < kSmallSquare, to rounding: no square root, no arc tangent.
inline constexpr double kSmallSquare = 0.01;
template <class S>
S atanc_of_square(const S& u) {
  S sum(1.0 / 17);
  for (int k = 15; k >= 1; k -= 2) sum = S(1.0 / k) - u * sum;
  return sum;
}

// (1 - h cot h) / (4 h^2) for h^2 = q < kSmallSquare, likewise.
template <class S>
S cotc_of_square(const S& q) {
  return S(1.0 / 12) +
         q * (S(1.0 / 180) +
              q * (S(1.0 / 1890) +
                   q * (S(1.0 / 18900) + q * (S(1.0 / 187110) + q * S(691.0 / 1277025750)))));
}

// Quaternion (x, y, z, w) of a rotation matrix by the branch that divides by the largest component.
template <class S>
Vec<4, S> quaternion_of(const Mat<3, 3, S>& R) {
  using std::sqrt;
  Vec<4, S> q;
  const S trace = R(0, 0) + R(1, 1) + R(2, 2);
  if (trace > 0.0) {
    const S s = sqrt(trace + S(1));
    const S k = S(0.5) / s;
    q << (R(2, 1) - R(1, 2)) * k, (R(0, 2) - R(2, 0)) * k, (R(1, 0) - R(0, 1)) * k, S(0.5) * s;
    return q;
  }
  int i = 0;
  if (R(1, 1) > R(0, 0)) i = 1;
  if (R(2, 2) > R(i, i)) i = 2;
  const int j = (i + 1) % 3;
  const int k = (j + 1) % 3;
  const S s = sqrt(R(i, i) - R(j, j) - R(k, k) + S(1));
  const S inv = S(0.5) / s;
  q(i) = S(0.5) * s;
  q(3) = (R(k, j) - R(j, k)) * inv;
  q(j) = (R(j, i) + R(i, j)) * inv;
  q(k) = (R(k, i) + R(i, k)) * inv;
  return q;
}

}  // namespace detail

/// Rotation matrix of a rotation vector (an angle in the plane), radians.
template <int D, class S>
Mat<D, D, S> rotation_exp(const Vec<kRotation<D>, S>& phi) {
  using std::cos;
  using std::sin;
  Mat<D, D, S> R;
  if constexpr (D == 2) {
    const S c = cos(phi(0));
    const S s = sin(phi(0));
    R << c, -s, s, c;
  } else {
    const S q = detail::square_of(phi);
    const S a = detail::sinc_of_square(q);
    const S b = detail::cosc_of_square(q);
    const S c = S(1) - b * q;
    detail::set_symmetric(R, b, phi);
    for (int k = 0; k < 3; ++k) R(k, k) += c;
    detail::add_skew(R, a, phi);
  }
  return R;
}

/// Rotation vector of a rotation matrix, of length at most pi. Inverse of rotation_exp; this is
/// where angles wrap.
template <int D, class S>
Vec<kRotation<D>, S> rotation_log(const Mat<D, D, S>& R) {
  using std::atan2;
  using std::sqrt;
  if constexpr (D == 2) {
    if (R(0, 0) > 0.0) {
      const S tangent = R(1, 0) / R(0, 0);
      const S u = tangent * tangent;
      if (u < detail::kSmallSquare) return Vec<1, S>(tangent * detail::atanc_of_square(u));
    }
    return Vec<1, S>(atan2(R(1, 0), R(0, 0)));
  } else {
    const Vec<4, S> q = detail::quaternion_of(R);
    const bool other = q(3) < 0.0;
    const S w = other ? S(-q(3)) : S(q(3));
    Vec<3, S> v;
    for (int k = 0; k < 3; ++k) v(k) = other ? S(-q(k)) : S(q(k));
    const S n2 = detail::square_of(v);
    const S w2 = w * w;
    S scale;
    if (n2 < detail::kSmallSquare * w2) {
      scale = S(2) / w * detail::atanc_of_square(S(n2 / w2));
    } else {
      const S n = sqrt(n2);
      scale = S(2) * atan2(n, w) / n;
    }
    for (int k = 0; k < 3; ++k) v(k) = v(k) * scale;
    return v;
  }
}

/// Inverse of the right Jacobian at phi: log(exp(phi) exp(d)) = phi + J_r^-1(phi) d + O(d^2).
/// Identity in the plane.
template <int D, class S>
Mat<kRotation<D>, kRotation<D>, S> inverse_right_jacobian(const Vec<kRotation<D>, S>& phi) {
  using std::sqrt;
  using std::tan;
  Mat<kRotation<D>, kRotation<D>, S> J = Mat<kRotation<D>, kRotation<D>, S>::Identity();
  if constexpr (D == 3) {
    const S q = detail::square_of(phi);
    S c;
    if (q < 4 * detail::kSmallSquare) {
      c = detail::cotc_of_square(S(q * S(0.25)));
    } else {
      const S half = S(0.5) * sqrt(q);
      c = (S(1) - half / tan(half)) / q;
    }
    // I + [phi]x / 2 + c [phi]x^2, and [phi]x^2 = phi phi^T - q
    detail::set_symmetric(J, c, phi);
    J(0, 0) = S(1) - c * (phi(1) * phi(1) + phi(2) * phi(2));
    J(1, 1) = S(1) - c * (phi(0) * phi(0) + phi(2) * phi(2));
    J(2, 2) = S(1) - c * (phi(0) * phi(0) + phi(1) * phi(1));
    detail::add_skew(J, S(0.5), phi);
  }
  return J;
}

}  // namespace mapjoin
