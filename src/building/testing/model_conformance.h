#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <utility>

#include "mapjoin/building/model_kind.h"
#include "mapjoin/graph/testing/variable_conformance.h"

/// \file
/// The conformance suite for measurement models.
///
///     MyModel::Measurement some_measurement(mapjoin::testing::Generator& generator);
///     MAPJOIN_TEST_MODEL(MyModel, some_measurement);
///
/// defines one test for each law of building/measurement_model.h. What passes can be built into
/// local maps.

namespace mapjoin::testing {

namespace detail {

/// Column k of derivatives, `columns` of them row by row, against differences: to a millionth of
/// its length, or absolutely.
inline void expect_slope(const Numbers& above, const Numbers& below, double step,
                         const double* derivatives, int k, int columns, const char* what) {
  const Eigen::MatrixXd rise = difference(above, below);
  double off = 0.0, slopes = 0.0, expected = 0.0;
  for (Eigen::Index i = 0; i < rise.size(); ++i) {
    const double slope = rise.data()[i] / step, derivative = derivatives[i * columns + k];
    off += (slope - derivative) * (slope - derivative);
    slopes += slope * slope;
    expected += derivative * derivative;
  }
  EXPECT_LE(std::sqrt(off), 1e-6 * std::max(1.0, std::sqrt(std::min(slopes, expected))))
      << what << ", " << k;
}

}  // namespace detail

/// The laws of one model, each a function that fails the current test where it is broken.
template <class M>
class ModelConformance {
 public:
  using T = typename M::Target;
  static constexpr int D = T::ambient;
  static constexpr int G = kGauge<D>;
  static constexpr int N = T::dim;
  using Z = typename M::Measurement;
  using RandomMeasurement = std::function<Z(Generator&)>;

  explicit ModelConformance(RandomMeasurement random_measurement)
      : random_measurement_(std::move(random_measurement)) {}

  /// Law 1.
  void the_residual_is_zero_where_the_measurement_says() const {
    Generator generator(1);
    for (int k = 0; k < kRounds; ++k) {
      const Z z = random_measurement_(generator);
      const ValueOf<T> x = where(z, generator);
      const Vec<M::dim> r = M::template residual<double>(z, x);
      detail::expect_small(r, "the residual");
    }
  }

  /// Law 2, where pose and target are a little off what was measured.
  void derivatives_are_those_by_differences() const {
    Generator generator(2);
    const ModelKind<D>& kind = model_of<M>();
    for (int k = 0; k < kRounds; ++k) {
      const Situation s = some_situation(generator);
      const Vec<G> a = random_vector<G>(generator, 0.02);
      const Vec<N> b = random_vector<N>(generator, 0.02);
      Vec<M::dim> r;
      double Ja[M::dim * G], Jx[M::dim * N];  // row by row
      kind.linearize(doubles(s.z), doubles(s.pose), a.data(), doubles(s.x), b.data(), r.data(), Ja,
                     Jx);
      const auto residual = [&](const Vec<G>& at, const Vec<N>& there) {
        return Vec<M::dim>(residual_at<M, double>(s.z, s.pose, at, s.x, there));
      };
      EXPECT_LT(detail::largest(detail::difference(residual(a, b), r)), 1e-12);
      const auto moved = [](auto vector, int i, double by) {
        vector(i) += by;
        return vector;
      };
      constexpr double h = 1e-6;
      for (int i = 0; i < G; ++i) {
        detail::expect_slope(residual(moved(a, i, h), b), residual(moved(a, i, -h), b), 2 * h, Ja,
                             i, G, "by the pose");
      }
      for (int i = 0; i < N; ++i) {
        detail::expect_slope(residual(a, moved(b, i, h)), residual(a, moved(b, i, -h)), 2 * h, Jx,
                             i, N, "by the target");
      }
    }
  }

  /// Law 3.
  void moving_everything_changes_nothing() const {
    Generator generator(3);
    for (int k = 0; k < kRounds; ++k) {
      const Situation s = some_situation(generator);
      const Rigid<D> motion = random_motion<D>(generator);
      const Vec<G> a = random_vector<G>(generator, 0.02);
      const auto at = [&](const Rigid<D>& p, const ValueOf<T>& v) {
        return residual_at<M, double>(s.z, p, a, v, Vec<N>::Zero());
      };
      const Vec<M::dim> moved = at(motion * s.pose, T::template transform<double>(motion, s.x));
      detail::expect_small(detail::difference(moved, Vec<M::dim>(at(s.pose, s.x))),
                           "what moving everything changes");
    }
  }

 private:
  static constexpr int kRounds = 50;

  struct Situation {
    Z z;
    Rigid<D> pose;
    ValueOf<T> x;
  };
  template <class Value>
  static const double* doubles(const Value& x) {
    return reinterpret_cast<const double*>(&x);
  }
  static ValueOf<T> where(const Z& z, Generator& generator) {
    if constexpr (CompleteModel<M>) {
      return M::seen(z);
    } else {
      return M::hypothesis(z, uniform(generator, 0.0, 1.0));
    }
  }
  Situation some_situation(Generator& generator) const {
    Situation out{random_measurement_(generator), random_motion<D>(generator), {}};
    out.x = T::template transform<double>(out.pose, where(out.z, generator));
    return out;
  }

  RandomMeasurement random_measurement_;
};

}  // namespace mapjoin::testing

/// Tests all laws of model M on measurements drawn by `random`.
#define MAPJOIN_TEST_MODEL(M, random)                                                       \
  TEST(M##Model, TheResidualIsZeroWhereTheMeasurementSays) {                                \
    ::mapjoin::testing::ModelConformance<M>(random)                                         \
        .the_residual_is_zero_where_the_measurement_says();                                 \
  }                                                                                         \
  TEST(M##Model, DerivativesAreThoseByDifferences) {                                        \
    ::mapjoin::testing::ModelConformance<M>(random).derivatives_are_those_by_differences(); \
  }                                                                                         \
  TEST(M##Model, MovingEverythingChangesNothing) {                                          \
    ::mapjoin::testing::ModelConformance<M>(random).moving_everything_changes_nothing();    \
  }                                                                                         \
  static_assert(::mapjoin::MeasurementModel<M>, "a model as building/measurement_model.h has it")
