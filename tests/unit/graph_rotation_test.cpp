#include "mapjoin/graph/rotation.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <vector>

#include "mapjoin/graph/builtin_types.h"
#include "mapjoin/graph/dual.h"
#include "mapjoin/graph/rigid.h"
#include "tests/support/random_maps.h"

namespace mapjoin {
namespace {

using std::numbers::pi;
using test::Dice;

Eigen::Vector3d random_axis(Dice& dice) {
  return Eigen::Vector3d(dice.normal(), dice.normal(), dice.normal()).normalized();
}

// From far below the switches of the series (0.0997 in the plane, twice that in space) to just
// below and at a half turn.
const std::vector<double> kAngles{
    0.0,       1e-300,    1e-20,     1e-12,      1e-9, 1e-8,   1e-7,   9e-5,   1.1e-4,
    1e-3,      9.9e-4,    2e-4,      1e-2,       0.1,  1.0,    2.0,    3.0,    pi / 2,
    pi - 1e-3, pi - 1e-6, pi - 1e-9, pi - 1e-12, 3.14, 0.0996, 0.0997, 0.1993, 0.1994};

TEST(RotationExp, IsTheRotationByAnAngleAboutAnAxis) {
  Dice dice(1);
  for (const double angle : kAngles) {
    for (int k = 0; k < 10; ++k) {
      const Eigen::Vector3d axis = random_axis(dice);
      const Mat<3, 3> R = rotation_exp<3, double>(Vec<3>(angle * axis));
      const Eigen::Matrix3d expected = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
      EXPECT_LT((R - expected).cwiseAbs().maxCoeff(), 4e-15) << angle;
      EXPECT_NEAR(R.determinant(), 1.0, 1e-14);
    }
  }
}

TEST(RotationLog, UndoesExp) {
  Dice dice(2);
  for (const double angle : kAngles) {
    for (int k = 0; k < 20; ++k) {
      const Vec<3> phi = angle * random_axis(dice);
      const Vec<3> back = rotation_log<3, double>(rotation_exp<3, double>(phi));
      EXPECT_LT((back - phi).norm(), 1e-14 + 1e-13 * angle) << angle;
    }
  }
}

TEST(RotationLog, UndoesExpAboutTheAxesAndTheirDiagonals) {
  for (const double angle : kAngles) {
    for (int x = -1; x <= 1; ++x) {
      for (int y = -1; y <= 1; ++y) {
        for (int z = -1; z <= 1; ++z) {
          if (x == 0 && y == 0 && z == 0) continue;
          const Vec<3> phi = angle * Eigen::Vector3d(x, y, z).normalized();
          const Vec<3> back = rotation_log<3, double>(rotation_exp<3, double>(phi));
          EXPECT_LT((back - phi).norm(), 1e-14 + 1e-13 * angle) << angle;
        }
      }
    }
  }
}

TEST(RotationLog, OfAHalfTurnIsOneOfItsTwoVectors) {
  Dice dice(3);
  for (int k = 0; k < 50; ++k) {
    const Eigen::Vector3d axis = random_axis(dice);
    const Mat<3, 3> R = 2.0 * axis * axis.transpose() - Eigen::Matrix3d::Identity();
    const Vec<3> phi = rotation_log<3, double>(R);
    EXPECT_NEAR(phi.norm(), pi, 1e-7);
    EXPECT_LT(std::min((phi - pi * axis).norm(), (phi + pi * axis).norm()), 1e-6);
  }
}

TEST(RotationLog, WrapsInThePlane) {
  for (const double angle : {0.0, 1e-12, 1.0, -3.0, 3.1415, -3.1415}) {
    for (const double turns : {-2.0, 0.0, 1.0}) {
      const auto R = rotation_exp<2, double>(Vec<1>(angle + 2 * pi * turns));
      EXPECT_NEAR((rotation_log<2, double>(R)(0)), angle, 1e-14 * (1 + 10 * std::abs(turns)));
    }
  }
}

/// Jacobian of phi -> log(exp(phi) exp(d)) at d = 0 by duals.
Mat<3, 3> slope_by_duals(const Vec<3>& phi) {
  using S = Dual<3>;
  Vec<3, S> d, base;
  for (int k = 0; k < 3; ++k) {
    d(k) = S::variable(0.0, k);
    base(k) = S(phi(k));
  }
  const Mat<3, 3, S> R = rotation_exp<3, S>(base) * rotation_exp<3, S>(d);
  const Vec<3, S> r = rotation_log<3, S>(R);
  Mat<3, 3> J;
  for (int k = 0; k < 3; ++k) J.row(k) = r(k).v.transpose();
  return J;
}

TEST(InverseRightJacobian, IsTheSlopeOfLog) {
  Dice dice(4);
  for (const double angle : {0.0, 1e-9, 1e-5, 1e-4, 1.1e-4, 5e-3, 9.9e-3, 1.1e-2, 0.3, 2.0, 3.0}) {
    for (int k = 0; k < 10; ++k) {
      const Vec<3> phi = angle * random_axis(dice);
      const Mat<3, 3> J = inverse_right_jacobian<3, double>(phi);
      const double scale = J.cwiseAbs().maxCoeff();
      EXPECT_LT((J - slope_by_duals(phi)).cwiseAbs().maxCoeff(), 1e-9 * scale) << angle;
      // The textbook's inverse of the right Jacobian, by its power series.
      Eigen::Matrix3d series = Eigen::Matrix3d::Zero(), term = Eigen::Matrix3d::Identity();
      for (int n = 0; n < 40; ++n) {
        series += term;
        term = -term * skew(phi) / (n + 2.0);
      }
      EXPECT_LT((J * series - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff(), 1e-11) << angle;
    }
  }
}

TEST(RotationExp, HasDerivativesEverywhere) {
  Dice dice(5);
  for (const double angle : {0.0, 1e-9, 9e-4, 1.1e-3, 0.5, 3.0}) {
    const Vec<3> phi = angle * random_axis(dice);
    using S = Dual<3>;
    Vec<3, S> x;
    for (int k = 0; k < 3; ++k) x(k) = S::variable(phi(k), k);
    const Mat<3, 3, S> R = rotation_exp<3, S>(x);
    constexpr double h = 1e-6;
    for (int k = 0; k < 3; ++k) {
      const Vec<3> e = h * Eigen::Vector3d::Unit(k);
      const Mat<3, 3> slope =
          (rotation_exp<3, double>(Vec<3>(phi + e)) - rotation_exp<3, double>(Vec<3>(phi - e))) /
          (2 * h);
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) EXPECT_NEAR(R(i, j).v(k), slope(i, j), 1e-9);
      }
    }
  }
}

TEST(Dual, DifferentiatesEveryFunctionItOffers) {
  Dice dice(6);
  using S = Dual<1>;
  const auto check = [](auto&& f, double x) {
    const double h = 1e-6 * std::max(1.0, std::abs(x));
    const double slope = (f(x + h) - f(x - h)) / (2 * h);
    const S y = f(S::variable(x, 0));
    EXPECT_NEAR(y.a, f(x), 1e-15 * std::max(1.0, std::abs(y.a)));
    EXPECT_NEAR(y.v(0), slope, 1e-7 * std::max(1.0, std::abs(slope)));
  };
  using std::abs, std::acos, std::asin, std::atan2, std::cos, std::exp, std::log, std::sin,
      std::sqrt, std::tan;
  for (int k = 0; k < 50; ++k) {
    const double x = dice.uniform(0.05, 0.95);
    check([](auto v) { return sqrt(v); }, x);
    check([](auto v) { return sin(v) * cos(v) + tan(v); }, x);
    check([](auto v) { return exp(v) / log(v); }, x);
    check([](auto v) { return acos(v) - asin(v); }, x);
    check([](auto v) { return atan2(v, v * v + 1.0) + atan2(v - 2.0, v); }, x);
    check([](auto v) { return abs(-v) * 2.0 - 3.0 / v; }, x);
    check(
        [](auto v) {
          auto w = v;
          w += v;
          w *= v;
          w -= v * v * v;
          w /= v + 1.0;
          return w;
        },
        x);
  }
}

template <int D>
void expect_what_three_calls_say(Dice& dice, double turn) {
  using Pose = PoseType<D>;
  const Rigid<D> x = test::random_pose<D>(dice);
  const Rigid<D> y = x * test::random_pose<D>(dice, 1.0, turn);
  Mat<Pose::dim, Pose::dim> S, Sg;
  const Vec<Pose::dim> r = Pose::linearized_local(x, y, S, Sg);
  EXPECT_LT((r - Pose::template local<double>(x, y)).norm(), 1e-13);
  EXPECT_LT((S - Pose::local_jacobian(x, y)).norm(), 1e-13);
  EXPECT_LT((S - detail::local_jacobian_by_duals<Pose>(x, y)).norm(), 1e-12);
  EXPECT_LT((Sg - Pose::local_jacobian(x, y) * Pose::gauge(y)).norm(), 1e-12);
}

TEST(Pose, LinearizesALocalAsItsThreePartsDo) {
  Dice dice(9);
  for (const double turn : {0.0, 1e-6, 0.05, 0.2, 0.5, 3.0}) {
    for (int k = 0; k < 20; ++k) {
      expect_what_three_calls_say<2>(dice, turn);
      expect_what_three_calls_say<3>(dice, turn);
    }
  }
}

TEST(Rigid, AdjointCarriesTwists) {
  Dice dice(7);
  const auto exp3 = [](const Vec<6>& xi) {
    Eigen::Matrix4d twist = Eigen::Matrix4d::Zero(), sum = Eigen::Matrix4d::Identity();
    twist.topLeftCorner<3, 3>() = skew(Vec<3>(xi.tail<3>()));
    twist.topRightCorner<3, 1>() = xi.head<3>();
    Eigen::Matrix4d term = Eigen::Matrix4d::Identity();
    for (int n = 1; n < 30; ++n) sum += term = term * twist / n;
    return sum;
  };
  const auto matrix = [](const Rigid3& T) {
    Eigen::Matrix4d M = Eigen::Matrix4d::Identity();
    M.topLeftCorner<3, 3>() = T.R;
    M.topRightCorner<3, 1>() = T.t;
    return M;
  };
  for (int k = 0; k < 20; ++k) {
    const Rigid3 T = test::random_pose<3>(dice);
    Vec<6> xi;
    for (int i = 0; i < 6; ++i) xi(i) = dice.uniform(-1, 1);
    const Eigen::Matrix4d left = matrix(T) * exp3(xi) * matrix(T.inverse());
    EXPECT_LT((left - exp3(adjoint(T) * xi)).cwiseAbs().maxCoeff(), 1e-10);
    // The plane is the space with everything else held.
    const Rigid2 T2 = test::random_pose<2>(dice);
    Rigid3 lifted;
    lifted.R.topLeftCorner<2, 2>() = T2.R;
    lifted.t << T2.t, 0.0;
    const Mat<6, 6> Ad = adjoint(lifted);
    const int rows[3] = {0, 1, 5};
    const Mat<3, 3> small = adjoint(T2);
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) EXPECT_NEAR(small(i, j), Ad(rows[i], rows[j]), 1e-12);
    }
  }
}

}  // namespace
}  // namespace mapjoin
