#include "mapjoin/graph/correction_kernel.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <type_traits>
#include <vector>

#include "tests/support/random_maps.h"

namespace mapjoin {
namespace {

using test::Dice;
using test::random_pose;

template <VariableType T>
ValueOf<T> random_value(Dice& dice) {
  if constexpr (std::is_same_v<ValueOf<T>, Rigid<T::ambient>>) {
    return random_pose<T::ambient>(dice);
  } else {
    return test::random_point<T::ambient>(dice);
  }
}

/// Measurements of one type between a few poses and variables that share a front's rows.
template <VariableType T>
struct Measurements {
  static constexpr int D = T::ambient, N = T::dim, G = kGauge<D>;
  static constexpr int kCount = 12, kPlaces = 4;

  explicit Measurements(unsigned seed) {
    Dice dice(seed);
    for (int k = 0; k < kPlaces; ++k) {
      poses.push_back(random_pose<D>(dice));
      values.push_back(random_value<T>(dice));
    }
    for (std::int32_t k = 0; k < kCount; ++k) {
      id.push_back(kCount - 1 - k);
      z.push_back(random_value<T>(dice));
      const Mat<N, N> root = Mat<N, N>::Random();
      const Mat<N, N> I = root * root.transpose() + Mat<N, N>::Identity();
      info.insert(info.end(), I.data(), I.data() + N * N);
      const std::int32_t from = k % kPlaces, to = (k * k + 1) % kPlaces;
      slots.insert(slots.end(), {from, to});
      offsets.insert(offsets.end(), {from * G, kPlaces * G + to * N});
    }
  }
  RelativeBatch<D> batch() const {
    return {kCount,
            id.data(),
            reinterpret_cast<const double*>(z.data()),
            info.data(),
            reinterpret_cast<const double*>(poses.data()),
            reinterpret_cast<const double*>(values.data()),
            slots.data(),
            offsets.data()};
  }
  static int rows() { return kPlaces * (G + N); }

  std::vector<Rigid<D>> poses;
  std::vector<ValueOf<T>> values, z;
  std::vector<double> info;
  std::vector<std::int32_t> id, slots, offsets;
};

template <class T>
class RelativeKernelOf : public testing::Test {};
using Types = testing::Types<Pose2, Point2, Pose3, Point3>;
TYPED_TEST_SUITE(RelativeKernelOf, Types);

TYPED_TEST(RelativeKernelOf, AgreesWithItselfOnRightHandSideAndChi2) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const Measurements<TypeParam> m(seed);
    const int rows = m.rows();
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(rows + 1, rows);
    const DenseTarget target{H.data(), rows + 1, rows, nullptr, 0, rows};
    const double chi2 = RelativeKernel<TypeParam>::linearize(m.batch(), target);
    Eigen::VectorXd rhs = Eigen::VectorXd::Zero(rows);
    EXPECT_NEAR(RelativeKernel<TypeParam>::gradient(m.batch(), rhs.data()), chi2, 1e-12 * chi2);
    EXPECT_NEAR(RelativeKernel<TypeParam>::chi2(m.batch()), chi2, 1e-12 * chi2);
    EXPECT_LT((H.row(rows).transpose() - rhs).norm(), 1e-12 * rhs.norm());
    EXPECT_GT(rhs.norm(), 0.0);
  }
}

TYPED_TEST(RelativeKernelOf, IsTheSameWhateverFollowsABatch) {
  const Measurements<TypeParam> m(7);
  const RelativeBatch<TypeParam::ambient> all = m.batch();
  Eigen::VectorXd whole = Eigen::VectorXd::Zero(m.rows()), parts = whole;
  RelativeKernel<TypeParam>::gradient(all, whole.data());
  for (std::size_t first = 0; first < all.size; first += 3) {
    RelativeBatch<TypeParam::ambient> part = all;
    part.size = std::min<std::size_t>(3, all.size - first);
    part.id += first;
    part.slots += 2 * first;
    part.offsets += 2 * first;
    part.following = all.size - first - part.size;
    RelativeKernel<TypeParam>::gradient(part, parts.data());
  }
  EXPECT_EQ(parts, whole);
}

/// Poses and values of m, moved by steps of about `size`.
template <VariableType T>
Measurements<T> moved(Measurements<T> m, Dice& dice, double size) {
  for (auto& pose : m.poses) pose = test::noisy<PoseType<T::ambient>>(dice, pose, size);
  for (auto& value : m.values) value = test::noisy<T>(dice, value, size);
  return m;
}

/// r of measurement k with its pose moved by `a` and its value by `b`.
template <VariableType T>
Vec<T::dim> residual(const Measurements<T>& m, std::size_t k, const Vec<kGauge<T::ambient>>& a,
                     const Vec<T::dim>& b) {
  const auto from = static_cast<std::size_t>(m.slots[2 * k]);
  const auto to = static_cast<std::size_t>(m.slots[2 * k + 1]);
  const auto pose = PoseType<T::ambient>::template retract<double>(m.poses[from], a);
  const auto value = T::template retract<double>(m.values[to], b);
  return T::template local<double>(m.z[static_cast<std::size_t>(m.id[k])],
                                   T::template transform<double>(pose.inverse(), value));
}

TYPED_TEST(RelativeKernelOf, CorrectsNothingButTheGradientWhereNothingMoved) {
  const Measurements<TypeParam> m(3);
  RelativeBatch<TypeParam::ambient> batch = m.batch();
  batch.poses_then = batch.poses;
  batch.values_then = batch.values;
  Eigen::VectorXd expected = Eigen::VectorXd::Zero(m.rows()), rhs = expected;
  const double chi2 = RelativeKernel<TypeParam>::gradient(batch, expected.data());
  EXPECT_NEAR(relative_correction<TypeParam>(batch, rhs.data()), chi2, 1e-12 * chi2);
  EXPECT_LT((rhs - expected).norm(), 1e-12 * expected.norm());
}

TYPED_TEST(RelativeKernelOf, CorrectsByTheDerivativesOfThenAndNow) {
  using T = TypeParam;
  constexpr int G = kGauge<T::ambient>, N = T::dim;
  constexpr double h = 1e-6;
  Dice dice(5);
  const Measurements<T> then(5);
  const Measurements<T> now = moved(then, dice, 0.2);
  RelativeBatch<T::ambient> batch = now.batch();
  batch.poses_then = then.batch().poses;
  batch.values_then = then.batch().values;
  Eigen::VectorXd rhs = Eigen::VectorXd::Zero(then.rows()), expected = rhs;
  relative_correction<T>(batch, rhs.data());
  for (std::size_t k = 0; k < batch.size; ++k) {
    const auto from = static_cast<std::size_t>(then.slots[2 * k]);
    const auto to = static_cast<std::size_t>(then.slots[2 * k + 1]);
    const Vec<G> a =
        PoseType<T::ambient>::template local<double>(then.poses[from], now.poses[from]);
    const Vec<N> b = T::template local<double>(then.values[to], now.values[to]);
    const Vec<N> r = residual(now, k, Vec<G>::Zero(), Vec<N>::Zero());
    const Vec<N> l = residual(then, k, Vec<G>::Zero(), Vec<N>::Zero()) +
                     (residual(then, k, Vec<G>(h * a), Vec<N>(h * b)) -
                      residual(then, k, Vec<G>(-h * a), Vec<N>(-h * b))) /
                         (2.0 * h);
    const Mat<N, N> I = Eigen::Map<const Mat<N, N>>(then.info.data() + then.id[k] * N * N);
    // As a function of a step by tangents of then: what rhs is the negative gradient of.
    const auto f = [&](const Vec<G>& da, const Vec<N>& db) {
      const Vec<G> da_now = transport<PoseType<T::ambient>>(then.poses[from], now.poses[from], da);
      const Vec<N> db_now = transport<T>(then.values[to], now.values[to], db);
      return (r - l).dot(I * residual(then, k, da, db)) +
             l.dot(I * residual(now, k, da_now, db_now));
    };
    for (int c = 0; c < G; ++c) {
      const Vec<G> e = h * Vec<G>::Unit(c);
      expected(then.offsets[2 * k] + c) -=
          (f(e, Vec<N>::Zero()) - f(Vec<G>(-e), Vec<N>::Zero())) / (2.0 * h);
    }
    for (int c = 0; c < N; ++c) {
      const Vec<N> e = h * Vec<N>::Unit(c);
      expected(then.offsets[2 * k + 1] + c) -=
          (f(Vec<G>::Zero(), e) - f(Vec<G>::Zero(), Vec<N>(-e))) / (2.0 * h);
    }
  }
  EXPECT_LT((rhs - expected).norm(), 1e-6 * expected.norm());
}

}  // namespace
}  // namespace mapjoin
