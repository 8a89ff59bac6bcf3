#include "mapjoin/graph/relative_kernel.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
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

}  // namespace
}  // namespace mapjoin
