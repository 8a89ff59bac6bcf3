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
      EXPECT_TRUE(r.isZero(1e-9)) << r.transpose();
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
      Eigen::Matrix<double, M::dim, G, G == 1 ? Eigen::ColMajor : Eigen::RowMajor> Ja;
      Eigen::Matrix<double, M::dim, N, N == 1 ? Eigen::ColMajor : Eigen::RowMajor> Jx;
      kind.linearize(doubles(s.z), doubles(s.pose), a.data(), doubles(s.x), b.data(), r.data(),
                     Ja.data(), Jx.data());
      const auto residual = [&](const Vec<G>& da, const Vec<N>& db) {
        return residual_at<M, double>(s.z, s.pose, Vec<G>(a + da), s.x, Vec<N>(b + db));
      };
      EXPECT_TRUE((residual(Vec<G>::Zero(), Vec<N>::Zero()) - r).isZero(1e-12));
      constexpr double h = 1e-6;
      for (int i = 0; i < G; ++i) {
        const Vec<G> step = Vec<G>::Unit(i) * h;
        const Vec<M::dim> slope =
            (residual(step, Vec<N>::Zero()) - residual(-step, Vec<N>::Zero())) / (2 * h);
        EXPECT_TRUE(slope.isApprox(Ja.col(i), 1e-6) || (slope - Ja.col(i)).isZero(1e-6))
            << "by the pose, " << i << ": " << slope.transpose() << " and "
            << Ja.col(i).transpose();
      }
      for (int i = 0; i < N; ++i) {
        const Vec<N> step = Vec<N>::Unit(i) * h;
        const Vec<M::dim> slope =
            (residual(Vec<G>::Zero(), step) - residual(Vec<G>::Zero(), -step)) / (2 * h);
        EXPECT_TRUE(slope.isApprox(Jx.col(i), 1e-6) || (slope - Jx.col(i)).isZero(1e-6))
            << "by the target, " << i << ": " << slope.transpose() << " and "
            << Jx.col(i).transpose();
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
      EXPECT_TRUE((moved - at(s.pose, s.x)).isZero(1e-9));
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
