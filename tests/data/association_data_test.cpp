// Data association on the data sets, with their numbers hidden: SLSJF section III-C.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "mapjoin/association/sessions.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/graph/rename_keys.h"
#include "mapjoin/joining/join.h"
#include "mapjoin/solvers/covariance.h"
#include "tests/support/data_sets.h"

namespace mapjoin::test {
namespace {

using Maps = std::vector<LocalMap<2>>;
using MapSpan = std::span<const LocalMap<2>>;

std::optional<Maps> local_maps(const std::string& name) {
  const auto folder = name.rfind("mat/", 0) == 0 ? data_file(name) : unpacked_local_maps(name);
  if (!folder) return std::nullopt;
  return std::get<LocalMapSet<2>>(read_local_maps(*folder)).maps;
}

AssociationScore judged(const AssociatedMaps<2>& found) {
  std::vector<Key> named;
  for (const Sighting& s : found.sightings) named.push_back(s.original);
  return score(found.names, named);
}

struct Expected {
  std::string set;
  Matcher matcher;
  double precision, recall;

  friend std::ostream& operator<<(std::ostream& out, const Expected& e) {
    return out << e.set << " by matcher " << static_cast<int>(e.matcher);
  }
};

class Hidden : public testing::TestWithParam<Expected> {};

TEST_P(Hidden, NamesAreFoundAgain) {
  const Expected& e = GetParam();
  const auto maps = local_maps(e.set);
  if (!maps) GTEST_SKIP() << missing_data(e.set);
  AssociationOptions options;
  options.matcher = e.matcher;
  for (const Strategy strategy : {Strategy::kDivideAndConquer, Strategy::kSequential}) {
    const AssociatedMaps<2> found = join_associating(MapSpan(*maps), options, strategy);
    const AssociationScore s = judged(found);
    EXPECT_GE(s.precision(), e.precision);
    EXPECT_GE(s.recall(), e.recall);
  }
}

// simu_8240_50: all but the closing of the loop, see Loop below.
INSTANTIATE_TEST_SUITE_P(
    DataSets, Hidden,
    testing::Values(Expected{"simu_8240_50", Matcher::kNearest, 0.999, 0.96},
                    Expected{"simu_8240_50", Matcher::kGlobal, 0.999, 0.96},
                    Expected{"simu_8240_50", Matcher::kJoint, 0.999, 0.96},
                    Expected{"victoria_park_200", Matcher::kNearest, 0.999, 0.98},
                    Expected{"victoria_park_200", Matcher::kGlobal, 0.999, 0.98},
                    Expected{"victoria_park_200", Matcher::kJoint, 0.999, 0.985},
                    Expected{"mat/without_true_index", Matcher::kNearest, 1.0, 1.0},
                    Expected{"mat/without_true_index", Matcher::kGlobal, 1.0, 1.0},
                    Expected{"mat/without_true_index", Matcher::kJoint, 1.0, 1.0}));

/// The local maps that only the two last of simu_8240_50 have in common with the first ten: their
/// features there, moved by rows and columns of the world's grid (50 features a row, 3 m apart).
Maps with_loop_moved(Maps maps, int rows, int columns, int& matches) {
  std::set<std::uint64_t> early;
  for (std::size_t m = 0; m < 10; ++m) {
    for (const Key& key : maps[m].keys) {
      if (key.type == Tag("point")) early.insert(key.id);
    }
  }
  std::vector<std::pair<Key, Key>> names;
  matches = 0;
  for (std::size_t m = 48; m < 50; ++m) {
    for (const Key& key : maps[m].keys) {
      if (key.type != Tag("point")) continue;
      const int row = (static_cast<int>(key.id) - 1) / 50 + rows;
      const int column = (static_cast<int>(key.id) - 1) % 50 + columns;
      const auto id = static_cast<std::uint64_t>(50 * row + column + 1);
      if (row >= 0 && column >= 0 && column < 50 && early.count(id) > 0) {
        names.emplace_back(key, point_key(id));
        matches += m == 49 ? 1 : 0;
      } else if (early.count(key.id) > 0) {
        names.emplace_back(key, point_key(key.id + 100000));
      }
    }
  }
  for (std::size_t m = 48; m < 50; ++m) maps[m] = rename_keys(maps[m], Renaming(names));
  return maps;
}

// The features of simu_8240_50 stand on a grid of 3 m, and where the loop closes, the map is
// uncertain by as much. Closed one row or column beside, it fits the local maps as well or better,
// by as many features: the numbers are all that tells where it closes.
TEST(Loop, OfSimu8240FitsBesideAsWellAsWhereItIs) {
  const auto maps = local_maps("simu_8240_50");
  if (!maps) GTEST_SKIP() << missing_data("simu_8240_50");
  const double right = join_all(MapSpan(*maps)).report.chi2;
  int as_good = 0;
  for (const auto& [rows, columns] : {std::pair(0, 1), {0, -1}, {-1, 1}, {-2, 1}, {-2, -1}}) {
    int matches = 0;
    const Maps moved = with_loop_moved(*maps, rows, columns, matches);
    EXPECT_GE(matches, 7);
    const double chi2 = join_all(MapSpan(moved)).report.chi2;
    EXPECT_LT(chi2, right + 2.0) << rows << " " << columns;
    as_good += chi2 < right ? 1 : 0;
  }
  EXPECT_GE(as_good, 3);
}

// So what is left open is the loop, and nothing else.
TEST(Loop, OfSimu8240IsLeftOpenAndAllElseIsFound) {
  const auto maps = local_maps("simu_8240_50");
  if (!maps) GTEST_SKIP() << missing_data("simu_8240_50");
  const AssociatedMaps<2> found = join_associating(MapSpan(*maps));
  EXPECT_EQ(found.report.suspicious, 0);
  EXPECT_EQ(judged(found).precision(), 1.0);
  // The same data without the names that would close it: everything.
  int matches = 0;
  const Maps open = with_loop_moved(*maps, 100, 0, matches);
  const AssociationScore s = judged(join_associating(MapSpan(open)));
  EXPECT_EQ(s.precision(), 1.0);
  EXPECT_EQ(s.recall(), 1.0);
}

// Linear divide and conquer with association is that with given numbers wherever these are found.
TEST(Linear, JoinsWithFoundNamesAreThoseWithGivenOnes) {
  for (const std::string set : {"mat/without_true_index", "mat/simu_535_5", "simu_8240_50"}) {
    SCOPED_TRACE(set);
    auto maps = local_maps(set);
    if (!maps) GTEST_SKIP() << missing_data(set);
    if (set == "simu_8240_50") {
      int matches = 0;
      maps = with_loop_moved(*maps, 100, 0, matches);
    }
    const AssociatedMaps<2> found = join_associating(MapSpan(*maps));
    ASSERT_EQ(judged(found).recall(), 1.0);
    std::vector<std::pair<Key, Key>> names;  // from what was found to what it is called
    for (std::size_t k = 0; k < found.names.size(); ++k)
      names.emplace_back(found.names[k], found.sightings[k].original);
    const Map<2> ours = rename_keys(found.joined, Renaming(names));
    // The same joins, in the same order.
    std::vector<Map<2>> level;
    for (const LocalMap<2>& map : *maps) level.push_back(to_map(map));
    while (level.size() > 1) {
      std::vector<Map<2>> next;
      for (std::size_t k = 0; k + 1 < level.size(); k += 2)
        next.push_back(join(level[k], level[k + 1]));
      if (level.size() % 2 == 1) next.push_back(level.back());
      level = std::move(next);
    }
    ASSERT_EQ(ours.variables(), level[0].variables());
    EXPECT_LT(ours.values.local(level[0].values).cwiseAbs().maxCoeff(), 1e-7);
  }
}

// Swapped pairs of features more than five standard deviations apart are flagged by the join that
// contains them; joins with the given numbers are not.
TEST(WrongMatches, DoNotPassSilently) {
  const auto maps = local_maps("simu_8240_50");
  if (!maps) GTEST_SKIP() << missing_data("simu_8240_50");
  int joins = 0, alarms = 0, swapped = 0, flagged = 0;
  Map<2> all = to_map((*maps)[0]);
  for (std::size_t m = 1; m < maps->size(); ++m) {
    const Map<2> next = to_map((*maps)[m]);
    const auto tested = check_matches(all, next);
    ++joins;
    alarms += std::any_of(tested.begin(), tested.end(), [](const auto& t) { return t.flagged; });
    std::vector<Key> common;
    for (const TestedPair& pair : tested) {
      if (pair.b.type == Tag("point")) common.push_back(pair.b);
    }
    const Covariance<2> covariance(next);
    for (std::size_t k = 0; k + 1 < common.size(); ++k) {
      const Key &one = common[k], &other = common[k + 1];
      const Eigen::Vector2d d = next.values.point(one) - next.values.point(other);
      const Eigen::MatrixXd P = covariance.of(std::vector<Key>{one, other});
      const Eigen::Matrix2d S = P.topLeftCorner<2, 2>() + P.bottomRightCorner<2, 2>() -
                                P.topRightCorner<2, 2>() - P.bottomLeftCorner<2, 2>();
      if (d.dot(S.inverse() * d) < 25.0) continue;
      ++swapped;
      const Map<2> wrong = rename_keys(next, Renaming({{one, other}, {other, one}}));
      const auto checked = check_matches(all, wrong);
      flagged += std::any_of(checked.begin(), checked.end(), [&](const TestedPair& t) {
        return t.flagged && (t.b == one || t.b == other);
      });
    }
    all = join(all, next);
  }
  RecordProperty("swapped", swapped);
  RecordProperty("flagged", flagged);
  RecordProperty("joins", joins);
  RecordProperty("alarms", alarms);
  EXPECT_GT(swapped, 100);
  EXPECT_GE(flagged, 0.99 * swapped);
  EXPECT_LE(alarms, 0.05 * joins);
}

// Two halves of the Victoria Park run, no name in common, one turned and moved: placed by its
// trees.
TEST(Sessions, OfVictoriaParkAreFoundToBeOnePlace) {
  const auto maps = local_maps("victoria_park_200");
  if (!maps) GTEST_SKIP() << missing_data("victoria_park_200");
  const auto half = [&](std::size_t first, std::size_t last, std::uint32_t session) {
    Maps part;
    for (std::size_t m = first; m < last; ++m) {
      std::vector<std::pair<Key, Key>> names;
      for (Key key : (*maps)[m].keys) names.emplace_back(key, Key{key.type, session, key.id});
      const Key start = (*maps)[m].anchor.keys[0];
      names.emplace_back(start, Key{start.type, session, start.id});
      part.push_back(rename_keys((*maps)[m], Renaming(names)));
    }
    return join_all(MapSpan(part)).maps.at(0);
  };
  const Map<2> first = half(0, 100, 1), second = half(100, 200, 2);
  const Association found = associate_unplaced(first, second);
  int right = 0, common = 0;
  for (const Match& match : found.matches) right += match.a.id == match.b.id ? 1 : 0;
  for (const Key& key : second.variables().column(second.variables().find_column("point")).keys)
    common += first.variables().find(point_key(key.id, 1)) ? 1 : 0;
  RecordProperty("matches", static_cast<int>(found.matches.size()));
  RecordProperty("right", right);
  RecordProperty("common", common);
  EXPECT_GE(right, 0.95 * static_cast<double>(found.matches.size()));
  EXPECT_GE(right, 0.8 * common);
}

}  // namespace
}  // namespace mapjoin::test
