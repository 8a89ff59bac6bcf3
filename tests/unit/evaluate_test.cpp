#include "mapjoin/evaluation/evaluate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "mapjoin/evaluation/random.h"
#include "mapjoin/evaluation/simulate.h"
#include "mapjoin/frames/anchors.h"

namespace mapjoin {
namespace {

using ::testing::HasSubstr;

template <VariableType T>
TangentOf<T> random_tangent(Random& random, double scale) {
  TangentOf<T> d;
  for (int k = 0; k < T::dim; ++k) d(k) = scale * random.normal();
  return d;
}

template <int D>
Rigid<D> random_pose(Random& random) {
  return PoseType<D>::template retract<double>(Rigid<D>(),
                                               random_tangent<PoseType<D>>(random, 1.0));
}

TEST(Chi2, IsThePlainSumInThePlane) {
  // Written out with angles, as chi2.py does.
  MeasurementGraphBuilder<2> builder;
  Mat<3, 3> information;
  information << 4, 1, 0.5, 1, 3, 0.2, 0.5, 0.2, 9;
  const Mat<2, 2> point_information = (Mat<2, 2>() << 2, 0.3, 0.3, 5).finished();
  builder.add<Pose2>(pose_key(1), pose_key(2), rigid2(1.1, 0.1, 3.1), information);
  builder.add<Point2>(pose_key(2), point_key(7), Vec<2>(0.5, -0.4), point_information);
  const MeasurementGraph<2> graph = std::move(builder).build();
  ValuesBuilder<2> values;
  values.add<Pose2>(pose_key(0), rigid2(9, 9, 9));  // no measurement speaks of it
  values.add<Pose2>(pose_key(1), rigid2(1, 2, 0.3));
  values.add<Pose2>(pose_key(2), rigid2(2, 2.5, -2.8));
  values.add<Point2>(point_key(7), Vec<2>(1.5, 3));
  const Values<2> estimate = std::move(values).build();

  const Rigid2 between = estimate.pose(pose_key(1)).inverse() * estimate.pose(pose_key(2));
  const Rigid2 error = rigid2(1.1, 0.1, 3.1).inverse() * between;
  const Eigen::Vector3d r(error.t(0), error.t(1),
                          std::remainder(-2.8 - 0.3 - 3.1, 2 * std::numbers::pi));
  const double c = std::cos(-2.8), s = std::sin(-2.8);
  const double dx = 1.5 - 2, dy = 3 - 2.5;
  const Eigen::Vector2d p(c * dx + s * dy - 0.5, -s * dx + c * dy + 0.4);
  EXPECT_NEAR(chi2(estimate, graph), r.dot(information * r) + p.dot(point_information * p), 1e-10);
}

TEST(Chi2, DoesNotDependOnTheFrame) {
  SimulationOptions o = simulation_defaults(World::kLandmarks3d);
  o.poses = 6000;  // more than a batch
  Simulation<3> s = simulate<3>(o);
  const double before = chi2(s.truth, s.graph);
  Random random(3);
  s.truth.transform(random_pose<3>(random));
  EXPECT_NEAR(chi2(s.truth, s.graph), before, 1e-8 * before);
}

/// A local map of the same measurements says the same as the measurements.
template <int D>
void expect_submap_equals_measurements() {
  using Pose = PoseType<D>;
  using Point = PointType<D>;
  Random random(5);
  ValuesBuilder<D> values;
  for (std::uint64_t k = 0; k < 3; ++k) {
    values.template add<Pose>(pose_key(k), random_pose<D>(random));
    values.template add<Point>(point_key(k), random_tangent<Point>(random, 2.0));
  }
  const Values<D> estimate = std::move(values).build();

  LocalMap<D> map;
  map.anchor = pose_anchor<D>(pose_key(1));
  const std::vector<std::pair<Key, bool>> terms = {{point_key(2), false},
                                                   {pose_key(0), true},
                                                   {point_key(0), false},
                                                   {pose_key(0), true},  // seen twice
                                                   {pose_key(2), true}};
  std::vector<int> offsets{0};
  const Rigid<D> from_map = estimate.pose(pose_key(1)).inverse();
  Eigen::VectorXd residual;
  for (const auto& [key, is_pose] : terms) {
    Eigen::VectorXd r;
    if (is_pose) {
      const Rigid<D> z = random_pose<D>(random);
      map.template add_term<Pose>(key, z);
      r = Pose::template local<double>(z, from_map * estimate.pose(key));
    } else {
      const Vec<D> z = random_tangent<Point>(random, 1.0);
      map.template add_term<Point>(key, z);
      r = from_map * estimate.point(key) - z;
    }
    const Eigen::Index n = residual.size();
    residual.conservativeResize(n + r.size());
    residual.tail(r.size()) = r;
    offsets.push_back(static_cast<int>(residual.size()));
  }
  const Eigen::Index n = residual.size();
  Eigen::MatrixXd L(n, n);
  for (Eigen::Index k = 0; k < L.size(); ++k) L.data()[k] = random.normal();
  const Eigen::MatrixXd information = L * L.transpose();
  map.information = SymmetricBlockMatrix::from_dense(offsets, information);
  MeasurementGraphBuilder<D> builder;
  builder.add(map);
  const double expected = residual.dot(information * residual);
  EXPECT_NEAR(chi2(estimate, std::move(builder).build()), expected, 1e-9 * expected);
}

TEST(Chi2, CountsALocalMapInThePlane) { expect_submap_equals_measurements<2>(); }
TEST(Chi2, CountsALocalMapInSpace) { expect_submap_equals_measurements<3>(); }

TEST(Chi2, NamesAMissingVariable) {
  MeasurementGraphBuilder<2> builder;
  builder.add<Pose2>(pose_key(1), pose_key(12), rigid2(1, 0, 0), Mat<3, 3>::Identity());
  const MeasurementGraph<2> graph = std::move(builder).build();
  ValuesBuilder<2> values;
  values.add<Pose2>(pose_key(1), rigid2(1, 2, 0.3));
  try {
    chi2(std::move(values).build(), graph);
    FAIL() << "no error";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("pose:12"));
  }
}

TEST(Chi2, OfNothingIsZero) { EXPECT_EQ(chi2(Values<2>(), MeasurementGraph<2>()), 0.0); }

template <int D>
Values<D> three_poses_two_points(double step) {
  ValuesBuilder<D> values;
  for (std::uint64_t k = 0; k < 3; ++k) {
    Rigid<D> pose;
    pose.t(0) = static_cast<double>(k) + (k == 2 ? step : 0.0);
    values.template add<PoseType<D>>(pose_key(k + 4), pose);
  }
  for (std::uint64_t k = 0; k < 2; ++k) {
    Vec<D> point = Vec<D>::Constant(1.0 + static_cast<double>(k));
    point(1) += step;
    values.template add<PointType<D>>(point_key(k), point);
  }
  return std::move(values).build();
}

template <int D>
void expect_deviation_per_coordinate() {
  const Values<D> reference = three_poses_two_points<D>(0.0);
  Values<D> estimate = three_poses_two_points<D>(0.3);
  Random random(9);
  estimate.transform(random_pose<D>(random));
  const Deviation d = deviation(estimate, reference);
  EXPECT_EQ(d.poses, 3U);
  EXPECT_EQ(d.features, 2U);
  EXPECT_NEAR(d.pose_rmse, 0.3 / std::sqrt(2.0 * D), 1e-12);  // one of two poses, one coordinate
  EXPECT_NEAR(d.relative_rmse, 0.3 / std::sqrt(2.0 * D), 1e-12);
  EXPECT_NEAR(d.feature_rmse, 0.3 / std::sqrt(1.0 * D), 1e-12);
  EXPECT_NEAR(d.aligned_feature_rmse, 0.0, 1e-12);  // both moved alike
}

TEST(Deviation, IsPerCoordinateInTheFrameOfTheLowestPose) {
  expect_deviation_per_coordinate<2>();
  expect_deviation_per_coordinate<3>();
}

TEST(Deviation, LooksAtCommonVariablesOnly) {
  const Values<2> reference = three_poses_two_points<2>(0.0);
  ValuesBuilder<2> values;
  values.add<Pose2>(pose_key(5), rigid2(0, 0, 0));
  values.add<Pose2>(pose_key(6), rigid2(1, 0.5, 0));
  values.add<Pose2>(pose_key(99), rigid2(50, 0, 0));
  const Deviation d = deviation(std::move(values).build(), reference);
  EXPECT_EQ(d.poses, 2U);
  EXPECT_EQ(d.features, 0U);
  EXPECT_NEAR(d.pose_rmse, 0.5 / std::sqrt(2.0), 1e-12);
}

TEST(Deviation, OfStrangersIsZeroOfNothing) {
  const Deviation d = deviation(Values<2>(), three_poses_two_points<2>(0.0));
  EXPECT_EQ(d.poses + d.features, 0U);
  EXPECT_EQ(d.pose_rmse, 0.0);
}

}  // namespace
}  // namespace mapjoin
