#include "mapjoin/frames/change_frame.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "mapjoin/frames/gauge.h"
#include "mapjoin/graph/dense.h"
#include "tests/support/dense.h"
#include "tests/support/random_maps.h"
#include "tests/support/textbook_frames.h"
#include "tests/support/user_types.h"

namespace mapjoin {
namespace {

using namespace test;  // NOLINT

template <class T>
class ChangeFrame : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(ChangeFrame, Dimensions);

/// A map of a few poses and points with scattered ids.
template <int D>
Map<D> some_map(Dice& dice, int poses = 5, int points = 5) {
  return random_map<D>(dice, ids(poses, 3), ids(points, 10),
                       3 + static_cast<std::uint64_t>(dice.below(poses)));
}
template <int D>
Anchor<D> some_anchor(Dice& dice, int poses = 5) {
  return pose_anchor<D>(pose_key(3 + static_cast<std::uint64_t>(dice.below(poses))));
}

/// Values of a change of frame against the textbook's, and its information against nabla^T I nabla.
template <int D>
void compare_with_textbook(const Map<D>& map, const Anchor<D>& anchor) {
  const Map<D> changed = change_frame(map, anchor);
  EXPECT_EQ(changed.anchor, anchor);
  EXPECT_EQ(changed.variables(), map.variables());

  const auto before = frame_of(map.anchor, map.values);
  const auto after = frame_of(anchor, map.values);
  const auto old_state = things_of(map.values);
  const auto new_state = moved(old_state, after.into(old_state));
  const auto got = things_of(changed.values);
  for (std::size_t k = 0; k < got.size(); ++k) {
    EXPECT_LT(distance(got[k].t, new_state[k].t), 1e-11);
    EXPECT_LT(distance(got[k].R, new_state[k].R), 1e-12);
  }
  const Eigen::MatrixXd I = without(map.information.dense(), before.pinned, before.pinned);
  const Eigen::MatrixXd result = anchored_information(changed).dense();
  // g maps the state in the new frame to the one in the old frame.
  for (const bool duals : {true, false}) {
    const Eigen::MatrixXd whole =
        duals ? nabla_by_duals<D>(new_state, before) : nabla_by_differences<D>(new_state, before);
    const Eigen::MatrixXd nabla = without(whole, before.pinned, after.pinned);
    const Eigen::MatrixXd expected = carried(nabla.transpose(), I);
    EXPECT_LT(relative_distance(result, expected), duals ? 1e-9 : 1e-6);
  }
}

TYPED_TEST(ChangeFrame, IsThePapersFormulaBetweenPoses) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 15; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    compare_with_textbook(some_map<D>(dice), some_anchor<D>(dice));
  }
}

TEST(ChangeFrameOf, IsThePapersFormulaBetweenPosesAndTriplesOfPoints) {
  for (std::uint64_t seed = 1; seed <= 15; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    const Map<3> at_pose = some_map<3>(dice);
    const Anchor<3> points = three_points(11, 13, 10);
    compare_with_textbook<3>(at_pose, points);
    const Map<3> at_points = map_of<3>(dice, at_pose.values, points);
    compare_with_textbook<3>(at_points, three_points(12, 10, 14));
    compare_with_textbook<3>(at_points, three_points(13, 10, 11));
    compare_with_textbook<3>(at_points, pose_anchor<3>(pose_key(4)));
  }
}

TEST(ChangeFrameOf, IsThePapersFormulaBetweenPosesAndPairsOfPoints) {
  for (std::uint64_t seed = 1; seed <= 15; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    const Map<2> at_pose = some_map<2>(dice);
    const Anchor<2> points = two_points(11, 13);
    compare_with_textbook<2>(at_pose, points);
    const Map<2> at_points = map_of<2>(dice, at_pose.values, points);
    compare_with_textbook<2>(at_points, two_points(12, 10));
    compare_with_textbook<2>(at_points, two_points(13, 11));
    compare_with_textbook<2>(at_points, pose_anchor<2>(pose_key(4)));
  }
}

template <int D>
void expect_same_map(const Map<D>& a, const Map<D>& b, double tolerance = 1e-10) {
  EXPECT_LT(distance(a.values, b.values), tolerance);
  EXPECT_LT(relative_distance(a.information.dense(), b.information.dense()), tolerance);
  EXPECT_EQ(a.anchor, b.anchor);
}

TYPED_TEST(ChangeFrame, ThereAndBackIsTheSameMap) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    const Map<D> map = some_map<D>(dice);
    expect_same_map(change_frame(change_frame(map, some_anchor<D>(dice)), map.anchor), map);
  }
}

TYPED_TEST(ChangeFrame, ViaAThirdFrameIsTheSameMap) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    const Map<D> map = some_map<D>(dice);
    const auto via = some_anchor<D>(dice);
    const auto end = some_anchor<D>(dice);
    expect_same_map(change_frame(change_frame(map, via), end), change_frame(map, end));
  }
}

TYPED_TEST(ChangeFrame, KeepsBlocksWhereTheyAre) {
  constexpr int D = TypeParam::value;
  Dice dice(4);
  const Map<D> map = some_map<D>(dice, 12, 12);
  const Map<D> changed = change_frame(map, some_anchor<D>(dice, 12));
  const auto& a = map.information;
  const auto& b = changed.information;
  ASSERT_EQ(a.blocks(), b.blocks());
  ASSERT_LT(a.blocks(), 24 * 25 / 2) << "a test on a full matrix shows nothing";
  for (int j = 0; j < a.size(); ++j) {
    for (auto s = a.begin(j); s < a.end(j); ++s) EXPECT_EQ(a.row(s), b.row(s));
  }
}

TYPED_TEST(ChangeFrame, PinsTheAnchorExactly) {
  constexpr int D = TypeParam::value;
  Dice dice(5);
  const auto anchor = some_anchor<D>(dice);
  const Map<D> map = change_frame(some_map<D>(dice), anchor);
  EXPECT_EQ(map.values.pose(anchor.keys[0]).t, (Vec<D>::Zero()));
  EXPECT_EQ(map.values.pose(anchor.keys[0]).R, (Mat<D, D>::Identity()));
}

TYPED_TEST(ChangeFrame, LeavesInformationGaugeFree) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Dice dice(seed);
    const Map<D> map = change_frame(some_map<D>(dice), some_anchor<D>(dice));
    const Eigen::MatrixXd moved = map.information.dense() * map.values.gauge();
    EXPECT_LT(moved.cwiseAbs().maxCoeff(), 1e-10 * map.information.dense().cwiseAbs().maxCoeff() *
                                               map.values.gauge().cwiseAbs().maxCoeff());
  }
}

TYPED_TEST(ChangeFrame, OfAMovedMapIsTheSame) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Dice dice(seed);
    const Map<D> map = some_map<D>(dice);
    Map<D> elsewhere = map;
    move(elsewhere, random_pose<D>(dice));
    const auto anchor = some_anchor<D>(dice);
    expect_same_map(change_frame(elsewhere, anchor), change_frame(map, anchor));
  }
}

TYPED_TEST(ChangeFrame, SaysWhatIsMissing) {
  constexpr int D = TypeParam::value;
  Dice dice(6);
  const Map<D> map = some_map<D>(dice);
  EXPECT_THAT(
      complaint_of<InputError>([&] { (void)change_frame(map, pose_anchor<D>(pose_key(77))); }),
      ::testing::HasSubstr("pose:77"));
  EXPECT_THAT(
      complaint_of<InputError>([&] { (void)change_frame(map, pose_anchor<D>(point_key(10))); }),
      ::testing::HasSubstr("point:10"));
  EXPECT_THROW((void)change_frame(map, Anchor<D>()), InputError);
}

TEST(ChangeFrameOf, RefusesTwoPointsAtTheSamePlace) {
  ValuesBuilder<2> builder;
  builder.add<Point2>(point_key(1), {1.0, 2.0});
  builder.add<Point2>(point_key(2), {1.0, 2.0});
  builder.add<Pose2>(pose_key(0), Rigid2());
  Map<2> map;
  map.values = std::move(builder).build();
  map.anchor = pose_anchor<2>(pose_key(0));
  map.information = SymmetricBlockMatrix(map.variables().offsets(), {});
  EXPECT_THROW((void)change_frame(map, two_points(1, 2)), DegenerateFrameError);
}

/// Lambda' = D^-T Lambda D^-1 for a whole map of types of all four actions, D by differences.
TEST(ChangeFrameOf, WorksForTypesOfAnyKind) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Dice dice(seed);
    ValuesBuilder<2> builder;
    for (std::uint64_t k = 0; k < 3; ++k) {
      builder.add<Pose2>(pose_key(k), random_pose<2>(dice));
      builder.add<Point2>(point_key(k), random_point<2>(dice));
      builder.add<Wall>({Tag("wall"), 0, k}, {dice.uniform(-3, 3), dice.uniform(-9, 9)});
      builder.add<BiasType<2>>({Tag("bias"), 0, k}, Vec<1>(dice.normal()));
    }
    Map<2> map = map_of<2>(dice, std::move(builder).build(), pose_anchor<2>(pose_key(1)));
    const Map<2> changed = change_frame(map, pose_anchor<2>(pose_key(2)));
    const Rigid2 T = map.values.pose(pose_key(2)).inverse();
    const int n = map.variables().scalars();
    Eigen::MatrixXd J(n, n);
    for (int k = 0; k < n; ++k) {
      Eigen::VectorXd side[2];
      for (const int s : {0, 1}) {
        std::vector<double> d(static_cast<std::size_t>(n), 0.0);
        d[static_cast<std::size_t>(k)] = s == 0 ? 1e-5 : -1e-5;
        Values<2> x = map.values;
        x.retract(d);
        x.transform(T);
        side[s] = changed.values.local(x);
      }
      J.col(k) = (side[0] - side[1]) / 2e-5;
    }
    const Eigen::MatrixXd inverse = test::dense_inverse(J);
    const Eigen::MatrixXd expected = carried(inverse.transpose(), map.information.dense());
    EXPECT_LT(relative_distance(changed.information.dense(), expected), 1e-6);
    EXPECT_LT((changed.information.dense() * changed.values.gauge()).cwiseAbs().maxCoeff(),
              1e-9 * expected.cwiseAbs().maxCoeff());
    expect_same_map(change_frame(changed, map.anchor), map);
    EXPECT_EQ(changed.values.at<BiasType<2>>({Tag("bias"), 0, 1}),
              map.values.at<BiasType<2>>({Tag("bias"), 0, 1}));
  }
}

}  // namespace
}  // namespace mapjoin
