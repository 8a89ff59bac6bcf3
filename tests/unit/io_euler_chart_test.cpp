#include "mapjoin/io/euler_chart.h"

#include <gtest/gtest.h>

#include <cmath>

#include "mapjoin/graph/builtin_types.h"

namespace mapjoin {
namespace {

const Vec<3> kEulerAngles[] = {
    {0, 0, 0}, {0.3, -0.7, 1.1}, {-3.1, 1.4, 2.9}, {1.6, 0.2, -1.7}, {2.0, -1.5, 0.01}};

double wrapped(double angle) { return std::remainder(angle, 2.0 * M_PI); }

TEST(EulerChart, AnglesAreThoseOfTheFileFormat) {
  // R^T = Rx(c) Ry(b) Rz(a) with the matrices the format's authors give.
  for (const Vec<3>& angles : kEulerAngles) {
    const double a = angles(0), b = angles(1), c = angles(2);
    Mat<3, 3> Rx, Ry, Rz;
    Rx << 1, 0, 0, 0, std::cos(c), std::sin(c), 0, -std::sin(c), std::cos(c);
    Ry << std::cos(b), 0, -std::sin(b), 0, 1, 0, std::sin(b), 0, std::cos(b);
    Rz << std::cos(a), std::sin(a), 0, -std::sin(a), std::cos(a), 0, 0, 0, 1;
    const Mat<3, 3> expected = (Rx * Ry * Rz).transpose();
    EXPECT_LT((rotation_from_angles(angles) - expected).norm(), 1e-15);
  }
}

TEST(EulerChart, AnglesComeBack) {
  for (const Vec<3>& angles : kEulerAngles) {
    EXPECT_LT((angles_from_rotation(rotation_from_angles(angles)) - angles).norm(), 1e-13);
  }
}

TEST(EulerChart, RotationsComeBackAtGimbalLock) {
  for (const double b : {M_PI / 2, -M_PI / 2}) {
    const Mat<3, 3> R = rotation_from_angles({0.4, b, -1.3});
    EXPECT_LT((rotation_from_angles(angles_from_rotation(R)) - R).norm(), 1e-12);
  }
}

template <int D>
void expect_chart_matches_differences(const Twist<D>& x) {
  const Rigid<D> pose = pose_from_file_coordinates<D>(x.data());
  const auto B = file_chart_jacobian<D>(pose, x.data());
  constexpr double kStep = 1e-6;
  for (int k = 0; k < kGauge<D>; ++k) {
    Twist<D> d = Twist<D>::Zero();
    d(k) = kStep;
    Twist<D> change = file_coordinates<D>(PoseType<D>::template retract<double>(pose, d)) -
                      file_coordinates<D>(PoseType<D>::template retract<double>(pose, -d));
    for (int i = D; i < kGauge<D>; ++i) change(i) = wrapped(change(i));
    // Relative to the column: near b = pi/2 angles change fast.
    EXPECT_LT((change / (2 * kStep) - B.col(k)).norm(),
              1e-6 * std::max(1.0, B.col(k).squaredNorm()))
        << "column " << k;
  }
  EXPECT_LT(
      (B * inverse_file_chart_jacobian<D>(pose, x.data()) - Mat<kGauge<D>, kGauge<D>>::Identity())
          .norm(),
      1e-12);
}

TEST(EulerChart, PlanarChartMatchesFiniteDifferences) {
  for (const double theta : {0.0, 0.7, -2.9, 3.14159})
    expect_chart_matches_differences<2>({1.0, -2.0, theta});
}

TEST(EulerChart, SpatialChartMatchesFiniteDifferences) {
  for (const Vec<3>& angles : kEulerAngles) {
    Twist<3> x;
    x << 1.0, -2.0, 3.0, angles;
    expect_chart_matches_differences<3>(x);
  }
}

}  // namespace
}  // namespace mapjoin
