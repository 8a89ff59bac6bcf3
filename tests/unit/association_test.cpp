// Data association between two maps, and along a whole walk of local maps.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "mapjoin/association/associated_join.h"
#include "mapjoin/evaluation/chi_squared.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/graph/rename_keys.h"
#include "mapjoin/joining/join.h"
#include "mapjoin/joining/join_all.h"
#include "mapjoin/solvers/covariance.h"
#include "tests/support/dense.h"
#include "tests/support/user_types.h"
#include "tests/support/wandering.h"

namespace mapjoin {
namespace {

using namespace test;  // NOLINT
using ::testing::HasSubstr;

template <class T>
class Associate : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(Associate, Dimensions);

/// Two maps that share one pose by key, and points without.
template <int D>
struct TwoMaps {
  Map<D> a, b;
  std::vector<std::pair<Key, Key>> right;  ///< names of b's points, and those they have in a

  bool is_right(const Key& in_a, const Key& in_b) const {
    return std::find(right.begin(), right.end(), std::pair(in_b, in_a)) != right.end();
  }
};

template <int D>
TwoMaps<D> two_maps(std::uint64_t seed, const Walk& walk = {}) {
  Dice dice(seed);
  const Wandering<D> world = wander<D>(dice, walk);
  TwoMaps<D> out;
  out.a = to_map(world.maps[0]);
  for (std::size_t m = 1; m + 1 < world.maps.size(); ++m)
    out.a = join(out.a, to_map(world.maps[m]));
  const Map<D> last = to_map(world.maps.back());
  std::vector<std::pair<Key, Key>> hidden;
  for (const Key& key : last.variables().column(last.variables().find_column("point")).keys) {
    const Key own = point_key(key.id + 1000);
    hidden.emplace_back(key, own);
    if (out.a.variables().find(key)) out.right.emplace_back(own, key);
  }
  out.b = rename_keys(last, Renaming(hidden));
  return out;
}

// What is the same is matched, or said to be doubtful; what is not the same is never matched.
TYPED_TEST(Associate, FindsWhatIsTheSameAndNothingElse) {
  constexpr int D = TypeParam::value;
  std::size_t right = 0, matched = 0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    const TwoMaps<D> maps = two_maps<D>(seed);
    for (const Matcher matcher : {Matcher::kNearest, Matcher::kGlobal, Matcher::kJoint}) {
      AssociationOptions options;
      options.matcher = matcher;
      const Association found = associate(maps.a, maps.b, options);
      for (const Match& match : found.matches) EXPECT_TRUE(maps.is_right(match.a, match.b));
      for (const auto& [in_b, in_a] : maps.right) {
        const bool is_matched =
            std::any_of(found.matches.begin(), found.matches.end(),
                        [&, b = in_b](const Match& match) { return match.b == b; });
        const bool is_doubtful =
            std::find(found.doubtful.begin(), found.doubtful.end(), in_b) != found.doubtful.end();
        EXPECT_NE(is_matched, is_doubtful);
      }
      const int c = maps.b.variables().find_column("point");
      EXPECT_EQ(found.matches.size() + found.unmatched.size(),
                static_cast<std::size_t>(maps.b.variables().column(c).size()));
      EXPECT_TRUE(found.complete);
      right += maps.right.size();
      matched += found.matches.size();
    }
  }
  EXPECT_GT(right, 100U);
  EXPECT_GE(static_cast<double>(matched), 0.95 * static_cast<double>(right));
}

TYPED_TEST(Associate, SaysTheSameInWhateverFramesTheMapsAre) {
  constexpr int D = TypeParam::value;
  const TwoMaps<D> maps = two_maps<D>(3);
  const Association one = associate(maps.a, maps.b);
  const Key start = maps.b.anchor.keys[0];
  const Map<D> a = change_frame(maps.a, pose_anchor<D>(pose_key(2)));
  const Association other = associate(a, maps.b);
  ASSERT_EQ(one.matches.size(), other.matches.size());
  ASSERT_GT(one.matches.size(), 3U);
  EXPECT_TRUE(maps.a.variables().find(start));
  for (std::size_t k = 0; k < one.matches.size(); ++k) {
    EXPECT_EQ(one.matches[k].a, other.matches[k].a);
    EXPECT_EQ(one.matches[k].b, other.matches[k].b);
    EXPECT_NEAR(one.matches[k].chi2, other.matches[k].chi2, 1e-4 * (1.0 + one.matches[k].chi2));
  }
}

TYPED_TEST(Associate, JoinsToTheMapThatGivenNamesLeadTo) {
  constexpr int D = TypeParam::value;
  const TwoMaps<D> maps = two_maps<D>(4);
  const Association found = associate(maps.a, maps.b);
  const Map<D> joined = join(maps.a, rename_keys(maps.b, Renaming(names_in_a(found))));
  const Map<D> given = join(maps.a, rename_keys(maps.b, Renaming(maps.right)));
  EXPECT_EQ(joined.variables(), given.variables());
  EXPECT_LT(distance(joined.values, given.values), 1e-12);
}

// chi2 of the innovation from the covariance of the difference, by numbers of the maps alone.
TYPED_TEST(Associate, ComparesByTheCovarianceOfBothMaps) {
  constexpr int D = TypeParam::value;
  const TwoMaps<D> maps = two_maps<D>(5);
  const ComparedMaps<D> compared = in_common_frame(maps.a, maps.b);
  const Covariance<D> of_a(compared.a), of_b(compared.b);
  const CandidatePairs pairs = candidate_pairs(compared, {});
  ASSERT_GT(pairs.size(), 4);
  for (int p = 0; p < pairs.size(); ++p) {
    const auto& pair = pairs.pairs[static_cast<std::size_t>(p)];
    const Key a = compared.a.variables().key(pair.a), b = compared.b.variables().key(pair.b);
    const Eigen::VectorXd r = compared.a.values.point(a) - compared.b.values.point(b);
    EXPECT_LT((pairs.innovation(p) - r).norm(), 1e-12);
    for (int q = 0; q < pairs.size(); ++q) {
      const auto& other = pairs.pairs[static_cast<std::size_t>(q)];
      const Eigen::MatrixXd S = of_a.block(a, compared.a.variables().key(other.a)) +
                                of_b.block(b, compared.b.variables().key(other.b));
      EXPECT_LT((pairs.covariance(p, q) - S).norm(), 1e-9);
    }
  }
}

TYPED_TEST(Associate, LeavesOutNoCandidateThatIsWithinTheGate) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    Walk walk;
    walk.sigma = 0.5;  // so that many are
    walk.sigma_turn = 0.03;
    const TwoMaps<D> maps = two_maps<D>(seed, walk);
    const ComparedMaps<D> compared = in_common_frame(maps.a, maps.b);
    const Covariance<D> of_a(compared.a), of_b(compared.b);
    CandidateOptions options;
    options.gate = 0.9;
    std::set<std::pair<Key, Key>> found, expected;
    for (const auto& pair : candidate_pairs(compared, options).pairs)
      found.emplace(compared.a.variables().key(pair.a), compared.b.variables().key(pair.b));
    const auto points = [](const Map<D>& map) {
      return map.variables().column(map.variables().find_column("point")).keys;
    };
    for (const Key& a : points(compared.a)) {
      for (const Key& b : points(compared.b)) {
        const Eigen::VectorXd r = compared.a.values.point(a) - compared.b.values.point(b);
        const Eigen::MatrixXd S = of_a.block(a, a) + of_b.block(b, b);
        if (r.dot(test::dense_solve(S, r).col(0)) <= chi_squared_quantile(0.9, D))
          expected.emplace(a, b);
      }
    }
    EXPECT_EQ(found, expected);
    EXPECT_GT(expected.size(), 5U);
  }
}

/// A largest distance leaves out what is farther apart, and nothing else (III-C1).
TYPED_TEST(Associate, ComparesNothingBeyondTheLargestDistance) {
  constexpr int D = TypeParam::value;
  const TwoMaps<D> maps = two_maps<D>(3, {.sigma = 0.5});
  const ComparedMaps<D> compared = in_common_frame(maps.a, maps.b);
  const CandidatePairs all = candidate_pairs(compared, {});
  for (const double farthest : {0.3, 1.0, 1e6}) {
    CandidateOptions options;
    options.max_distance = farthest;
    std::vector<std::pair<int, int>> expected, found;
    for (int p = all.known; p < all.size(); ++p) {
      if (all.innovation(p).norm() <= farthest)
        expected.emplace_back(all.pairs[static_cast<std::size_t>(p)].a,
                              all.pairs[static_cast<std::size_t>(p)].b);
    }
    const CandidatePairs near = candidate_pairs(compared, options);
    for (int p = near.known; p < near.size(); ++p)
      found.emplace_back(near.pairs[static_cast<std::size_t>(p)].a,
                         near.pairs[static_cast<std::size_t>(p)].b);
    EXPECT_EQ(found, expected) << farthest;
    EXPECT_LE(found.size(), static_cast<std::size_t>(all.size() - all.known));
  }
  EXPECT_GT(all.size(), all.known);
}

TYPED_TEST(Associate, TakesTheFrameOfCommonPointsWhereNoPoseIsCommon) {
  constexpr int D = TypeParam::value;
  TwoMaps<D> maps = two_maps<D>(6);
  // Some points are known by key, the pose is not.
  ASSERT_GE(maps.right.size(), 8U);
  std::vector<std::pair<Key, Key>> names{{pose_key(11), pose_key(111)},
                                         {pose_key(12), pose_key(112)}};
  for (std::size_t k = 0; k < 4; ++k) names.push_back(maps.right[2 * k]);
  const Map<D> b = rename_keys(maps.b, Renaming(names));
  const Association found = associate(maps.a, b);
  EXPECT_EQ(found.matches.size(), maps.right.size() - 4);
  for (const Match& match : found.matches) EXPECT_TRUE(maps.is_right(match.a, match.b));
}

TYPED_TEST(Associate, RefusesMapsThatNothingPlaces) {
  constexpr int D = TypeParam::value;
  const TwoMaps<D> maps = two_maps<D>(7);
  const Map<D> b = rename_keys(maps.b, Renaming({{pose_key(11), pose_key(111)}}));
  EXPECT_THAT(complaint_of<DisconnectedError>([&] { associate(maps.a, b); }),
              HasSubstr("share by key neither a pose nor"));
}

TYPED_TEST(Associate, DoesNotMatchWhatMayNotBe) {
  constexpr int D = TypeParam::value;
  const TwoMaps<D> maps = two_maps<D>(8);
  AssociationOptions options;
  options.candidates.types = {Tag("line")};
  const Association found = associate(maps.a, maps.b, options);
  EXPECT_TRUE(found.matches.empty());
  EXPECT_TRUE(found.unmatched.empty());
  options.candidates.types.clear();
  options.candidates.gate = 1.5;
  EXPECT_THROW(associate(maps.a, maps.b, options), InputError);
}

TYPED_TEST(Associate, FindsTheNamesOfAWholeWalk) {
  constexpr int D = TypeParam::value;
  Dice dice(9);
  Walk walk;
  walk.maps = 20;
  const Wandering<D> world = wander<D>(dice, walk);
  for (const Strategy strategy : {Strategy::kDivideAndConquer, Strategy::kSequential}) {
    const AssociatedMaps<D> found =
        join_associating(std::span<const LocalMap<D>>(world.maps), {}, strategy);
    std::vector<Key> named;
    for (const Sighting& s : found.sightings) named.push_back(s.original);
    const AssociationScore judged = score(found.names, named);
    EXPECT_EQ(judged.precision(), 1.0);
    EXPECT_GE(judged.recall(), 0.98);
    EXPECT_GT(judged.wanted, 150);
    // The same join with given names, of what is named the same.
    if (judged.recall() < 1.0) continue;
    const auto given = join_all(std::span<const LocalMap<D>>(world.maps));
    const auto ours = join_all(std::span<const LocalMap<D>>(found.local_maps));
    EXPECT_NEAR(ours.report.chi2, given.report.chi2, 1e-6 * given.report.chi2);
  }
}

TYPED_TEST(Associate, GivesEverySightingAKeyOfItsOwn) {
  constexpr int D = TypeParam::value;
  Dice dice(10);
  const Wandering<D> world = wander<D>(dice, {});
  const OwnKeys<D> own = own_keys(std::span<const LocalMap<D>>(world.maps));
  std::set<Key> keys;
  std::size_t points = 0;
  for (const LocalMap<D>& map : own.local_maps) {
    for (const Key& key : map.keys) {
      if (key.type != Tag("point")) continue;
      keys.insert(key);
      ++points;
    }
  }
  EXPECT_EQ(keys.size(), points);
  EXPECT_EQ(own.sightings.size(), points);
  EXPECT_EQ(own.local_maps[3].anchor, world.maps[3].anchor);
}

// Swapped names more than five standard deviations apart are noticed by the join that holds them.
TYPED_TEST(Associate, DoesNotLetWrongMatchesPassSilently) {
  constexpr int D = TypeParam::value;
  int swapped = 0, flagged = 0, joins = 0, alarms = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const TwoMaps<D> maps = two_maps<D>(seed);
    const Map<D> right = rename_keys(maps.b, Renaming(maps.right));
    const std::vector<TestedPair> tested = check_matches(maps.a, right);
    ++joins;
    alarms += std::any_of(tested.begin(), tested.end(), [](const auto& t) { return t.flagged; });
    const ComparedMaps<D> compared = in_common_frame(maps.a, right);
    const CandidatePairs pairs = common_pairs(compared);
    const Covariance<D> of_b(compared.b);
    for (std::size_t k = 0; k + 1 < maps.right.size(); k += 2) {
      const Key first = maps.right[k].second, second = maps.right[k + 1].second;
      // Apart by how the two lie to one another in b.
      const Eigen::VectorXd d = compared.b.values.point(first) - compared.b.values.point(second);
      const Eigen::MatrixXd joint = of_b.of(std::vector<Key>{first, second});
      const Eigen::MatrixXd S = joint.topLeftCorner(D, D) + joint.bottomRightCorner(D, D) -
                                joint.topRightCorner(D, D) - joint.bottomLeftCorner(D, D);
      if (d.dot(test::dense_solve(S, d).col(0)) < 25.0) continue;
      auto names = maps.right;
      names[k].second = second;
      names[k + 1].second = first;
      const auto checked = check_matches(maps.a, rename_keys(maps.b, Renaming(names)));
      ++swapped;
      flagged += std::any_of(checked.begin(), checked.end(), [&](const TestedPair& t) {
        return t.flagged && (t.a == first || t.a == second);
      });
    }
  }
  EXPECT_GT(swapped, 100);
  EXPECT_GE(flagged, 0.99 * swapped);
  EXPECT_LE(alarms, 0.05 * joins);
}

TEST(AssociateLines, MatchesTypesOfOnesOwn) {
  // Two rooms seen from two poses; walls have no names.
  const std::vector<own::Line::Value<double>> walls = {
      {0.0, 3.0}, {1.6, -4.0}, {3.1, 2.0}, {-1.5, 5.0}, {0.3, 9.0}};
  Dice dice(11);
  const auto seen_from = [&](std::uint64_t start, std::uint64_t end, const Rigid2& pose,
                             const Rigid2& step, std::size_t first, std::size_t last,
                             std::uint64_t name) {
    LocalMap<2> map;
    map.anchor = pose_anchor<2>(pose_key(start));
    map.add_term<Pose2>(pose_key(end), noisy<Pose2>(dice, step, 0.005));
    std::vector<int> offsets{0, 3};
    for (std::size_t k = first; k < last; ++k) {
      map.add_term<own::Line>(
          own::line_key(name + k),
          noisy<own::Line>(dice, own::Line::transform<double>(pose.inverse(), walls[k]), 0.005));
      offsets.push_back(offsets.back() + 2);
    }
    map.information = SymmetricBlockMatrix::from_dense(
        offsets, 4e4 * Eigen::MatrixXd::Identity(offsets.back(), offsets.back()));
    return to_map(map);
  };
  const Rigid2 step = rigid2(1.0, 0.5, 0.4);
  const Map<2> a = seen_from(0, 1, Rigid2(), step, 0, 4, 100);
  const Map<2> b = seen_from(1, 2, step, step, 1, 5, 200);
  const Association found = associate(a, b);
  ASSERT_EQ(found.matches.size(), 3U);
  for (const Match& match : found.matches) EXPECT_EQ(match.a.id + 100, match.b.id);
  EXPECT_EQ(found.unmatched, std::vector<Key>{own::line_key(204)});
}

}  // namespace
}  // namespace mapjoin
