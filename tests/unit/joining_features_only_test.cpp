// Maps of features alone (D-SLAM; Linear SLAM section 7): which common features make the frame, one
// linear solve in it, and how local maps are rid of their poses (section 8.3).

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <span>
#include <vector>

#include "mapjoin/frames/best_points.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/frames/exact_gauge.h"
#include "mapjoin/frames/gauge.h"
#include "mapjoin/frames/local_map.h"
#include "mapjoin/joining/common_points.h"
#include "mapjoin/joining/features_only.h"
#include "mapjoin/joining/join.h"
#include "mapjoin/joining/join_all.h"
#include "mapjoin/solvers/covariance.h"
#include "mapjoin/solvers/marginalize.h"
#include "tests/support/ceres_reference.h"
#include "tests/support/dense.h"
#include "tests/support/modes.h"
#include "tests/support/random_maps.h"

namespace mapjoin {
namespace {

using namespace test;  // NOLINT
using ::testing::AllOf;
using ::testing::HasSubstr;

template <class T>
class FeaturesOnly : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(FeaturesOnly, Dimensions);

constexpr double kNoise = 0.02;
constexpr double kInformation = 1e4;

template <int D>
std::vector<Key> keys_of(int n) {
  std::vector<Key> out;
  for (const auto id : ids(n)) out.push_back(point_key(id));
  return out;
}

/// Points anywhere and a covariance small enough to tell them apart.
template <int D>
CandidatePoints<D> random_candidates(Dice& dice, int n) {
  CandidatePoints<D> out;
  for (int k = 0; k < n; ++k) out.positions.push_back(random_point<D>(dice));
  out.covariance = dice.definite(D * n, 1e-6);
  return out;
}

/// det C of a choice, by the frame's own rows.
template <int D>
double determinant(const std::vector<Vec<D>>& points, const Anchor<D>& anchor) {
  ValuesBuilder<D> builder;
  for (const Key& key : anchor.keys) builder.template add<PointType<D>>(key, points[key.id]);
  Values<D> values = std::move(builder).build();
  values.transform(motion_into(anchor, values));
  return std::abs(test::dense_determinant(anchor_rows(anchor, values).C));
}

TYPED_TEST(FeaturesOnly, BestPointsHaveTheLargestDeterminantInTheMapWhereItIsSmallest) {
  constexpr int D = TypeParam::value;
  Dice dice(1);
  for (int trial = 0; trial < 10; ++trial) {
    const std::vector<CandidatePoints<D>> maps{random_candidates<D>(dice, 6),
                                               random_candidates<D>(dice, 6)};
    const auto chosen = best_points<D>(keys_of<D>(6), maps);
    ASSERT_TRUE(chosen.has_value());
    const auto least = [&](const Anchor<D>& anchor) {
      return std::min(determinant(maps[0].positions, anchor),
                      determinant(maps[1].positions, anchor));
    };
    const double best = least(chosen->anchor);
    for (std::uint64_t a = 0; a < 6; ++a) {
      for (std::uint64_t b = 0; b < 6; ++b) {
        for (std::uint64_t c = 0; c < 6; ++c) {
          if (a == b || a == c || b == c) continue;
          EXPECT_LE(least(points_of<D>({a, b, c})), best * (1.0 + 1e-9));
        }
      }
    }
  }
}

TYPED_TEST(FeaturesOnly, BestPointsDoNotDependOnTheFrames) {
  constexpr int D = TypeParam::value;
  Dice dice(2);
  const Map<D> a = map_of(dice, random_values<D>(dice, {}, ids(15)), points_of<D>({1, 2, 3}), 1e4);
  const Map<D> b = map_of(dice, noisy(dice, part_of(a.values, {}, ids(10, 5)), kNoise),
                          points_of<D>({9, 6, 12}), kInformation);
  const Map<D>* const maps[] = {&a, &b};
  const auto chosen = common_points<D>(maps);
  ASSERT_TRUE(chosen.has_value());
  EXPECT_GT(chosen->certainty, 3.0);
  Map<D> moved = a;
  move(moved, random_pose<D>(dice));
  const Map<D> reframed = change_frame(b, points_of<D>({14, 7, 8}));
  const Map<D>* const others[] = {&moved, &reframed};
  const auto again = common_points<D>(others);
  ASSERT_TRUE(again.has_value());
  EXPECT_EQ(again->anchor, chosen->anchor);
  EXPECT_NEAR(again->certainty, chosen->certainty, 1e-6 * chosen->certainty);
  EXPECT_NO_THROW(expect_distinct(chosen->anchor, b.values,
                                  Covariance<D>(b).of(std::span<const Key>(chosen->anchor.keys))));
}

TYPED_TEST(FeaturesOnly, PointsThatAMapCannotTellApartMakeNoFrame) {
  constexpr int D = TypeParam::value;
  Dice dice(3);
  std::vector<CandidatePoints<D>> maps{random_candidates<D>(dice, 3)};
  EXPECT_TRUE(best_points<D>(keys_of<D>(3), maps).has_value());
  maps.push_back(maps[0]);
  maps[1].covariance *= 1e10;  // standard deviations of 100 m
  EXPECT_FALSE(best_points<D>(keys_of<D>(3), maps).has_value());
  std::vector<CandidatePoints<D>> line{random_candidates<D>(dice, 3)};
  for (int k = 0; k < 3; ++k)
    line[0].positions[static_cast<std::size_t>(k)] = (1.0 + k) * Vec<D>::Ones();
  EXPECT_EQ(best_points<D>(keys_of<D>(3), line).has_value(), D == 2) << "three on one line";
  for (Vec<D>& p : line[0].positions) p.setOnes();
  EXPECT_FALSE(best_points<D>(keys_of<D>(3), line).has_value());
  EXPECT_FALSE(best_points<D>({}, line).has_value());
}

TYPED_TEST(FeaturesOnly, SpreadPointsCoverAllOfThem) {
  constexpr int D = TypeParam::value;
  Dice dice(4);
  std::vector<Vec<D>> points;
  for (int k = 0; k < 50; ++k) points.push_back(random_point<D>(dice));
  points.push_back(points[0]);  // twice at one place
  const std::vector<int> chosen = spread_points<D>(points, 12);
  ASSERT_EQ(chosen.size(), 12U);
  EXPECT_TRUE(std::is_sorted(chosen.begin(), chosen.end()));
  EXPECT_EQ(std::adjacent_find(chosen.begin(), chosen.end()), chosen.end());
  double gap = 1e300;  // between those chosen
  for (const int a : chosen) {
    for (const int b : chosen) {
      if (a < b)
        gap = std::min(
            gap,
            (points[static_cast<std::size_t>(a)] - points[static_cast<std::size_t>(b)]).norm());
    }
  }
  for (const Vec<D>& p : points) {  // none is farther from all of them
    double nearest = 1e300;
    for (const int a : chosen)
      nearest = std::min(nearest, (p - points[static_cast<std::size_t>(a)]).norm());
    EXPECT_LE(nearest, gap * (1.0 + 1e-12));
  }
  EXPECT_EQ(spread_points<D>(points, 100).size(), points.size());
  EXPECT_TRUE(spread_points<D>(std::span<const Vec<D>>(), 3).empty());
}

/// Two maps that disagree, with `common` points in both.
template <int D>
std::pair<Map<D>, Map<D>> two_maps_of_points(Dice& dice, int common, double noise) {
  const Values<D> all = random_values<D>(dice, {}, ids(16 - common));
  const auto begin = static_cast<std::uint64_t>(8 - common);
  return {map_of(dice, noisy(dice, part_of(all, {}, ids(8)), noise), points_of<D>({0, 1, 2}),
                 kInformation),
          map_of(dice, noisy(dice, part_of(all, {}, ids(8, begin)), noise),
                 points_of<D>({begin + 7, begin + 6, begin + 5}), kInformation)};
}

/// (16) and (17) of the papers, densely: in the frame of the common points the state is that of
/// both maps, A picks coordinates, and the sum of the information is what remains.
TYPED_TEST(FeaturesOnly, PublishedJoinIsTheDenseFormulaInTheFrameOfCommonPoints) {
  constexpr int D = TypeParam::value;
  for (const int common : {D, D + 2}) {
    Dice dice(5);
    const auto pair = two_maps_of_points<D>(dice, common, 0.5);
    const Map<D>& a = pair.first;
    const Map<D>& b = pair.second;
    const auto first = static_cast<std::uint64_t>(8 - common);
    const Anchor<D> frame = points_of<D>({first, first + 1, first + 2});
    const Map<D> joined = join_as_published(a, b, frame);
    EXPECT_EQ(joined.anchor, frame);
    EXPECT_EQ(joined.solved_in, frame);
    EXPECT_TRUE(is_gauge_free(joined));

    const int n = joined.variables().scalars();
    Eigen::MatrixXd I = Eigen::MatrixXd::Zero(n, n);
    Eigen::VectorXd i = Eigen::VectorXd::Zero(n);
    for (const Map<D>& map : {change_frame(a, frame), change_frame(b, frame)}) {
      const AnchoredInformation part = anchored_information(map);
      std::vector<int> to;
      for (const int s : part.scalars) {
        const auto key = map.variables().key(s / D);
        to.push_back(joined.variables().offset(joined.variables().require(key, "test")) + s % D);
      }
      Eigen::VectorXd x(static_cast<Eigen::Index>(to.size()));
      for (std::size_t k = 0; k < to.size(); ++k)
        x(static_cast<Eigen::Index>(k)) =
            map.values.value(part.scalars[k] / D)[part.scalars[k] % D];
      I(to, to) += part.dense();
      i(to) += part.dense() * x;
    }
    const AnchoredInformation ours = anchored_information(joined);
    const Eigen::MatrixXd expected = I(ours.scalars, ours.scalars);
    EXPECT_LT(relative_distance(ours.dense(), expected), 1e-10);
    const Eigen::VectorXd right = i(ours.scalars);
    const Eigen::VectorXd x = test::dense_solve(expected, right);
    for (std::size_t k = 0; k < ours.scalars.size(); ++k)
      EXPECT_NEAR(joined.values.value(ours.scalars[k] / D)[ours.scalars[k] % D],
                  x(static_cast<Eigen::Index>(k)), 1e-8);
  }
}

/// Lemma 1 for features: where both maps are observations in the frame of what they share, the
/// linear solve is the nonlinear minimiser, whatever the disagreement.
TYPED_TEST(FeaturesOnly, PublishedJoinIsTheMinimiserOfItsObjective) {
  constexpr int D = TypeParam::value;
  Dice dice(6);
  const auto pair = two_maps_of_points<D>(dice, D + 1, 0.5);
  const Map<D>& a = pair.first;
  const Map<D>& b = pair.second;
  const Map<D>* const maps[] = {&a, &b};
  const auto chosen = common_points<D>(maps);
  ASSERT_TRUE(chosen.has_value());
  const Map<D> joined = join_as_published(a, b, chosen->anchor);
  CeresReference<D> objective;
  for (const Map<D>* map : maps) {
    Map<D> there = change_frame(*map, chosen->anchor);
    there.solved_in = there.anchor;
    objective.add(as_local_map(there));
  }
  const auto normal = objective.normal_equations(joined.values);
  const Eigen::VectorXd step = test::dense_least_squares(normal.H, normal.b);
  EXPECT_LT(step.cwiseAbs().maxCoeff(), 1e-7);
  EXPECT_LT(relative_distance(joined.information.dense(), normal.H), 1e-7);
}

TYPED_TEST(FeaturesOnly, PublishedJoinSaysWhatIsMissing) {
  constexpr int D = TypeParam::value;
  Dice dice(7);
  auto pair = two_maps_of_points<D>(dice, D, 0.0);
  Map<D>& a = pair.first;
  Map<D>& b = pair.second;
  const auto complaint = [&](const Anchor<D>& anchor) {
    return complaint_of<DisconnectedError>([&] { (void)join_as_published(a, b, anchor); });
  };
  EXPECT_THAT(complaint(points_of<D>({0, 7, 6})), HasSubstr("point:0 is not in both maps"));
  EXPECT_THROW((void)join_as_published(a, b, points_of<D>({99, 7, 6})), InputError);
  // The same points in one place, or in space on one line.
  const std::vector<std::uint64_t> common = ids(D, 8 - D);
  for (Map<D>* map : {&a, &b}) {
    for (std::size_t k = 0; k < common.size(); ++k) {
      const int i = map->variables().require(point_key(common[k]), "test");
      map->values.template set<PointType<D>>(
          i, (D == 2 ? 1.0 : 1.0 + static_cast<double>(k)) * Vec<D>::Ones());
    }
  }
  EXPECT_THAT(complaint_of<DegenerateFrameError>([&] {
                (void)join_as_published(a, b, points_of<D>({common[0], common[1], 7}));
              }),
              AllOf(HasSubstr(to_string(point_key(common[0]))), HasSubstr("do not fix a frame")));
}

/// Maps whose common points leave them free to turn: one in the plane, three on a line in space.
template <int D>
std::pair<Map<D>, Map<D>> loose_maps(Dice& dice) {
  if constexpr (D == 2) return two_maps_of_points<2>(dice, 1, 0.0);
  ValuesBuilder<D> builder;
  for (std::uint64_t k = 0; k < 9; ++k) {
    builder.template add<PointType<D>>(
        point_key(k),
        k < 3 ? Vec<D>((1.0 + static_cast<double>(k)) * Vec<D>::Ones()) : random_point<D>(dice));
  }
  const Values<D> all = std::move(builder).build();
  const auto map = [&](std::uint64_t first) {
    return map_of(dice, part_of(all, {}, {0, 1, 2, first, first + 1, first + 2}),
                  points_of<D>({first, first + 1, first + 2}), kInformation);
  };
  return {map(3), map(6)};
}

TYPED_TEST(FeaturesOnly, MapsWithOneCommonFeatureOrThreeOnALineAreNotJoined) {
  constexpr int D = TypeParam::value;
  Dice dice(8);
  const auto pair = loose_maps<D>(dice);
  const Map<D>& a = pair.first;
  const Map<D>& b = pair.second;
  EXPECT_THAT(complaint_of<DisconnectedError>([&] { (void)join(a, b); }),
              AllOf(HasSubstr(D == 2 ? "shares only 1 variable" : "shares only 3 variables"),
                    HasSubstr(D == 2 ? ": point:7;" : ": point:0 point:1 point:2;"),
                    HasSubstr(D == 2 ? "two common points" : "not on one line")));
  const std::vector<Map<D>> maps{a, b};
  for (const Mode mode : kModes) {
    JoinOptions options;
    options.mode = mode;
    EXPECT_EQ(join_all(std::span<const Map<D>>(maps), {}, options).maps.size(), 2U)
        << "nothing is linked that no variable links";
  }
}

TYPED_TEST(FeaturesOnly, SummaryJoinsSayWhichPointsTheyWereSolvedIn) {
  constexpr int D = TypeParam::value;
  for (const Mode mode : {Mode::kSummary, Mode::kPaper}) {
    Dice dice(9);
    const auto pair = two_maps_of_points<D>(dice, D + 2, kNoise);
    const Map<D>& a = pair.first;
    const Map<D>& b = pair.second;
    JoinOptions options;
    options.mode = mode;
    const std::vector<Map<D>> maps{a, b};
    const JoinResult<D> result = join_all(std::span<const Map<D>>(maps), {}, options);
    ASSERT_EQ(result.maps.size(), 1U);
    const Map<D>& map = result.maps[0];
    EXPECT_NE(map.solved_in.kind, nullptr);
    EXPECT_EQ(map.solved_in, map.anchor);
    EXPECT_LT((motion_into(map.anchor, map.values).R - Mat<D, D>::Identity()).norm(), 1e-14);
    ASSERT_FALSE(result.report.notes.empty());
    EXPECT_THAT(result.report.notes[0], HasSubstr(to_string(map.anchor)));
    if (mode == Mode::kPaper) {
      const Map<D>* const both[] = {&a, &b};
      EXPECT_EQ(map.anchor, common_points<D>(both)->anchor);
      EXPECT_LT(distance(map.values, join_as_published(a, b, map.anchor).values), 1e-12);
      ASSERT_EQ(result.report.notes.size(), 2U);
      EXPECT_THAT(result.report.notes[1],
                  AllOf(HasSubstr("1 join in the frame"), HasSubstr(to_string(map.anchor))));
    }
    // Covariances in another frame come from where the information is exact.
    const Map<D> elsewhere = change_frame(map, points_of<D>({0, 9, 4}));
    const Eigen::MatrixXd g = elsewhere.values.gauge();
    const Map<D> exact = exactly_gauge_free(elsewhere);
    EXPECT_LT((exact.information.dense() * g).cwiseAbs().maxCoeff(),
              1e-8 * exact.information.dense().cwiseAbs().maxCoeff());
  }
}

/// Pose-feature local maps along a world: map k sees poses 2k .. 2k + 2 and `seen` of the points
/// from 3k on, in the frame of its first pose.
template <int D>
std::vector<LocalMap<D>> pose_feature_maps(Dice& dice, const Values<D>& truth, int maps,
                                           const std::vector<int>& seen, double noise) {
  std::vector<LocalMap<D>> out;
  for (int k = 0; k < maps; ++k) {
    const auto pose = static_cast<std::uint64_t>(2 * k);
    std::vector<Key> terms{pose_key(pose + 1), pose_key(pose + 2)};
    for (const auto id : ids(seen[static_cast<std::size_t>(k)], static_cast<std::uint64_t>(3 * k)))
      terms.push_back(point_key(id));
    out.push_back(random_local_map(dice, truth, pose, terms, noise));
  }
  return out;
}

template <int D>
Values<D> world(Dice& dice) {
  Values<D> truth = random_values<D>(dice, ids(11), ids(20));
  truth.transform(truth.pose(pose_key(0)).inverse());
  return truth;
}

TYPED_TEST(FeaturesOnly, LocalMapsAreTheirMarginals) {
  constexpr int D = TypeParam::value;
  Dice dice(10);
  const auto maps = pose_feature_maps<D>(dice, world<D>(dice), 5, {8, 8, 8, 8, 8}, kNoise);
  const FeatureOnlyMaps<D> features = features_only(std::span<const LocalMap<D>>(maps));
  ASSERT_EQ(features.maps.size(), 5U);
  EXPECT_EQ(features.first, (std::vector<int>{0, 1, 2, 3, 4, 5}));
  for (std::size_t k = 0; k < 5; ++k) {
    const Map<D>& map = features.maps[k];
    const Map<D> whole = to_map(maps[k]);
    EXPECT_EQ(map.variables().columns().size(), 1U);
    EXPECT_EQ(map.solved_in, map.anchor);
    const auto poses = poses_of(whole.variables()), points = features_of(whole.variables());
    const Map<D> there = change_frame(whole, map.anchor);
    const Eigen::MatrixXd I = there.information.dense();
    const int p = static_cast<int>(points.size()) * D;
    const int first = whole.variables().offset(points[0]);
    const int other = whole.variables().offset(poses[0]), q = static_cast<int>(I.rows()) - p;
    const Eigen::MatrixXd cross = I.block(first, other, p, q);
    const Eigen::MatrixXd expected =
        I.block(first, first, p, p) -
        cross * test::dense_solve(I.block(other, other, q, q), cross.transpose());
    EXPECT_LT(relative_distance(map.information.dense(), expected), 1e-8);
    for (const int i : points)
      EXPECT_LT(distance(map.values.point(whole.variables().key(i)),
                         there.values.point(whole.variables().key(i))),
                1e-10);
  }
}

TYPED_TEST(FeaturesOnly, NeighboursWithTooFewCommonFeaturesAreJoinedWithTheirPosesFirst) {
  constexpr int D = TypeParam::value;
  Dice dice(11);
  const Values<D> truth = world<D>(dice);
  // Map 1 ends one point short of what map 2 needs.
  const auto maps = pose_feature_maps<D>(dice, truth, 5, {8, 3 + D - 1, 8, 8, 8}, kNoise);
  const FeatureOnlyMaps<D> features = features_only(std::span<const LocalMap<D>>(maps));
  EXPECT_EQ(features.first, (std::vector<int>{0, 1, 3, 4, 5}));
  EXPECT_EQ(features.parts(1), 2);
  // The larger map is what its two parts say together.
  JoinOptions options;
  options.mode = Mode::kObserve;
  const JoinResult<D> both = join_all(std::span<const LocalMap<D>>(maps).subspan(1, 2), options);
  Values<D> expected = both.maps.at(0).values;
  expected.transform(motion_into(features.maps[1].anchor, expected));
  for (const Key& key : features.maps[1].variables().column(0).keys)
    EXPECT_LT(distance(features.maps[1].values.point(key), expected.point(key)), 0.2 * kNoise);
}

TYPED_TEST(FeaturesOnly, ExactMapsGiveTheTruthInEveryModeAndStrategy) {
  constexpr int D = TypeParam::value;
  Dice dice(12);
  const Values<D> truth = world<D>(dice);
  const auto maps = pose_feature_maps<D>(dice, truth, 5, {8, 3 + D - 1, 8, 8, 8}, 0.0);
  const FeatureOnlyMaps<D> features = features_only(std::span<const LocalMap<D>>(maps));
  for (const Mode mode : kModes) {
    for (const Strategy strategy : {Strategy::kDivideAndConquer, Strategy::kSequential}) {
      JoinOptions options;
      options.mode = mode;
      options.strategy = strategy;
      const JoinResult<D> result = join_all(std::span<const Map<D>>(features.maps), {}, options);
      ASSERT_EQ(result.maps.size(), 1U);
      Values<D> there = truth;
      there.transform(motion_into(result.maps[0].anchor, there));
      for (const Key& key : result.maps[0].variables().column(0).keys)
        EXPECT_LT(distance(result.maps[0].values.point(key), there.point(key)), 1e-8);
      EXPECT_EQ(result.report.poses, 0);
    }
  }
}

TYPED_TEST(FeaturesOnly, SequencesThatNothingHoldsTogetherAreRefused) {
  constexpr int D = TypeParam::value;
  Dice dice(13);
  const Values<D> truth = world<D>(dice);
  auto maps = pose_feature_maps<D>(dice, truth, 5, {8, 8, 8, 8, 8}, kNoise);
  maps.erase(maps.begin() + 1, maps.begin() + 4);  // the first and the last share nothing
  EXPECT_THAT(complaint_of<DisconnectedError>(
                  [&] { (void)features_only(std::span<const LocalMap<D>>(maps)); }),
              AllOf(HasSubstr("local maps 1 to 2"), HasSubstr("neither a pose nor")));
  const auto bare = pose_feature_maps<D>(dice, truth, 1, {D - 1}, kNoise);
  EXPECT_THAT(complaint_of<DegenerateFrameError>(
                  [&] { (void)features_only(std::span<const LocalMap<D>>(bare)); }),
              AllOf(HasSubstr("local map 1"), HasSubstr("features alone")));
  EXPECT_THROW((void)features_only(std::span<const LocalMap<D>>()), InputError);
}

}  // namespace
}  // namespace mapjoin
