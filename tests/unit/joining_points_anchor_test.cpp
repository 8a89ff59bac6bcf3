// Joining maps that are written in the frames of features, and maps without any pose.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <span>
#include <vector>

#include "examples/level_anchor.h"
#include "examples/line_anchor.h"
#include "mapjoin/evaluation/evaluate.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/frames/gauge.h"
#include "mapjoin/frames/local_map.h"
#include "mapjoin/graph/dense.h"
#include "mapjoin/io/native_map.h"
#include "mapjoin/joining/join.h"
#include "mapjoin/joining/join_all.h"
#include "tests/support/ceres_reference.h"
#include "tests/support/dense.h"
#include "tests/support/modes.h"
#include "tests/support/program.h"
#include "tests/support/random_maps.h"
#include "tests/support/user_types.h"

namespace mapjoin {
namespace {

using namespace test;  // NOLINT
using ::testing::HasSubstr;

template <class T>
class JoinInPoints : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(JoinInPoints, Dimensions);

constexpr double kPointNoise = 0.02;

JoinOptions leaves_of_eight(Mode mode, TreeShape tree = TreeShape::kGraph) {
  JoinOptions out;
  out.mode = mode;
  out.tree = tree;
  out.leaf_variables = 8;
  out.arity = 2;
  return out;
}

/// Overlapping local maps along a world: map k sees poses 2k .. 2k+2 and points 3k .. 3k+7.
/// Each is in the frame of some of its points; with `mixed` every other one in that of a pose.
template <int D>
std::vector<LocalMap<D>> local_maps(Dice& dice, const Values<D>& truth, int maps, bool with_poses,
                                    bool mixed, double noise) {
  std::vector<LocalMap<D>> out;
  for (int k = 0; k < maps; ++k) {
    const auto pose = static_cast<std::uint64_t>(2 * k), point = static_cast<std::uint64_t>(3 * k);
    const bool at_pose = mixed && k % 2 == 1;
    const Anchor<D> anchor =
        at_pose ? pose_anchor<D>(pose_key(pose)) : points_of<D>({point + 1, point + 6, point + 3});
    std::vector<Key> terms;
    for (std::uint64_t i = 0; with_poses && i < 3; ++i) {
      if (!at_pose || i > 0) terms.push_back(pose_key(pose + i));
    }
    for (std::uint64_t i = 0; i < 8; ++i) {
      if (at_pose || i != 1) terms.push_back(point_key(point + i));
    }
    out.push_back(random_local_map(dice, truth, anchor, terms, noise));
  }
  return out;
}

template <int D>
JoinResult<D> join_all_of(const std::vector<LocalMap<D>>& maps, const JoinOptions& options) {
  return join_all(std::span<const LocalMap<D>>(maps), options);
}

template <int D>
CeresReference<D> reference_of(const std::vector<LocalMap<D>>& maps) {
  CeresReference<D> out;
  for (const LocalMap<D>& map : maps) out.add(map);
  return out;
}

TYPED_TEST(JoinInPoints, FindsTheOptimumOfCeres) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    Values<D> truth = random_values<D>(dice, ids(11), ids(20));
    truth.transform(truth.pose(pose_key(0)).inverse());
    const auto maps = local_maps<D>(dice, truth, 5, true, seed % 2 == 0, kPointNoise);
    const auto reference = reference_of(maps);
    const Values<D> best = reference.minimise(truth, pose_key(0));
    const double chi2_best = reference.chi2(best);
    for (const TreeShape tree : {TreeShape::kGraph, TreeShape::kOrder}) {
      const JoinResult<D> optimal = join_all_of(maps, leaves_of_eight(Mode::kOptimal, tree));
      ASSERT_EQ(optimal.maps.size(), 1U);
      EXPECT_TRUE(optimal.report.minimum);
      EXPECT_NEAR(optimal.report.chi2, chi2_best, 1e-6 * chi2_best);
      EXPECT_LT(distance(optimal.maps[0].values, best), 1e-4);
      EXPECT_EQ(optimal.maps[0].anchor, pose_anchor<D>(pose_key(0)));
      const JoinResult<D> observed = join_all_of(maps, leaves_of_eight(Mode::kObserve, tree));
      ASSERT_EQ(observed.maps.size(), 1U);
      EXPECT_LT(distance(observed.maps[0].values, best), 0.1 * kPointNoise);
      EXPECT_NEAR(reference.chi2(observed.maps[0].values), observed.report.chi2, 1e-6 * chi2_best);
    }
  }
}

/// The linear system of such observations is that of automatic differentiation.
TYPED_TEST(JoinInPoints, InformationIsThatOfDenseLeastSquares) {
  constexpr int D = TypeParam::value;
  Dice dice(5);
  Values<D> truth = random_values<D>(dice, ids(7), ids(14));
  truth.transform(truth.pose(pose_key(0)).inverse());
  const auto maps = local_maps<D>(dice, truth, 3, true, false, kPointNoise);
  const JoinResult<D> result = join_all_of(maps, leaves_of_eight(Mode::kObserve));
  const Map<D>& map = result.maps.at(0);
  const auto expected = reference_of(maps).normal_equations(map.values);
  EXPECT_LT(relative_distance(map.information.dense(), expected.H), 1e-9);
}

TYPED_TEST(JoinInPoints, WithoutPosesEndsWhereTheGradientVanishes) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    const Values<D> truth = random_values<D>(dice, {}, ids(20));
    const auto maps = local_maps<D>(dice, truth, 5, false, false, kPointNoise);
    const auto reference = reference_of(maps);
    for (const TreeShape tree : {TreeShape::kGraph, TreeShape::kOrder}) {
      const JoinResult<D> result = join_all_of(maps, leaves_of_eight(Mode::kOptimal, tree));
      ASSERT_EQ(result.maps.size(), 1U);
      const Map<D>& map = result.maps[0];
      const auto normal = reference.normal_equations(map.values);
      // The step that is left, in the directions that matter.
      const Eigen::VectorXd step = test::dense_least_squares(normal.H, normal.b);
      EXPECT_LT(step.cwiseAbs().maxCoeff(), 1e-4);
      EXPECT_NEAR(normal.chi2, result.report.chi2, 1e-8 * normal.chi2);
      EXPECT_NEAR(chi2(map.values, *map.observations), normal.chi2, 1e-8 * normal.chi2);
      EXPECT_LT(relative_distance(map.information.dense(), normal.H), 1e-9);
      // Its frame is that of points far apart, and the report says which.
      EXPECT_EQ(map.anchor, farthest_points(map.values).value());
      EXPECT_EQ(map.solved_in, map.anchor);
      EXPECT_LT((motion_into(map.anchor, map.values).R - Mat<D, D>::Identity()).norm(), 1e-14);
      ASSERT_EQ(result.report.notes.size(), 1U);
      EXPECT_THAT(result.report.notes[0], HasSubstr(to_string(map.anchor)));
    }
  }
}

TYPED_TEST(JoinInPoints, ExactMapsGiveTheTruthInEveryMode) {
  constexpr int D = TypeParam::value;
  for (const bool with_poses : {true, false}) {
    Dice dice(6);
    Values<D> truth = random_values<D>(dice, with_poses ? ids(11) : ids(0), ids(20));
    const auto maps = local_maps<D>(dice, truth, 5, with_poses, false, 0.0);
    for (const Mode mode : kModes) {
      const JoinResult<D> result = join_all_of(maps, leaves_of_eight(mode));
      ASSERT_EQ(result.maps.size(), 1U);
      truth.transform(motion_into(result.maps[0].anchor, truth));
      EXPECT_LT(distance(result.maps[0].values, truth), 1e-8);
    }
  }
}

/// Maps with poses that share none are joined at points, once nothing else can link them.
TYPED_TEST(JoinInPoints, PublishedModeJoinsMapsThatShareNoPoseAtPoints) {
  constexpr int D = TypeParam::value;
  Dice dice(7);
  const Values<D> truth = random_values<D>(dice, ids(5), ids(12));
  std::vector<LocalMap<D>> maps;
  for (const std::uint64_t pose : {0, 3}) {
    std::vector<Key> terms{pose_key(pose + 1)};
    for (const auto id : ids(8, pose == 0 ? 0 : 4)) terms.push_back(point_key(id));
    maps.push_back(random_local_map(dice, truth, pose, terms, 0.0));
  }
  const JoinResult<D> result = join_all_of(maps, leaves_of_eight(Mode::kPaper, TreeShape::kOrder));
  ASSERT_EQ(result.maps.size(), 1U);
  Values<D> expected = part_of(truth, {0, 1, 3, 4}, ids(12));
  expected.transform(motion_into(result.maps[0].anchor, expected));
  EXPECT_LT(distance(result.maps[0].values, expected), 1e-8);
}

TYPED_TEST(JoinInPoints, ALocalMapAsAMapIsItsInformationCompleted) {
  constexpr int D = TypeParam::value;
  for (const bool with_poses : {true, false}) {
    Dice dice(8);
    const Values<D> truth = random_values<D>(dice, ids(11), ids(20));
    const LocalMap<D> given = local_maps<D>(dice, truth, 1, with_poses, false, kPointNoise)[0];
    const Map<D> map = to_map(given);
    EXPECT_EQ(map.anchor, given.anchor);
    const LocalMap<D> back = as_local_map(map);
    ASSERT_EQ(back.keys.size(), given.keys.size());
    double largest = 0.0;
    for (std::size_t i = 0; i < given.keys.size(); ++i) {
      const Key key = given.keys[i];
      const int number = map.variables().require(key, "test");
      const double* x = given.values.data();
      for (std::size_t k = 0; k < i; ++k) x += given.kinds[k]->value_size;
      for (int s = 0; s < given.kinds[i]->value_size; ++s)
        EXPECT_NEAR(map.values.value(number)[s], x[s], 1e-12);
      largest = std::max(largest, given.information.dense().cwiseAbs().maxCoeff());
    }
    // The terms of the map stand in another order: compare what both say of every pair of terms.
    const Eigen::MatrixXd a = given.information.dense(), b = back.information.dense();
    for (std::size_t i = 0; i < given.keys.size(); ++i) {
      const auto p = std::find(back.keys.begin(), back.keys.end(), given.keys[i]);
      const int from = given.information.offset(static_cast<int>(i));
      const int to = back.information.offset(static_cast<int>(p - back.keys.begin()));
      const int dim = given.kinds[i]->dim;
      EXPECT_LT(distance(a.block(from, from, dim, dim), b.block(to, to, dim, dim)), 1e-9 * largest);
    }
    EXPECT_NEAR(a.sum(), b.sum(), 1e-8 * largest);
  }
}

TYPED_TEST(JoinInPoints, RefusesValuesThatAreNotInTheirFrame) {
  constexpr int D = TypeParam::value;
  Dice dice(9);
  const Values<D> truth = random_values<D>(dice, ids(11), ids(20));
  const LocalMap<D> good = local_maps<D>(dice, truth, 1, true, false, kPointNoise)[0];
  const auto complaint = [](const LocalMap<D>& map) {
    return complaint_of<Error>([&] {
      MeasurementGraphBuilder<D> builder;
      builder.add(map);
    });
  };
  LocalMap<D> off = good;
  for (std::size_t k = 0, at = 0; k < off.keys.size(); at += off.kinds[k++]->value_size) {
    if (off.keys[k] == off.anchor.keys[1]) off.values[at + 1] += 0.01;
  }
  EXPECT_THAT(complaint(off), HasSubstr("not written in the frame of its anchor"));
  LocalMap<D> twice = good;
  twice.anchor.keys[1] = twice.anchor.keys[0];
  EXPECT_THAT(complaint(twice), HasSubstr("twice"));
  LocalMap<D> without = good;  // F_X is no term: nothing says how far it is
  without.anchor.keys[1] = point_key(99);
  EXPECT_THAT(complaint(without), HasSubstr("point:99"));
  EXPECT_EQ(complaint(good), "nothing was thrown");
}

TYPED_TEST(JoinInPoints, TwoMapsAreJoinedInTheFrameOfTheFirst) {
  constexpr int D = TypeParam::value;
  for (const bool with_poses : {true, false}) {
    Dice dice(10);
    const auto poses = with_poses ? ids(5) : ids(0);
    const Values<D> all = random_values<D>(dice, poses, ids(12));
    const Map<D> a = map_of(dice, part_of(all, poses, ids(9)), points_of<D>({4, 7, 5}));
    const Map<D> b = map_of(dice, part_of(all, {}, ids(8, 4)), points_of<D>({8, 6, 9}));
    const Merge<D> merged = merge<D>({a, b});
    EXPECT_EQ(static_cast<int>(merged.dropped.size()), kGauge<D>);
    const Map<D> joined = solve(merged);
    EXPECT_EQ(joined.anchor, a.anchor);
    EXPECT_EQ(joined.solved_in, a.anchor);
    Values<D> truth = all;
    truth.transform(motion_into(a.anchor, truth));
    EXPECT_LT(distance(joined.values, truth), 1e-9);
    // Exact maps: their information adds up.
    const Eigen::MatrixXd g = joined.values.gauge();
    EXPECT_LT((joined.information.dense() * g).cwiseAbs().maxCoeff(),
              1e-9 * joined.information.dense().cwiseAbs().maxCoeff() * g.cwiseAbs().maxCoeff());
    // Moved anywhere and without any frame, they join in one of points (or of the lowest pose).
    Map<D> nowhere = a;
    move(nowhere, random_pose<D>(dice));
    nowhere.anchor = {};
    const Map<D> somewhere = join(nowhere, b);
    EXPECT_EQ(somewhere.anchor,
              with_poses ? pose_anchor<D>(pose_key(0)) : farthest_points(somewhere.values).value());
    truth.transform(motion_into(somewhere.anchor, truth));
    EXPECT_LT(distance(somewhere.values, truth), 1e-9);
  }
}

/// One solve of (16) with the pinned columns dropped is dense least squares without them.
TYPED_TEST(JoinInPoints, TheJoinIsOneDenseLeastSquaresSolve) {
  constexpr int D = TypeParam::value;
  Dice dice(11);
  const Values<D> all = random_values<D>(dice, {}, ids(12));
  const Map<D> a = map_of(dice, noisy(dice, part_of(all, {}, ids(9)), kPointNoise),
                          points_of<D>({4, 7, 5}), 100.0);
  const Map<D> b = map_of(dice, noisy(dice, part_of(all, {}, ids(8, 4)), kPointNoise),
                          points_of<D>({8, 6, 9}), 100.0);
  const Merge<D> merged = merge<D>({a, b});
  const Eigen::MatrixXd N = merged.equations.normal_matrix().dense();
  const Eigen::VectorXd rhs = merged.equations.right_hand_side();
  std::vector<int> kept;
  for (int s = 0; s < N.rows(); ++s) {
    if (std::find(merged.dropped.begin(), merged.dropped.end(), s) == merged.dropped.end())
      kept.push_back(s);
  }
  Eigen::VectorXd d = Eigen::VectorXd::Zero(N.rows()), right(static_cast<int>(kept.size()));
  for (int k = 0; k < right.size(); ++k) right(k) = rhs(kept.at(static_cast<std::size_t>(k)));
  const Eigen::VectorXd solution = test::dense_solve(picked(N, kept), right);
  for (int k = 0; k < right.size(); ++k) d(kept[static_cast<std::size_t>(k)]) = solution(k);
  Values<D> expected = merged.x0;
  expected.retract({d.data(), static_cast<std::size_t>(d.size())});
  for (const int s : merged.dropped) EXPECT_EQ(d(s), 0.0);
  const Map<D> joined = solve(merged);
  EXPECT_LT(distance(joined.values, expected), 1e-9) << "the frame is held while solving";
}

TYPED_TEST(JoinInPoints, NativeMapsKeepFramesAndObservations) {
  constexpr int D = TypeParam::value;
  Dice dice(12);
  const Values<D> truth = random_values<D>(dice, ids(11), ids(20));
  const auto maps = local_maps<D>(dice, truth, 5, true, true, kPointNoise);
  JoinResult<D> result = join_all_of(maps, leaves_of_eight(Mode::kOptimal));
  const Map<D> map = change_frame(result.maps.at(0), points_of<D>({1, 9, 15}));
  const TemporaryDirectory scratch;
  write_map(scratch.file("points.map"), map);
  const Map<D> back = read_map<D>(scratch.file("points.map"));
  EXPECT_EQ(back.anchor, map.anchor);
  EXPECT_EQ(back.solved_in, map.solved_in);
  EXPECT_LT(distance(back.values, map.values), 1e-15);
  EXPECT_EQ(back.information, map.information);
  ASSERT_NE(back.observations, nullptr);
  EXPECT_EQ(back.observations->submaps.anchors, map.observations->submaps.anchors);
  EXPECT_EQ(chi2(back.values, *back.observations), chi2(map.values, *map.observations));
  // Joined again it is the same optimum.
  const std::vector<Map<D>> again{back, back};
  const JoinResult<D> twice =
      join_all(std::span<const Map<D>>(again), {}, leaves_of_eight(Mode::kOptimal));
  EXPECT_NEAR(twice.report.chi2, 2.0 * result.report.chi2, 1e-6 * result.report.chi2);
}

TYPED_TEST(JoinInPoints, MapsWithoutObservationsJoinInAnyFrame) {
  constexpr int D = TypeParam::value;
  Dice dice(13);
  const Values<D> all = random_values<D>(dice, ids(6), ids(14));
  std::vector<Map<D>> maps, elsewhere;
  for (std::uint64_t k = 0; k < 3; ++k) {
    const Values<D> part = part_of(all, ids(3, k), ids(8, 3 * k));
    maps.push_back(map_of(dice, noisy(dice, part, kPointNoise),
                          points_of<D>({3 * k, 3 * k + 7, 3 * k + 4}), 100.0));
    elsewhere.push_back(change_frame(maps.back(), pose_anchor<D>(pose_key(k + 1))));
    elsewhere.back().solved_in = maps.back().solved_in;
  }
  const auto joined = [](const std::vector<Map<D>>& in) {
    return join_all(std::span<const Map<D>>(in), {}, leaves_of_eight(Mode::kOptimal)).maps.at(0);
  };
  // Where the maps are written does not matter, only where they were solved.
  EXPECT_LT(distance(joined(maps).values, joined(elsewhere).values), 1e-6);
}

TEST(JoinInFramesOfUsers, LineAndPointAndLevelFramesGiveTheTruth) {
  Dice dice(14);
  {
    ValuesBuilder<2> builder;
    for (std::uint64_t k = 0; k < 6; ++k) {
      builder.add<Point2>(point_key(k), random_point<2>(dice));
      builder.add<own::Line>(own::line_key(k), {dice.uniform(-3, 3), dice.uniform(-9, 9)});
    }
    Values<2> truth = std::move(builder).build();
    std::vector<Map<2>> maps{map_of(dice, truth, own::line_anchor(1, 2)),
                             map_of(dice, truth, own::line_anchor(3, 0))};
    for (const Mode mode : {Mode::kSummary, Mode::kObserve, Mode::kOptimal}) {
      const Map<2> joined =
          join_all(std::span<const Map<2>>(maps), {}, leaves_of_eight(mode)).maps.at(0);
      truth.transform(motion_into(joined.anchor, truth));
      EXPECT_LT(distance(joined.values, truth), 1e-8);
    }
  }
  ValuesBuilder<3> builder;
  for (std::uint64_t k = 0; k < 4; ++k) builder.add<Pose3>(pose_key(k), random_pose<3>(dice));
  builder.add<own::Direction>(own::up_key(0), random_point<3>(dice).normalized());
  Values<3> truth = std::move(builder).build();
  std::vector<Map<3>> maps{map_of(dice, truth, pose_anchor<3>(pose_key(1))),
                           map_of(dice, truth, pose_anchor<3>(pose_key(2)))};
  for (Map<3>& map : maps) {
    map = change_frame(std::move(map), own::level_anchor(3, 0));
    map.solved_in = map.anchor;
  }
  for (const Mode mode : {Mode::kSummary, Mode::kObserve, Mode::kOptimal}) {
    const Map<3> joined =
        join_all(std::span<const Map<3>>(maps), {}, leaves_of_eight(mode)).maps.at(0);
    truth.transform(motion_into(joined.anchor, truth));
    EXPECT_LT(distance(joined.values, truth), 1e-8);
  }
}

}  // namespace
}  // namespace mapjoin
