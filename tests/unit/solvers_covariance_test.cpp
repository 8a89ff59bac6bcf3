// Covariances: against dense inversion, in any frame, and what no frame changes.
#include "mapjoin/solvers/covariance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "mapjoin/frames/change_frame.h"
#include "mapjoin/frames/exact_gauge.h"
#include "mapjoin/graph/dense.h"
#include "mapjoin/joining/join.h"
#include "mapjoin/joining/join_all.h"
#include "mapjoin/solvers/relative.h"
#include "tests/support/dense.h"
#include "tests/support/random_maps.h"
#include "tests/support/user_types.h"

namespace mapjoin::test {
namespace {

/// The inverse of the anchored information, with zero rows and columns at what is pinned.
template <int D>
Eigen::MatrixXd dense_covariance(const Map<D>& map) {
  const AnchoredInformation anchored = anchored_information(map);
  const Eigen::MatrixXd inverse = test::dense_inverse(anchored.dense());
  const int n = map.variables().scalars();
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(n, n);
  for (std::size_t c = 0; c < anchored.scalars.size(); ++c) {
    for (std::size_t r = 0; r < anchored.scalars.size(); ++r)
      out(anchored.scalars[r], anchored.scalars[c]) =
          inverse(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(c));
  }
  return out;
}

template <int D>
Eigen::MatrixXd block_of(const Eigen::MatrixXd& dense, const VariableSet<D>& v, int i, int j) {
  return dense.block(v.offset(i), v.offset(j), v.dim(i), v.dim(j));
}

/// The diagonal blocks of all variables.
void expect_blocks_of(const Eigen::MatrixXd& dense, const CovarianceBlocks& blocks) {
  const double tolerance = 1e-9 * dense.cwiseAbs().maxCoeff();
  int offset = 0;
  for (std::size_t k = 0; k < blocks.size(); offset += blocks.dims[k++]) {
    const int dim = blocks.dims[k];
    EXPECT_LT(distance(blocks.block(k), dense.block(offset, offset, dim, dim)), tolerance);
  }
  EXPECT_EQ(offset, dense.rows());
}

template <int D>
std::vector<Key> all_keys(const VariableSet<D>& variables) {
  std::vector<Key> out;
  for (int i = 0; i < variables.size(); ++i) out.push_back(variables.key(i));
  return out;
}

template <class Dimension>
class CovarianceOf : public testing::Test {
 public:
  static constexpr int kDimension = Dimension::value;
};
using Dimensions = testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(CovarianceOf, Dimensions);

TYPED_TEST(CovarianceOf, AnyKeysIsTheDenseInverse) {
  constexpr int D = TestFixture::kDimension;
  for (int trial = 0; trial < 8; ++trial) {
    Dice dice(100 + static_cast<std::uint64_t>(trial));
    const int poses = 2 + dice.below(12);
    const Map<D> map = random_map<D>(dice, ids(poses), ids(dice.below(9)),
                                     static_cast<std::uint64_t>(dice.below(poses)));
    const Eigen::MatrixXd dense = dense_covariance(map);
    const Covariance<D> covariance(map);
    EXPECT_LT(relative_distance(covariance.of(all_keys(map.variables())), dense), 1e-9);
    const int i = dice.below(map.values.size()), j = dice.below(map.values.size());
    EXPECT_LT(distance(covariance.block(map.variables().key(i), map.variables().key(j)),
                       block_of(dense, map.variables(), i, j)),
              1e-9 * dense.cwiseAbs().maxCoeff());
  }
}

TYPED_TEST(CovarianceOf, DiagonalBlocksBySelectedInversionAreTheDenseOnes) {
  constexpr int D = TestFixture::kDimension;
  for (int trial = 0; trial < 12; ++trial) {
    Dice dice(200 + static_cast<std::uint64_t>(trial));
    const int poses = 1 + dice.below(40);
    const Map<D> map = random_map<D>(dice, ids(poses), ids(2 + dice.below(20)), 0);
    const Eigen::MatrixXd dense = dense_covariance(map);
    const Covariance<D> covariance(map);
    const CovarianceBlocks blocks = covariance.blocks();
    ASSERT_EQ(blocks.size(), static_cast<std::size_t>(map.values.size()));
    expect_blocks_of(dense, blocks);
    const std::vector<int> some = {map.values.size() - 1, 0, map.values.size() - 1};
    const CovarianceBlocks few = covariance.blocks(some);
    ASSERT_EQ(few.size(), 3U);
    for (std::size_t k = 0; k < some.size(); ++k)
      EXPECT_EQ(few.block(k), blocks.block(static_cast<std::size_t>(some[k])));
  }
}

// Fronts wider than one strip, one tile and one block of pivots.
TYPED_TEST(CovarianceOf, DenselyCoupledVariablesIsExactToo) {
  constexpr int D = TestFixture::kDimension;
  Dice dice(7);
  Values<D> values = random_values<D>(dice, ids(40), ids(25));
  Map<D> map = map_of(dice, values, pose_anchor<D>(pose_key(3)));
  const Eigen::MatrixXd g = map.values.gauge();
  const int n = map.variables().scalars();
  const Eigen::MatrixXd away =
      Eigen::MatrixXd::Identity(n, n) - carried(g, test::dense_inverse(g.transpose() * g));
  map.information =
      SymmetricBlockMatrix::from_dense(map.variables().offsets(), carried(away, dice.definite(n)));
  const Eigen::MatrixXd dense = dense_covariance(map);
  expect_blocks_of(dense, Covariance<D>(map).blocks());
}

TYPED_TEST(CovarianceOf, AnotherFrameIsThatOfTheReframedInformation) {
  constexpr int D = TestFixture::kDimension;
  for (int trial = 0; trial < 6; ++trial) {
    Dice dice(300 + static_cast<std::uint64_t>(trial));
    const Map<D> map =
        change_frame(random_map<D>(dice, ids(9), ids(6), 0),
                     pose_anchor<D>(pose_key(1 + static_cast<std::uint64_t>(trial))));
    ASSERT_FALSE(map.solved_in == map.anchor);
    const Eigen::MatrixXd dense = dense_covariance(map);
    const Covariance<D> covariance(map);
    EXPECT_LT(relative_distance(covariance.of(all_keys(map.variables())), dense), 1e-9);
    const CovarianceBlocks blocks = covariance.blocks();
    expect_blocks_of(dense, blocks);
    EXPECT_TRUE(covariance.of(map.anchor.keys).isZero(0.0)) << "the anchor is certain";
  }
}

/// A summary join of two maps that disagree: its information is not quite gauge-free.
template <int D>
Map<D> disagreeing_join(Dice& dice) {
  const Values<D> truth = random_values<D>(dice, ids(6), ids(8));
  const Map<D> a = map_of(dice, noisy(dice, part_of(truth, {0, 1, 2, 3}, {0, 1, 2, 3, 4}), 0.02),
                          pose_anchor<D>(pose_key(0)), 100.0);
  const Map<D> b = map_of(dice, noisy(dice, part_of(truth, {3, 4, 5}, {3, 4, 5, 6, 7}), 0.02),
                          pose_anchor<D>(pose_key(3)), 100.0);
  return join(a, b);
}

TYPED_TEST(CovarianceOf, SummaryJoinIsExactWhereItWasSolvedAndConsistentElsewhere) {
  constexpr int D = TestFixture::kDimension;
  Dice dice(17);
  Map<D> home = disagreeing_join<D>(dice);
  home = change_frame(home, home.solved_in);
  ASSERT_FALSE(is_gauge_free(home));
  const Covariance<D> there(home);
  EXPECT_LT(relative_distance(there.of(all_keys(home.variables())), dense_covariance(home)), 1e-9);

  const Map<D> away = change_frame(home, pose_anchor<D>(pose_key(5)));
  const Map<D> completed = exactly_gauge_free(away);
  EXPECT_TRUE(is_gauge_free(completed));
  const Covariance<D> here(away);
  EXPECT_LT(relative_distance(here.of(all_keys(away.variables())), dense_covariance(completed)),
            1e-9);
  EXPECT_GT(relative_distance(dense_covariance(away), dense_covariance(completed)), 1e-6)
      << "without the completion it would be something else";
}

TYPED_TEST(CovarianceOf, RelativeQuantitiesIsTheSameInAllFrames) {
  constexpr int D = TestFixture::kDimension;
  Dice dice(23);
  const Map<D> home = disagreeing_join<D>(dice);
  const Covariance<D> covariance(home);
  const Key from = pose_key(1), pose = pose_key(4), point = point_key(6), other = point_key(0);
  const Relative r = relative(home, covariance, from, pose);
  const Relative p = relative(home, covariance, from, point);
  const Distance d = mapjoin::distance(home, covariance, point, other);
  const Distance e = mapjoin::distance(home, covariance, pose, other);
  for (const std::uint64_t id : {1U, 2U, 4U, 5U}) {
    const Map<D> map = change_frame(home, pose_anchor<D>(pose_key(id)));
    const Covariance<D> there(map);
    const Relative r2 = relative(map, there, from, pose);
    EXPECT_LT(distance(r.template as<PoseType<D>>().R, r2.template as<PoseType<D>>().R), 1e-12);
    EXPECT_LT(distance(r.template as<PoseType<D>>().t, r2.template as<PoseType<D>>().t), 1e-11);
    EXPECT_LT(relative_distance(r2.covariance, r.covariance), 1e-9);
    EXPECT_LT(relative_distance(relative(map, there, from, point).covariance, p.covariance), 1e-9);
    const Distance d2 = mapjoin::distance(map, there, point, other);
    EXPECT_NEAR(d2.value, d.value, 1e-11 * d.value);
    EXPECT_NEAR(d2.deviation, d.deviation, 1e-9 * d.deviation);
    EXPECT_NEAR(mapjoin::distance(map, there, pose, other).deviation, e.deviation,
                1e-9 * e.deviation);
  }
}

// In the frame of a pose, what is seen from it is the map itself.
TYPED_TEST(CovarianceOf, WhatTheAnchorSeesIsTheMap) {
  constexpr int D = TestFixture::kDimension;
  Dice dice(29);
  const Map<D> map = random_map<D>(dice, ids(6), ids(5), 2);
  const Covariance<D> covariance(map);
  for (int i = 0; i < map.values.size(); ++i) {
    const Key key = map.variables().key(i);
    if (key == pose_key(2)) continue;
    const Relative r = relative(map, covariance, pose_key(2), key);
    EXPECT_LT(relative_distance(r.covariance, covariance.block(key, key)), 1e-9);
  }
}

// By numeric differentiation of the relative pose in the tangents of both.
TYPED_TEST(CovarianceOf, RelativePoseFollowsFromItsDerivative) {
  constexpr int D = TestFixture::kDimension;
  constexpr int G = kGauge<D>;
  Dice dice(31);
  const Map<D> map = random_map<D>(dice, ids(6), ids(5), 0);
  const Covariance<D> covariance(map);
  const Key a = pose_key(2), b = pose_key(5);
  using Pose = PoseType<D>;
  const auto seen = [&](const Vec<G>& da, const Vec<G>& db) {
    return Pose::template retract<double>(map.values.pose(a), da).inverse() *
           Pose::template retract<double>(map.values.pose(b), db);
  };
  const Rigid<D> z = seen(Vec<G>::Zero(), Vec<G>::Zero());
  Eigen::MatrixXd J(G, 2 * G);
  for (int k = 0; k < 2 * G; ++k) {
    Vec<2 * G> d = Vec<2 * G>::Zero();
    d(k) = 1e-6;
    const Vec<G> up =
        Pose::template local<double>(z, seen(d.template head<G>(), d.template tail<G>()));
    d(k) = -1e-6;
    const Vec<G> down =
        Pose::template local<double>(z, seen(d.template head<G>(), d.template tail<G>()));
    J.col(k) = (up - down) / 2e-6;
  }
  const std::vector<Key> keys = {a, b};
  EXPECT_LT(relative_distance(relative(map, covariance, a, b).covariance,
                              carried(J, covariance.of(keys))),
            1e-6);
}

TYPED_TEST(CovarianceOf, SolvedMapIsTheInverseOfItsInformation) {
  constexpr int D = TestFixture::kDimension;
  Dice dice(37);
  const auto world = random_graph<D>(dice, {.poses = 60, .points = 30, .closures = 30});
  const Map<D> map = join_all(world.graph).maps.at(0);
  const Eigen::MatrixXd dense = dense_covariance(map);
  expect_blocks_of(dense, Covariance<D>(map).blocks());
}

/// Pins the same as two_points, by mixtures of its three coordinates.
const AnchorKind<2>& mixed_points_kind() {
  static const AnchorKind<2> kind = [] {
    AnchorKind<2> out = points_anchor_kind<2>();
    out.tag = Tag("mixed");
    out.rows = [](const double* const* x, double* P) {
      points_anchor_kind<2>().rows(x, P);
      Eigen::Map<Eigen::Matrix<double, 3, 4>> rows(P);
      Eigen::Matrix3d mixture;
      mixture << 1.0, 0.5, -0.3, 0.2, 1.5, 0.4, -0.7, 0.1, 2.0;
      rows = Eigen::Matrix<double, 3, 4>(mixture * rows);
    };
    return out;
  }();
  return kind;
}

TEST(Covariance, InTheFrameOfFeaturesIsTheDenseInverse) {
  Dice dice(47);
  const Map<2> solved_there =
      map_of(dice, random_values<2>(dice, ids(7), ids(6)), two_points(1, 4));
  const Map<2> solved_at_pose = random_map<2>(dice, ids(7), ids(6), 0);
  for (const Map<2>& map : {solved_there, change_frame(solved_there, pose_anchor<2>(pose_key(3))),
                            change_frame(solved_at_pose, two_points(5, 2))}) {
    const Eigen::MatrixXd dense = dense_covariance(map);
    const Covariance<2> covariance(map);
    EXPECT_LT(relative_distance(covariance.of(all_keys(map.variables())), dense), 1e-9);
    const CovarianceBlocks blocks = covariance.blocks();
    expect_blocks_of(dense, blocks);
  }
}

TEST(Covariance, OfAnAnchorThatPinsMixturesIsThatOfWhatItPins) {
  Dice dice(59);
  Map<2> map = map_of(dice, random_values<2>(dice, ids(7), ids(6)), two_points(1, 4));
  const std::vector<Key> keys = all_keys(map.variables());
  const Eigen::MatrixXd plain = Covariance<2>(map).of(keys);
  const CovarianceBlocks plain_blocks = Covariance<2>(map).blocks();
  map.anchor.kind = map.solved_in.kind = &mixed_points_kind();
  ASSERT_TRUE(anchor_rows(map.anchor, map.values).pinned.empty());
  const Covariance<2> mixed(map);
  EXPECT_LT(relative_distance(mixed.of(keys), plain), 1e-9);
  const CovarianceBlocks blocks = mixed.blocks();
  for (std::size_t k = 0; k < blocks.size(); ++k)
    EXPECT_LT(distance(blocks.block(k), plain_blocks.block(k)), 1e-9 * plain.cwiseAbs().maxCoeff());
}

TEST(Covariance, OfUserTypesIsTheDenseInverse) {
  Dice dice(61);
  ValuesBuilder<2> builder;
  for (const auto id : ids(5)) builder.add<Pose2>(pose_key(id), random_pose<2>(dice));
  for (const auto id : ids(4))
    builder.add<Wall>({Tag("wall"), 0, id}, {dice.uniform(-3.0, 3.0), dice.uniform(1.0, 5.0)});
  builder.add<BiasType<2>>({Tag("bias"), 0, 0}, Vec<1>(0.3));
  const Map<2> map =
      change_frame(map_of(dice, std::move(builder).build(), pose_anchor<2>(pose_key(0))),
                   pose_anchor<2>(pose_key(4)));
  const Eigen::MatrixXd dense = dense_covariance(map);
  const Covariance<2> covariance(map);
  EXPECT_LT(relative_distance(covariance.of(all_keys(map.variables())), dense), 1e-9);
  const Relative wall = relative(map, covariance, pose_key(4), {Tag("wall"), 0, 2});
  const Key key{Tag("wall"), 0, 2};
  EXPECT_LT(relative_distance(wall.covariance, covariance.block(key, key)), 1e-9);
}

TEST(Covariance, NamesWhatIsNotDetermined) {
  Dice dice(41);
  Map<2> map = random_map<2>(dice, ids(4), ids(3), 0);
  Eigen::MatrixXd dense = map.information.dense();
  const int at = map.variables().offset(*map.variables().find(point_key(1)));
  dense.middleRows(at, 2).setZero();
  dense.middleCols(at, 2).setZero();
  map.information = SymmetricBlockMatrix::from_dense(map.variables().offsets(), dense);
  EXPECT_THAT(complaint_of<SingularError>([&] { Covariance<2> c(map); }),
              testing::HasSubstr("point:1"));
}

TEST(Covariance, NamesKeysThatAreNotInTheMapAndMapsWithoutInformation) {
  Dice dice(43);
  Map<2> map = random_map<2>(dice, ids(4), ids(3), 0);
  const Covariance<2> covariance(map);
  EXPECT_THAT(complaint_of<InputError>([&] { covariance.block(pose_key(0), point_key(99)); }),
              testing::HasSubstr("point:99"));
  EXPECT_THAT(
      complaint_of<InputError>([&] { relative(map, covariance, point_key(1), pose_key(1)); }),
      testing::HasSubstr("point:1"));
  map.anchor = {};
  EXPECT_THAT(complaint_of<InputError>([&] { Covariance<2> c(map); }),
              testing::HasSubstr("anchor"));
  map = random_map<2>(dice, ids(4), ids(3), 0);
  map.information = {};
  EXPECT_THAT(complaint_of<InputError>([&] { Covariance<2> c(map); }),
              testing::HasSubstr("information"));
}

}  // namespace
}  // namespace mapjoin::test
