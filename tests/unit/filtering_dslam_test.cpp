// D-SLAM map joining: relative information, its two limits, recovery by two solvers, its iterated
// form.

#include <gtest/gtest.h>

#include <cmath>

#include "mapjoin/evaluation/evaluate.h"
#include "mapjoin/filtering/dslam.h"
#include "mapjoin/filtering/relative_information.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/frames/gauge.h"
#include "mapjoin/joining/features_only.h"
#include "mapjoin/joining/join.h"
#include "mapjoin/joining/join_all.h"
#include "mapjoin/solvers/covariance.h"
#include "mapjoin/solvers/marginalize.h"
#include "tests/support/dense.h"
#include "tests/support/local_map_chain.h"

namespace mapjoin {
namespace {

using namespace test;  // NOLINT

template <class T>
class DslamFilter : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(DslamFilter, Dimensions);

Eigen::Matrix2Xd scattered(Dice& dice, int n) {
  Eigen::Matrix2Xd X(2, n);
  for (int k = 0; k < n; ++k) X.col(k) = random_point<2>(dice);
  return X;
}

TEST(RelativePositions, DoNotDependOnTheFrame) {
  Dice dice(1);
  const Eigen::Matrix2Xd X = scattered(dice, 6);
  const Rigid2 T = random_pose<2>(dice);
  const Eigen::Matrix2Xd moved = (T.R * X).colwise() + Eigen::Vector2d(T.t);
  EXPECT_LT(relative_residual(relative_positions(X, nullptr), relative_positions(moved, nullptr))
                .cwiseAbs()
                .maxCoeff(),
            1e-12);
}

TEST(RelativePositions, HaveTheDerivativeOfDifferences) {
  Dice dice(2);
  for (int round = 0; round < 20; ++round) {
    const Eigen::Matrix2Xd X = scattered(dice, 5);
    Eigen::MatrixXd J;
    relative_positions(X, &J);
    for (Eigen::Index c = 0; c < X.size(); ++c) {
      Eigen::Matrix2Xd up = X, down = X;
      up.data()[c] += 1e-6;
      down.data()[c] -= 1e-6;
      const Eigen::VectorXd column =
          relative_residual(relative_positions(up, nullptr), relative_positions(down, nullptr)) /
          2e-6;
      EXPECT_LT((column - J.col(c)).cwiseAbs().maxCoeff(), 1e-7 * (1 + J.cwiseAbs().maxCoeff()));
    }
  }
}

/// A feature-only map of the plane and its covariance in the frame of a pose, where it was made.
struct SeenFromAPose {
  Map<2> whole, features;
  std::vector<Key> keys;
  Eigen::Matrix2Xd X;
  Eigen::MatrixXd P;  ///< P_ff of (9)
};
SeenFromAPose seen_from_a_pose(std::uint64_t seed) {
  const auto chain = random_chain<2>(seed, {.noise = 0.1});
  SeenFromAPose out;
  out.whole = to_map(chain.maps[0]);
  out.features = marginalize(out.whole, std::span<const int>(features_of(out.whole.variables())));
  out.features.solved_in = out.features.anchor;
  for (const Key& key : out.features.variables().column(0).keys) out.keys.push_back(key);
  out.X.resize(2, static_cast<Eigen::Index>(out.keys.size()));
  for (std::size_t k = 0; k < out.keys.size(); ++k)
    out.X.col(static_cast<Eigen::Index>(k)) = out.whole.values.point(out.keys[k]);
  out.P = Covariance<2>(out.whole).of(out.keys);
  return out;
}

TEST(RelativeInformation, IsTheCovarianceOfTheMapPropagated) {  // IV-B
  const SeenFromAPose seen = seen_from_a_pose(3);
  ASSERT_GE(seen.keys.size(), 4U);
  const RelativeInformation relative =
      relative_information(seen.features, seen.keys[0], seen.keys[1]);
  EXPECT_EQ(relative.features, seen.keys);
  Eigen::MatrixXd J;
  const Eigen::VectorXd z = relative_positions(seen.X, &J);
  EXPECT_LT(relative_residual(relative.z, z).cwiseAbs().maxCoeff(), 1e-10);
  const Eigen::MatrixXd R = J * seen.P * J.transpose();
  EXPECT_LT(relative_distance(relative.information, test::dense_inverse(R)), 1e-8);
}

TEST(RelativeInformation, IsRefusedWithReasons) {
  const SeenFromAPose seen = seen_from_a_pose(4);
  EXPECT_THROW(relative_information(seen.whole, seen.keys[0], seen.keys[1]), InputError);
  EXPECT_THROW(relative_information(seen.features, seen.keys[0], point_key(999)), InputError);
}

TYPED_TEST(DslamFilter, OfOneLocalMapIsThatMapWithoutItsEndPose) {  // the first limit: EKF SLAM
  constexpr int D = TypeParam::value;
  const auto chain = random_chain<D>(5);
  DslamJoin<D> filter;
  filter.fuse(chain.maps[0]);
  const Map<D> local = to_map(chain.maps[0]);
  const Values<D> values = filter.values();
  EXPECT_EQ(values.size(), local.variables().size() - 1);
  EXPECT_LT(common_distance(values, local.values), 1e-9);
  std::vector<Key> keys = keys_of(values);
  EXPECT_LT(relative_distance(filter.covariance(keys), Covariance<D>(local).of(keys)), 1e-8);
}

/// The second limit: what is seen at one instant, every feature with a noise of its own, from a
/// pose nobody knows. D-SLAM's mapping, densely: (3) to (6).
TEST(DslamFilter2, OfInstantsIsDslam) {
  Dice dice(6);
  std::vector<Vec<2>> world;
  for (int i = 0; i < 12; ++i) world.push_back(random_point<2>(dice, 8.0));
  std::vector<LocalMap<2>> instants;
  for (int k = 0; k < 8; ++k) {
    const Rigid2 pose = k == 0 ? Rigid2() : random_pose<2>(dice, 3.0);
    LocalMap<2> map;
    map.anchor = pose_anchor<2>(pose_key(static_cast<std::uint64_t>(k)));
    std::vector<int> offsets{0};
    for (int i = 0; i < 12; ++i) {
      if (k > 0 && (i + k) % 3 == 0) continue;
      const Vec<2> seen = pose.inverse() * world[static_cast<std::size_t>(i)];
      map.add_term<Point2>(point_key(static_cast<std::uint64_t>(i)),
                           noisy<Point2>(dice, seen, 0.02));
      offsets.push_back(offsets.back() + 2);
    }
    Eigen::MatrixXd I = Eigen::MatrixXd::Zero(offsets.back(), offsets.back());
    for (int row = 0; row < offsets.back(); row += 2)
      I.block<2, 2>(row, row) = dice.definite(2, 2500.0);
    map.information = SymmetricBlockMatrix::from_dense(offsets, I);
    instants.push_back(std::move(map));
  }
  DslamJoin<2> filter;
  for (const LocalMap<2>& map : instants) filter.fuse(map);

  Eigen::VectorXd x = Eigen::Map<const Eigen::VectorXd>(instants[0].values.data(), 24);
  Eigen::MatrixXd I = instants[0].information.dense();
  Eigen::VectorXd i = I * x;
  for (std::size_t k = 1; k < instants.size(); ++k) {
    const LocalMap<2>& map = instants[k];
    const auto n = static_cast<Eigen::Index>(map.keys.size());
    const Eigen::Map<const Eigen::Matrix2Xd> Z(map.values.data(), 2, n);
    Eigen::MatrixXd G, H;
    const Eigen::VectorXd z = relative_positions(Z, &G);
    const Eigen::MatrixXd R = G * test::dense_inverse(map.information.dense()) * G.transpose();
    Eigen::Matrix2Xd X(2, n);
    Eigen::MatrixXd select = Eigen::MatrixXd::Zero(2 * n, 24);
    for (Eigen::Index f = 0; f < n; ++f) {
      const auto id = static_cast<Eigen::Index>(map.keys[static_cast<std::size_t>(f)].id);
      X.col(f) = x.segment<2>(2 * id);
      select.block<2, 2>(2 * f, 2 * id).setIdentity();
    }
    const Eigen::VectorXd h = relative_positions(X, &H);
    H = (H * select).eval();
    const Eigen::MatrixXd weight = test::dense_inverse(R);
    I += H.transpose() * weight * H;  // (6)
    i += H.transpose() * weight * (relative_residual(z, h) + H * x);
    x = test::dense_solve(I, i);
  }
  // Which two features the relative information is written by matters to second order.
  for (int f = 0; f < 12; ++f) {
    const Key key = point_key(static_cast<std::uint64_t>(f));
    const Eigen::MatrixXd P = filter.covariance(std::span(&key, 1));
    const Eigen::Vector2d error = filter.values().point(key) - x.segment<2>(2 * f);
    EXPECT_LT(error.norm(), 0.1 * std::sqrt(P.trace()));
    EXPECT_LT(relative_distance(P, test::dense_inverse(I).block<2, 2>(2 * f, 2 * f)), 0.05);
  }
}

TYPED_TEST(DslamFilter, FindsTheTruthInExactLocalMaps) {
  constexpr int D = TypeParam::value;
  const auto chain = random_chain<D>(7, {.features = 60, .noise = 0.0});
  const FilterResult<D> result = dslam(std::span<const LocalMap<D>>(chain.maps));
  EXPECT_LT(common_distance(result.map.values, chain.truth), 1e-7);
  EXPECT_EQ(result.map.anchor, pose_anchor<D>(pose_key(0)));
  for (const Key& key : keys_of(result.map.values)) {
    EXPECT_TRUE(key.type == Tag("point") || key == pose_key(0));
  }
}

TYPED_TEST(DslamFilter, RecoversTheSameByConjugateGradients) {
  constexpr int D = TypeParam::value;
  const auto chain = random_chain<D>(8, {.features = 60, .noise = 0.02});
  const std::span<const LocalMap<D>> maps(chain.maps);
  const FilterResult<D> direct = dslam(maps);
  const FilterResult<D> iterated = dslam(maps, {.recovery = FilterRecovery::kConjugateGradients});
  EXPECT_LT(distance(iterated.map.values, direct.map.values), 1e-7);
  int iterations = 0;
  for (const Fusion& fusion : iterated.report.fusions) iterations += fusion.iterations;
  EXPECT_GT(iterations, 0);
  DslamJoin<D> filter({.recovery = FilterRecovery::kConjugateGradients});
  filter.fuse(chain.maps[0]);
  const std::vector<Key> keys = keys_of(filter.values());
  EXPECT_LT(relative_distance(filter.covariance(keys), Covariance<D>(filter.map()).of(keys)), 1e-8);
}

TYPED_TEST(DslamFilter, IteratedIsTheOptimumOverFeatureOnlyMaps) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const auto chain = random_chain<D>(seed, {.features = 60, .noise = 0.02});
    const std::span<const LocalMap<D>> maps(chain.maps);
    const auto features = features_only(maps);
    const JoinResult<D> best = join_all(std::span<const Map<D>>(features.maps), {});
    const FilterResult<D> result = idslam(maps);
    EXPECT_TRUE(result.report.minimum);
    EXPECT_NEAR(result.report.chi2, best.report.chi2, 1e-6 * best.report.chi2);
    EXPECT_LT(deviation(result.map.values, best.maps.at(0).values).aligned_feature_rmse, 1e-4);
    EXPECT_GE(dslam(maps).report.chi2, result.report.chi2);
  }
}

TYPED_TEST(DslamFilter, KnowsWhereTheRobotWas) {  // V-A
  constexpr int D = TypeParam::value;
  const auto chain = random_chain<D>(9, {.features = 60, .noise = 0.0});
  DslamJoin<D> filter;
  for (int k = 0; k < 5; ++k) filter.fuse(chain.maps[static_cast<std::size_t>(k)]);
  const RobotLocation<D> robot = filter.locate(chain.maps[4]);
  EXPECT_LT(distance(robot.start.t, chain.truth.pose(pose_key(4)).t), 1e-7);
  EXPECT_LT(distance(robot.end.t, chain.truth.pose(pose_key(5)).t), 1e-7);
  EXPECT_LT(distance(robot.end.R, chain.truth.pose(pose_key(5)).R), 1e-7);
}

TYPED_TEST(DslamFilter, RefusesMapsThatShareTooLittle) {
  constexpr int D = TypeParam::value;
  auto chain = random_chain<D>(10, {.features = 60});
  LocalMap<D> stranger = chain.maps[1];
  for (Key& key : stranger.keys) key.session = 1;
  DslamJoin<D> filter;
  filter.fuse(chain.maps[0]);
  const std::string message = complaint_of<DisconnectedError>([&] { filter.fuse(stranger); });
  EXPECT_NE(message.find("shares fewer than"), std::string::npos) << message;
  EXPECT_NE(message.find("join it with a neighbour"), std::string::npos) << message;
  EXPECT_EQ(filter.fused(), 1);
}

TYPED_TEST(DslamFilter, ComparesOnlyWhatALocalMapMaySee) {  // V-B
  constexpr int D = TypeParam::value;
  Dice dice(11);
  const Values<D> global = random_values<D>(dice, {}, ids(200));
  const Values<D> local = part_of<D>(global, {}, {3, 4, 5});
  double radius = 0.0;
  for (const std::uint64_t id : {4, 5})
    radius = std::max(radius, (global.point(point_key(id)) - global.point(point_key(3))).norm());
  const std::vector<Key> gated = gated_features(global, local, point_key(3), 1.0);
  std::size_t expected = 0;
  for (const std::uint64_t id : ids(200))
    expected += (global.point(point_key(id)) - global.point(point_key(3))).norm() <= radius + 1.0;
  EXPECT_EQ(gated.size(), expected);
  EXPECT_LT(gated.size(), 200U);
  EXPECT_THROW(gated_features(global, local, point_key(777), 1.0), InputError);
}

}  // namespace
}  // namespace mapjoin
