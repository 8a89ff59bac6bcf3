// Lemma 1 of Linear SLAM: for one common pose, one linear solve and a change of frame give what
// nonlinear least squares gives.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "mapjoin/frames/change_frame.h"
#include "mapjoin/frames/gauge.h"
#include "mapjoin/frames/local_map.h"
#include "mapjoin/joining/join.h"
#include "tests/support/ceres_reference.h"
#include "tests/support/random_maps.h"
#include "tests/support/textbook_frames.h"

namespace mapjoin {
namespace {

using namespace test;  // NOLINT

template <class T>
class JoinAsPublished : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(JoinAsPublished, Dimensions);

constexpr std::uint64_t kCommon = 4;

template <int D>
struct Pair {
  Map<D> first, second;
  Values<D> truth;
};

/// Two maps of poses 0 to 4 and 4 to 8, each in the frame of its last pose or of the common one,
/// with some features of both: the situation of section 4.
template <int D>
Pair<D> pair_of_maps(Dice& dice, int common_features, double disagreement) {
  Pair<D> out;
  out.truth = random_values<D>(dice, ids(9), ids(8 + common_features));
  std::vector<std::uint64_t> first = ids(4), second = ids(4, 4);
  for (int k = 0; k < common_features; ++k) {
    first.push_back(8 + static_cast<std::uint64_t>(k));
    second.push_back(8 + static_cast<std::uint64_t>(k));
  }
  const auto map = [&](const std::vector<std::uint64_t>& poses,
                       const std::vector<std::uint64_t>& features) {
    const Values<D> x = noisy(dice, part_of(out.truth, poses, features), disagreement);
    const auto at = dice.below(2) == 0 ? kCommon : poses.back();
    return map_of(dice, x, pose_anchor<D>(pose_key(at)), 10.0);
  };
  out.first = map(ids(5), first);
  out.second = map(ids(5, kCommon), second);
  return out;
}

/// (7): each map, written in the frame of the common pose, is one observation from it.
template <int D>
CeresReference<D> objective(const Pair<D>& pair) {
  CeresReference<D> out;
  for (const Map<D>* map : {&pair.first, &pair.second}) {
    Map<D> there = change_frame(*map, pose_anchor<D>(pose_key(kCommon)));
    there.solved_in = there.anchor;
    out.add(as_local_map(there));
  }
  return out;
}

template <int D>
void compare(const Pair<D>& pair, double noise_of_start, Dice& dice) {
  const CeresReference<D> reference = objective(pair);
  const Key end = pose_key(8);  // the end pose of map 2: its frame is that of (7)
  Values<D> start = pair.truth;
  start.transform(start.pose(end).inverse());
  const Values<D> optimum = [&] {
    Values<D> x = reference.minimise(noisy(dice, start, noise_of_start), end);
    x.transform(x.pose(end).inverse());
    return x;
  }();

  const Map<D> joined = change_frame(join_as_published(pair.first, pair.second, pose_key(kCommon)),
                                     pose_anchor<D>(end));
  EXPECT_EQ(joined.variables(), optimum.variables());
  EXPECT_LT(distance(joined.values, optimum), 1e-8);
  EXPECT_NEAR(reference.chi2(joined.values), reference.chi2(optimum),
              1e-9 * (1.0 + reference.chi2(optimum)));
  const auto pinned = frame_of(joined.anchor, joined.values).pinned;
  const Eigen::MatrixXd expected = without(reference.normal_equations(optimum).H, pinned, pinned);
  EXPECT_LT(relative_distance(anchored_information(joined).dense(), expected), 1e-8);
}

TYPED_TEST(JoinAsPublished, IsTheNonlinearOptimumForOneCommonPose) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    compare(pair_of_maps<D>(dice, 0, 0.1), 0.03, dice);
  }
}

TYPED_TEST(JoinAsPublished, IsTheNonlinearOptimumForOneCommonPoseAndFeatures) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    compare(pair_of_maps<D>(dice, 3, 0.1), 0.03, dice);
  }
}

TYPED_TEST(JoinAsPublished, IsTheNonlinearOptimumForFeaturesThatContradictEachOther) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    Pair<D> pair = pair_of_maps<D>(dice, 4, 0.0);
    // By metres: still exact, since all of it is linear as long as no rotation wraps.
    Values<D> x = pair.second.values;
    for (int i = 0; i < x.size(); ++i) {
      if (x.variables().key(i).type == Tag("point"))
        x.template set<PointType<D>>(i,
                                     noisy<PointType<D>>(dice, x.point(x.variables().key(i)), 1.0));
    }
    pair.second = map_of(dice, x, pair.second.anchor, 10.0);
    compare(pair, 0.01, dice);
  }
}

TYPED_TEST(JoinAsPublished, IsInTheFrameOfTheCommonPoseAndGaugeFree) {
  constexpr int D = TypeParam::value;
  Dice dice(7);
  const Pair<D> pair = pair_of_maps<D>(dice, 2, 0.1);
  const Map<D> joined = join_as_published(pair.first, pair.second, pose_key(kCommon));
  EXPECT_EQ(joined.anchor, pose_anchor<D>(pose_key(kCommon)));
  EXPECT_EQ(joined.solved_in, joined.anchor);
  EXPECT_EQ(joined.values.pose(pose_key(kCommon)).t, (Vec<D>::Zero()));
  EXPECT_LT((joined.information.dense() * joined.values.gauge()).cwiseAbs().maxCoeff(),
            1e-10 * joined.information.dense().cwiseAbs().maxCoeff());
}

TYPED_TEST(JoinAsPublished, NeedsThePoseInBothMaps) {
  constexpr int D = TypeParam::value;
  Dice dice(8);
  const Pair<D> pair = pair_of_maps<D>(dice, 2, 0.1);
  EXPECT_THAT(complaint_of<DisconnectedError>(
                  [&] { (void)join_as_published(pair.first, pair.second, pose_key(2)); }),
              ::testing::HasSubstr("pose:2"));
  EXPECT_THROW((void)join_as_published(pair.first, pair.second, pose_key(99)), Error);
}

}  // namespace
}  // namespace mapjoin
