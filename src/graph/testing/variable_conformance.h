#pragma once

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>
#include <random>
#include <type_traits>
#include <vector>

#include "mapjoin/graph/variable_kind.h"

/// \file
/// The conformance suite for variable types: for tests, and the only header of this layer that
/// needs GoogleTest.
///
///     Wall::Value<double> random_wall(mapjoin::testing::Generator& generator);
///     MAPJOIN_TEST_VARIABLE(Wall, random_wall);
///
/// defines one test for each law of graph/variable.h. What passes works in frame changes, joins,
/// marginalisation and covariances.

namespace mapjoin::testing {

using Generator = std::mt19937_64;

/// Uniform in [low, high); the same numbers with every standard library.
inline double uniform(Generator& generator, double low, double high) {
  return low + (high - low) * static_cast<double>(generator() >> 11) * 0x1.0p-53;
}

template <int N>
Vec<N> random_vector(Generator& generator, double size) {
  Vec<N> out;
  for (int k = 0; k < N; ++k) out(k) = uniform(generator, -size, size);
  return out;
}

/// A rigid motion with any rotation and a translation within `size`.
template <int D>
Rigid<D> random_motion(Generator& generator, double size = 10.0) {
  Rigid<D> out;
  if constexpr (D == 2) {
    out.R = Eigen::Rotation2Dd(uniform(generator, -3.1, 3.1)).toRotationMatrix();
  } else {
    Vec<3> axis = random_vector<3>(generator, 1.0);
    while (axis.norm() < 0.1) axis = random_vector<3>(generator, 1.0);
    out.R = Eigen::AngleAxisd(uniform(generator, -3.0, 3.0), axis.normalized()).toRotationMatrix();
  }
  out.t = random_vector<D>(generator, size);
  return out;
}

namespace detail {

/// A matrix or vector as checks see it: one type for all sizes, so that checks are compiled once.
struct Numbers {
  const double* data;
  Eigen::Index rows, columns;

  template <int R, int C, int Options>
  Numbers(const Eigen::Matrix<double, R, C, Options>& m)  // NOLINT: a view
      : data(m.data()), rows(m.rows()), columns(m.cols()) {
    static_assert(R == 1 || C == 1 || (Options & Eigen::RowMajor) == 0, "by columns");
  }
  Eigen::Index size() const { return rows * columns; }
  Eigen::Map<const Eigen::MatrixXd> matrix() const { return {data, rows, columns}; }
};

inline bool finite(const Numbers& a) {
  for (Eigen::Index k = 0; k < a.size(); ++k) {
    if (!std::isfinite(a.data[k])) return false;
  }
  return true;
}

/// What is no number is farthest off.
inline double largest(const Numbers& a) {
  double out = 0.0;
  for (Eigen::Index k = 0; k < a.size() && !std::isnan(out); ++k) {
    if (!(std::abs(a.data[k]) <= out)) out = std::abs(a.data[k]);
  }
  return out;
}

inline Eigen::MatrixXd difference(const Numbers& a, const Numbers& b) {
  EXPECT_TRUE(a.rows == b.rows && a.columns == b.columns);
  Eigen::MatrixXd out(a.rows, a.columns);
  for (Eigen::Index k = 0; k < a.size(); ++k) out.data()[k] = a.data[k] - b.data[k];
  return out;
}

inline Eigen::MatrixXd product(const Numbers& a, const Numbers& b) {
  EXPECT_EQ(a.columns, b.rows);
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(a.rows, b.columns);
  for (Eigen::Index c = 0; c < b.columns; ++c) {
    for (Eigen::Index k = 0; k < a.columns; ++k) {
      for (Eigen::Index r = 0; r < a.rows; ++r)
        out(r, c) += a.data[k * a.rows + r] * b.data[c * b.rows + k];
    }
  }
  return out;
}

inline double reciprocal_condition(const Numbers& a) {
  return Eigen::FullPivLU<Eigen::MatrixXd>(a.matrix()).rcond();
}

inline void expect_small(const Numbers& a, const char* what) {
  EXPECT_LT(largest(a), 1e-9) << what << ", off by\n" << a.matrix();
}

inline void expect_same(const Numbers& a, const Numbers& b, double tolerance, const char* what) {
  EXPECT_LT(largest(difference(a, b)), tolerance * std::max(1.0, largest(b)))
      << what << "\nis\n"
      << a.matrix() << "\nand should be\n"
      << b.matrix();
}

inline void expect_close(const double* a, const double* b, int size, const char* what) {
  for (int k = 0; k < size; ++k) EXPECT_NEAR(a[k], b[k], 1e-12 * (1.0 + std::abs(b[k]))) << what;
}

inline void expect_near(double a, double b, double tolerance, const char* what) {
  EXPECT_NEAR(a, b, tolerance) << what;
}

/// Runs a check on as many samples as it takes, until one fails.
inline void for_samples(int samples, const std::function<void(Generator&)>& check) {
  for (int k = 0; k < samples && !::testing::Test::HasFailure(); ++k) {
    SCOPED_TRACE("sample " + std::to_string(k));
    Generator generator(static_cast<std::uint64_t>(k) + 1);
    check(generator);
  }
}

}  // namespace detail

/// The laws of one variable type, each a function that fails the current test where it is broken.
template <class T>
class VariableConformance {
 public:
  static constexpr int D = T::ambient;
  static constexpr int N = T::dim;
  static constexpr int G = kGauge<D>;
  using Value = ValueOf<T>;
  using RandomValue = std::function<Value(Generator&)>;

  /// `step`: how far increments go for which law 1 must hold; below the angle at which yours wrap.
  explicit VariableConformance(RandomValue random_value, double step = 0.5)
      : random_value_(std::move(random_value)), step_(step) {}

  /// A value is scalars in a row, whatever the scalar, and may be copied as such.
  void values_are_scalars_in_a_row() const {
    using S = Dual<2>;
    static_assert(std::is_trivially_destructible_v<Value>, "a map copies values as bytes");
    static_assert(sizeof(Value) % sizeof(double) == 0, "a value holds scalars and nothing else");
    static_assert(sizeof(ValueOf<T, S>) == static_cast<std::size_t>(kValueSize<T>) * sizeof(S),
                  "Value<S> must hold scalars of type S and nothing else");
    EXPECT_GE(T::name.size(), 1U);
    EXPECT_LE(T::name.size(), 8U) << "keys have room for eight characters";
    for_samples([](Generator&, const Value& x) {
      const ValueOf<T, S> lifted = mapjoin::detail::lift<T, S>(x);
      const auto* const scalars = reinterpret_cast<const S*>(&lifted);
      for (int k = 0; k < kValueSize<T>; ++k) {
        detail::expect_near(scalars[k].a, doubles(x)[k], 0.0, "the value of a constant");
        detail::expect_near(detail::largest(scalars[k].v), 0.0, 0.0, "its derivative");
      }
    });
  }

  /// Law 1.
  void local_undoes_retract() const {
    for_samples([&](Generator& generator, const Value& x) {
      expect_close(T::template retract<double>(x, Tangent::Zero()), x, "retract(x, 0) is x");
      detail::expect_small(T::template local<double>(x, x), "local(x, x) is 0");
      for (const double size : {step_, 1e-3, 1e-7, 1e-10}) {
        const Tangent d = random_vector<N>(generator, size);
        const Tangent back =
            T::template local<double>(x, T::template retract<double>(x, Tangent(d)));
        detail::expect_small(detail::difference(back, d), "local(x, retract(x, d)) is d");
      }
    });
  }

  /// Law 2.
  void transform_is_an_action() const {
    for_samples([&](Generator& generator, const Value& x) {
      const auto A = random_motion<D>(generator);
      const auto B = random_motion<D>(generator);
      const Value once = T::template transform<double>(A * B, x);
      const Value twice = T::template transform<double>(A, T::template transform<double>(B, x));
      detail::expect_small(T::template local<double>(once, twice), "(A B) x is A (B x)");
      detail::expect_small(
          T::template local<double>(x, T::template transform<double>(Rigid<D>(), x)),
          "the identity moves nothing");
    });
  }

  /// Law 3, and D as it is given or as the action says against two derivatives.
  void frame_jacobian_is_the_derivative() const {
    if (T::action == FrameAction::kRotating) {
      EXPECT_EQ(N, D) << "a rotating type's tangent is a vector of the map frame";
    }
    for_samples([&](Generator& generator, const Value& x) {
      const auto motion = random_motion<D>(generator);
      const Mat<N, N> J = mapjoin::frame_jacobian<T>(motion, x);
      detail::expect_same(J, mapjoin::detail::frame_jacobian_by_duals<T>(motion, x), 1e-9,
                          "D by dual numbers");
      const Value moved = T::template transform<double>(motion, x);
      detail::expect_same(
          J, differences<N, N>([&](const Tangent& d) {
            return Tangent(T::template local<double>(
                moved, T::template transform<double>(motion, T::template retract<double>(x, d))));
          }),
          1e-6, "D by differences");
      EXPECT_GT(detail::reciprocal_condition(J), 1e-12) << "D is invertible";
    });
  }

  /// Law 4, and g as it is given against two derivatives.
  void gauge_is_the_derivative() const {
    for_samples([&](Generator& generator, const Value& x) {
      const Mat<N, G> g = mapjoin::gauge<T>(x);
      detail::expect_same(g, mapjoin::detail::gauge_by_duals<T>(x), 1e-9, "g by dual numbers");
      detail::expect_same(
          g, differences<N, G>([&](const Vec<G>& xi) {
            Rigid<D> motion;
            motion.R = rotation_exp<D, double>(Vec<kRotation<D>>(xi.template tail<kRotation<D>>()));
            motion.t = xi.template head<D>();
            return Tangent(T::template local<double>(x, T::template transform<double>(motion, x)));
          }),
          1e-6, "g by differences");
      const auto motion = random_motion<D>(generator);
      const Mat<N, G> there = mapjoin::gauge<T>(T::template transform<double>(motion, x));
      const Mat<N, N> J = mapjoin::frame_jacobian<T>(motion, x);
      detail::expect_same(detail::product(there, adjoint(motion)), detail::product(J, g), 1e-9,
                          "g(T x) Ad(T) is D g(x)");
      if (T::action == FrameAction::kInvariant) {
        EXPECT_EQ(detail::largest(g), 0.0) << "no motion touches it";
      }
    });
  }

  /// The derivative of local in its second argument, between values that differ and that do not.
  void local_jacobian_is_the_derivative() const {
    for_samples([&](Generator& generator, const Value& x) {
      detail::expect_same(mapjoin::local_jacobian<T>(x, x), Mat<N, N>(Mat<N, N>::Identity()), 1e-9,
                          "S(x, x) is the identity");
      for (const double size : {step_, 1e-2, 1e-4, 1e-9}) {
        const Value y = T::template retract<double>(x, random_vector<N>(generator, size));
        const Mat<N, N> S = mapjoin::local_jacobian<T>(x, y);
        detail::expect_same(S, mapjoin::detail::local_jacobian_by_duals<T>(x, y), 1e-9,
                            "S by dual numbers");
        detail::expect_same(
            S, differences<N, N>([&](const Tangent& d) {
              return Tangent(T::template local<double>(x, T::template retract<double>(y, d)));
            }),
            1e-6, "S by differences");
      }
    });
  }

  /// retract and local can be differentiated where nothing differs and nothing moves.
  void derivatives_exist_at_zero() const {
    for_samples([](Generator&, const Value& x) {
      const Mat<N, N> E = mapjoin::detail::local_jacobian_by_duals<T>(x, x);
      EXPECT_TRUE(detail::finite(E));
      detail::expect_same(E, Mat<N, N>(Mat<N, N>::Identity()), 1e-9,
                          "d local(x, retract(x, d)) / dd at 0");
      EXPECT_TRUE(detail::finite(mapjoin::detail::frame_jacobian_by_duals<T>(Rigid<D>(), x)));
      EXPECT_TRUE(detail::finite(mapjoin::detail::gauge_by_duals<T>(x)));
    });
  }

  /// Tangents keep their length from one value to another, and come back as they were.
  void transport_turns_tangents() const {
    for_samples([&](Generator& generator, const Value& x) {
      const Value y = random_value_(generator);
      const Tangent d = random_vector<N>(generator, 1.0);
      const Tangent there = mapjoin::transport<T>(x, y, d);
      EXPECT_NEAR(there.norm(), d.norm(), 1e-9) << "transport(x, y, d) is as long as d";
      detail::expect_small(detail::difference(mapjoin::transport<T>(y, x, there), d),
                           "transport(y, x, transport(x, y, d)) - d");
    });
  }

  /// Position, orientation, direction and offset, where a type has them, move as the variable does.
  void what_aligns_moves_along() const {
    for_samples([](Generator& generator, const Value& x) {
      const auto motion = random_motion<D>(generator);
      const Value moved = T::template transform<double>(motion, x);
      if constexpr (HasPosition<T>) {
        detail::expect_same(Vec<D>(T::position(moved)), Vec<D>(motion * Vec<D>(T::position(x))),
                            1e-9, "position(T x) is T position(x)");
      }
      if constexpr (HasRotation<T>) {
        const Mat<D, D> R = T::rotation(x);
        detail::expect_same(Mat<D, D>(T::rotation(moved)), detail::product(motion.R, R), 1e-9,
                            "rotation(T x) is R rotation(x)");
        detail::expect_same(Mat<D, D>(R.transpose() * R), Mat<D, D>(Mat<D, D>::Identity()), 1e-9,
                            "a rotation is orthonormal");
      }
      if constexpr (HasDirection<T>) {
        const Vec<D> u = T::direction(x);
        const Vec<D> u_moved = T::direction(moved);
        EXPECT_NEAR(u.norm(), 1.0, 1e-9) << "a direction is a unit vector";
        detail::expect_same(u_moved, detail::product(motion.R, u), 1e-9,
                            "direction(T x) is R direction(x)");
        if constexpr (HasOffset<T>) {
          const double expected = T::offset(x) + u_moved.dot(motion.t);
          EXPECT_NEAR(T::offset(moved), expected, 1e-9 * (1.0 + std::abs(expected)))
              << "offset(T x) is offset(x) + direction(T x) . t";
        }
      }
    });
  }

  /// What maps call: the same functions over arrays.
  void arrays_are_treated_one_by_one() const {
    Generator generator(5);
    const auto& kind = kind_of<T>();
    std::vector<Value> x, y;
    for (int k = 0; k < 7; ++k) {
      x.push_back(random_value_(generator));
      y.push_back(T::template retract<double>(x.back(), random_vector<N>(generator, step_)));
    }
    const auto motion = random_motion<D>(generator);
    std::vector<double> r(x.size() * N);
    kind.local(doubles(x[0]), doubles(y[0]), x.size(), r.data());
    std::vector<Value> again = x;
    kind.retract(reinterpret_cast<double*>(again.data()), r.data(), x.size());
    std::vector<double> J(x.size() * N * N);
    kind.frame_jacobian(motion, doubles(x[0]), x.size(), J.data());
    std::vector<Value> moved = x;
    kind.transform(motion, reinterpret_cast<double*>(moved.data()), x.size());
    for (std::size_t k = 0; k < x.size(); ++k) {
      detail::expect_small(T::template local<double>(y[k], again[k]), "retract of local");
      expect_close(moved[k], T::template transform<double>(motion, x[k]), "transform");
      const Eigen::Map<const Mat<N, N>> block(J.data() + k * N * N);
      detail::expect_same(Mat<N, N>(block), mapjoin::frame_jacobian<T>(motion, x[k]), 1e-12, "D");
    }
  }

 private:
  using Tangent = Vec<N>;

  static const double* doubles(const Value& x) { return reinterpret_cast<const double*>(&x); }

  template <class Check>
  void for_samples(const Check& check) const {
    detail::for_samples(40,
                        [&](Generator& generator) { check(generator, random_value_(generator)); });
  }

  /// Central differences of f at 0.
  template <int Rows, int Columns, class F>
  static Mat<Rows, Columns> differences(F&& f) {
    constexpr double h = 1e-5;
    Mat<Rows, Columns> out;
    for (int k = 0; k < Columns; ++k) {
      Vec<Columns> d = Vec<Columns>::Zero();
      d(k) = h;
      const Vec<Rows> above = f(d);
      d(k) = -h;
      const Vec<Rows> below = f(d);
      for (int i = 0; i < Rows; ++i) out(i, k) = (above(i) - below(i)) / (2.0 * h);
    }
    return out;
  }

  static void expect_close(const Value& a, const Value& b, const char* what) {
    detail::expect_close(doubles(a), doubles(b), kValueSize<T>, what);
  }

  RandomValue random_value_;
  double step_;
};

}  // namespace mapjoin::testing

#define MAPJOIN_TEST_VARIABLE_LAW(Type, random_value, Name, law)       \
  TEST(Type##VariableConformance, Name) {                              \
    ::mapjoin::testing::VariableConformance<Type>(random_value).law(); \
  }

/// Tests a variable type: its name (an identifier, without ::) and a function Generator& -> value.
/// The values should be all over the place: also at the origin, far away, and near where angles
/// wrap.
#define MAPJOIN_TEST_VARIABLE(Type, random_value)                                                  \
  MAPJOIN_TEST_VARIABLE_LAW(Type, random_value, ValuesAreScalarsInARow,                            \
                            values_are_scalars_in_a_row)                                           \
  MAPJOIN_TEST_VARIABLE_LAW(Type, random_value, LocalUndoesRetract, local_undoes_retract)          \
  MAPJOIN_TEST_VARIABLE_LAW(Type, random_value, TransformIsAnAction, transform_is_an_action)       \
  MAPJOIN_TEST_VARIABLE_LAW(Type, random_value, FrameJacobianIsTheDerivative,                      \
                            frame_jacobian_is_the_derivative)                                      \
  MAPJOIN_TEST_VARIABLE_LAW(Type, random_value, GaugeIsTheDerivative, gauge_is_the_derivative)     \
  MAPJOIN_TEST_VARIABLE_LAW(Type, random_value, LocalJacobianIsTheDerivative,                      \
                            local_jacobian_is_the_derivative)                                      \
  MAPJOIN_TEST_VARIABLE_LAW(Type, random_value, DerivativesExistAtZero, derivatives_exist_at_zero) \
  MAPJOIN_TEST_VARIABLE_LAW(Type, random_value, TransportTurnsTangents, transport_turns_tangents)  \
  MAPJOIN_TEST_VARIABLE_LAW(Type, random_value, WhatAlignsMovesAlong, what_aligns_moves_along)     \
  MAPJOIN_TEST_VARIABLE_LAW(Type, random_value, ArraysAreTreatedOneByOne,                          \
                            arrays_are_treated_one_by_one)                                         \
  static_assert(true, "asks for a semicolon")
