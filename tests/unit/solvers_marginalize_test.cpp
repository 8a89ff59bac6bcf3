// Marginalisation: against the dense Schur complement, in any frame and any order.
#include "mapjoin/solvers/marginalize.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "mapjoin/frames/change_frame.h"
#include "mapjoin/frames/exact_gauge.h"
#include "mapjoin/frames/points_anchor.h"
#include "mapjoin/joining/join_all.h"
#include "mapjoin/solvers/covariance.h"
#include "tests/support/random_maps.h"

namespace mapjoin::test {
namespace {

template <int D>
std::vector<int> scalars_of(const VariableSet<D>& v, const std::vector<int>& variables) {
  std::vector<int> out;
  for (const int i : variables) {
    for (int k = 0; k < v.dim(i); ++k) out.push_back(v.offset(i) + k);
  }
  return out;
}

template <int D>
Eigen::MatrixXd dense_schur(const Map<D>& map, const std::vector<int>& keep) {
  std::vector<int> drop;
  for (int i = 0; i < map.values.size(); ++i) {
    if (std::find(keep.begin(), keep.end(), i) == keep.end()) drop.push_back(i);
  }
  const std::vector<int> k = scalars_of(map.variables(), keep);
  const std::vector<int> d = scalars_of(map.variables(), drop);
  const Eigen::MatrixXd L = map.information.dense();
  return L(k, k) - L(k, d) * L(d, d).inverse() * L(d, k);
}

/// Poses and points taken at random, with at least one pose.
template <int D>
std::vector<int> random_choice(Dice& dice, const Map<D>& map) {
  std::vector<int> out;
  for (int i = 0; i < map.values.size(); ++i) {
    if (dice.below(2) == 0) out.push_back(i);
  }
  const int pose = *map.variables().find(pose_key(2));
  if (std::find(out.begin(), out.end(), pose) == out.end())
    out.insert(std::upper_bound(out.begin(), out.end(), pose), pose);
  return out;
}

template <class Dimension>
class Marginalize : public testing::Test {
 public:
  static constexpr int kDimension = Dimension::value;
};
using Dimensions = testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(Marginalize, Dimensions);

TYPED_TEST(Marginalize, IsTheDenseSchurComplement) {
  constexpr int D = TestFixture::kDimension;
  for (int trial = 0; trial < 12; ++trial) {
    Dice dice(500 + static_cast<std::uint64_t>(trial));
    const Map<D> map = random_map<D>(dice, ids(4 + dice.below(25)), ids(3 + dice.below(15)), 2);
    for (const std::vector<int>& keep :
         {random_choice(dice, map), poses_of(map.variables()),
          last_pose_and_features(map.variables()), std::vector<int>{0, map.values.size() - 1}}) {
      const Map<D> part = marginalize(map, std::span<const int>(keep));
      ASSERT_EQ(part.values.size(), static_cast<int>(keep.size()));
      const Map<D> there = part.anchor == map.anchor ? map : change_frame(map, part.anchor);
      EXPECT_LT(relative_distance(part.information.dense(), dense_schur(there, keep)), 1e-9);
      EXPECT_LT(distance(part.values, subset(there.values, std::span<const int>(keep))), 1e-12);
      EXPECT_EQ(part.observations, nullptr);
    }
  }
}

TYPED_TEST(Marginalize, FeatureMapIsTheDenseSchurComplementInTheFrameOfItsFarthestPoints) {
  constexpr int D = TestFixture::kDimension;
  Dice dice(11);
  const Map<D> map = random_map<D>(dice, ids(12), ids(9), 2);
  const std::vector<int> keep = features_of(map.variables());
  const Map<D> part = marginalize(map, std::span<const int>(keep));
  ASSERT_EQ(part.anchor, farthest_points(subset(map.values, std::span<const int>(keep))));
  const Map<D> there = change_frame(map, part.anchor);
  EXPECT_LT(relative_distance(part.information.dense(), dense_schur(there, keep)), 1e-9);
  EXPECT_LT(distance(part.values, subset(there.values, std::span<const int>(keep))), 1e-12);
  const Eigen::MatrixXd left = part.information.times(part.values.gauge());
  EXPECT_LT(left.cwiseAbs().maxCoeff(), 1e-9 * part.information.dense().cwiseAbs().maxCoeff());
}

// Equation (20): it does not matter where the map is written when variables go.
TYPED_TEST(Marginalize, ThenReframeIsReframeThenMarginalize) {
  constexpr int D = TestFixture::kDimension;
  for (int trial = 0; trial < 6; ++trial) {
    Dice dice(600 + static_cast<std::uint64_t>(trial));
    const Map<D> map = random_map<D>(dice, ids(12), ids(8), 0);
    const std::vector<int> keep = random_choice(dice, map);
    const Anchor<D> anchor = pose_anchor<D>(pose_key(2));
    const Map<D> first = change_frame(marginalize(map, std::span<const int>(keep)), anchor);
    const Map<D> last = marginalize(change_frame(map, anchor), std::span<const int>(keep));
    EXPECT_EQ(last.anchor, anchor);
    EXPECT_LT(distance(first.values, last.values), 1e-11);
    EXPECT_LT(relative_distance(first.information.dense(), last.information.dense()), 1e-9);
  }
}

TYPED_TEST(Marginalize, InTwoStepsIsTheSameAsInOne) {
  constexpr int D = TestFixture::kDimension;
  Dice dice(13);
  const Map<D> map = random_map<D>(dice, ids(15), ids(8), 2);
  const std::vector<Key> once = {pose_key(2), pose_key(5), point_key(1), point_key(7)};
  const std::vector<Key> some = {pose_key(9), pose_key(2), pose_key(5), point_key(1), point_key(7)};
  const Map<D> a = marginalize(map, std::span<const Key>(once));
  const Map<D> b =
      marginalize(marginalize(map, std::span<const Key>(some)), std::span<const Key>(once));
  EXPECT_LT(relative_distance(a.information.dense(), b.information.dense()), 1e-9);
}

TYPED_TEST(Marginalize, DoesNotChangeCovariancesOfWhatIsKept) {
  constexpr int D = TestFixture::kDimension;
  Dice dice(19);
  const auto world = random_graph<D>(dice, {.poses = 80, .points = 40, .closures = 30});
  const Map<D> map = join_all(world.graph).maps.at(0);
  std::vector<int> keep = features_of(map.variables());
  keep.insert(std::upper_bound(keep.begin(), keep.end(), map.variables().require(pose_key(0), "")),
              map.variables().require(pose_key(0), ""));
  const Map<D> part = marginalize(map, std::span<const int>(keep));
  std::vector<Key> keys;
  for (const int i : keep) keys.push_back(map.variables().key(i));
  EXPECT_LT(relative_distance(Covariance<D>(part).of(keys), Covariance<D>(map).of(keys)), 1e-8);
}

TYPED_TEST(Marginalize, ChoosesTheLowestKeptPoseOrTheGivenFrameWhenTheAnchorGoes) {
  constexpr int D = TestFixture::kDimension;
  Dice dice(3);
  const Map<D> map = random_map<D>(dice, ids(9), ids(4), 0);
  const std::vector<Key> keep = {pose_key(7), pose_key(4), point_key(0)};
  EXPECT_EQ(marginalize(map, std::span<const Key>(keep)).anchor, pose_anchor<D>(pose_key(4)));
  const Anchor<D> seven = pose_anchor<D>(pose_key(7));
  const Map<D> part = marginalize(map, std::span<const Key>(keep), seven);
  EXPECT_EQ(part.anchor, seven);
  EXPECT_EQ(part.solved_in, seven);
  std::vector<Key> drop;
  for (int i = 0; i < map.values.size(); ++i) {
    const Key key = map.variables().key(i);
    if (std::find(keep.begin(), keep.end(), key) == keep.end()) drop.push_back(key);
  }
  const Map<D> same = marginalize_out(map, std::span<const Key>(drop), seven);
  EXPECT_EQ(same.information, part.information);
  EXPECT_EQ(same.variables(), part.variables());
}

// Information that is exact in one frame only is completed there before that frame's pose goes.
TYPED_TEST(Marginalize, KeepsWhatASummaryJoinSolved) {
  constexpr int D = TestFixture::kDimension;
  Dice dice(53);
  Map<D> map = random_map<D>(dice, ids(8), ids(5), 0);
  // As after a summary join: right where it was solved, and only there.
  const int n = map.variables().scalars();
  Eigen::MatrixXd dense = map.information.dense();
  const int home = map.variables().offset(*map.variables().find(pose_key(0)));
  dense.block(home, home, kGauge<D>, kGauge<D>) += dice.definite(kGauge<D>, 0.01);
  map.information = SymmetricBlockMatrix::from_dense(map.variables().offsets(), dense);
  ASSERT_EQ(n, map.information.scalars());
  ASSERT_FALSE(is_gauge_free(map));
  const std::vector<Key> keep = {pose_key(3), pose_key(6), point_key(2), point_key(4)};
  const Map<D> part = marginalize(map, std::span<const Key>(keep));
  EXPECT_TRUE(part.anchor == pose_anchor<D>(pose_key(3)));
  const Map<D> there = change_frame(map, part.anchor);
  EXPECT_LT(relative_distance(Covariance<D>(part).of(keep), Covariance<D>(there).of(keep)), 1e-8);
}

TEST(MarginalizeErrors, SayWhatIsMissing) {
  Dice dice(61);
  const Map<2> map = random_map<2>(dice, ids(5), ids(4), 0);
  const std::vector<Key> one = {point_key(0)};
  EXPECT_THAT(
      complaint_of<DegenerateFrameError>([&] { marginalize(map, std::span<const Key>(one)); }),
      testing::HasSubstr("two points"));
  const std::vector<Key> absent = {point_key(0), pose_key(77)};
  EXPECT_THAT(complaint_of<InputError>([&] { marginalize(map, std::span<const Key>(absent)); }),
              testing::HasSubstr("pose:77"));
  const std::vector<Key> two = {point_key(0), point_key(1)};
  EXPECT_EQ(marginalize(map, std::span<const Key>(two)).values.size(), 2);
  const Map<3> space = random_map<3>(dice, ids(5), ids(4), 0);
  EXPECT_THAT(
      complaint_of<DegenerateFrameError>([&] { marginalize(space, std::span<const Key>(two)); }),
      testing::HasSubstr("three points"));
}

TEST(MarginalizeErrors, NameADroppedVariableThatNothingDetermines) {
  Dice dice(67);
  Map<2> map = random_map<2>(dice, ids(5), ids(4), 0);
  Eigen::MatrixXd dense = map.information.dense();
  const int at = map.variables().offset(*map.variables().find(point_key(1)));
  dense.middleRows(at, 2).setZero();
  dense.middleCols(at, 2).setZero();
  map.information = SymmetricBlockMatrix::from_dense(map.variables().offsets(), dense);
  const std::vector<int> keep = poses_of(map.variables());
  EXPECT_THAT(complaint_of<SingularError>([&] { marginalize(map, std::span<const int>(keep)); }),
              testing::HasSubstr("point:1"));
}

}  // namespace
}  // namespace mapjoin::test
