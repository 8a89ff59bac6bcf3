// Two recordings of one place that share no names.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "mapjoin/association/sessions.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/graph/rename_keys.h"
#include "mapjoin/joining/join.h"
#include "mapjoin/joining/join_all.h"
#include "tests/support/wandering.h"

namespace mapjoin {
namespace {

using namespace test;  // NOLINT
using ::testing::HasSubstr;

template <class T>
class Constellations : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(Constellations, Dimensions);

/// Consecutive local maps of a walk, joined.
template <int D>
Map<D> stretch(const Wandering<D>& world, std::size_t first, std::size_t last) {
  Map<D> out = to_map(world.maps[first]);
  for (std::size_t m = first + 1; m < last; ++m) out = join(out, to_map(world.maps[m]));
  return out;
}

/// All keys in another session.
template <int D>
Map<D> in_session(const Map<D>& map, std::uint32_t session) {
  std::vector<std::pair<Key, Key>> names;
  for (int i = 0; i < map.variables().size(); ++i) {
    Key key = map.variables().key(i);
    key.session = session;
    names.emplace_back(map.variables().key(i), key);
  }
  return rename_keys(map, Renaming(names));
}

TYPED_TEST(Constellations, PlaceAMapThatSharesNoName) {
  constexpr int D = TypeParam::value;
  for (const std::uint64_t seed : {1U, 2U, 8U}) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    const Wandering<D> world = wander<D>(dice, {});
    const Map<D> a = stretch(world, 0, 7);
    const Map<D> b = in_session(stretch(world, 4, 12), 1);
    const auto placement = place_by_constellations(a, b);
    ASSERT_TRUE(placement);
    const Rigid<D> truth = world.truth.pose(pose_key(4));  // where b is anchored
    EXPECT_LT((placement->a_from_b.t - truth.t).norm(), 0.5);
    EXPECT_LT((placement->a_from_b.R - truth.R).norm(), 0.05);
    for (const auto& [in_b, in_a] : placement->names) EXPECT_EQ(in_b.id, in_a.id);

    const Association found = associate_unplaced(a, b);
    std::size_t common = 0;
    for (int i = 0; i < b.variables().size(); ++i) {
      const Key key = b.variables().key(i);
      common += key.type == Tag("point") && a.variables().find(point_key(key.id)) ? 1 : 0;
    }
    for (const Match& match : found.matches) EXPECT_EQ(match.a.id, match.b.id);
    EXPECT_GE(static_cast<double>(found.matches.size()), 0.98 * static_cast<double>(common));
    EXPECT_LE(found.matches.size(), common);
  }
}

TYPED_TEST(Constellations, DoNotDependOnTheFrameOfEither) {
  constexpr int D = TypeParam::value;
  Dice dice(4);
  const Wandering<D> world = wander<D>(dice, {});
  const Map<D> a = stretch(world, 0, 7);
  const Map<D> b = in_session(stretch(world, 4, 12), 1);
  const Map<D> other = change_frame(b, pose_anchor<D>(pose_key(9, 1)));
  const auto one = place_by_constellations(a, b);
  const auto two = place_by_constellations(a, other);
  ASSERT_TRUE(one && two);
  EXPECT_EQ(one->names, two->names);
}

TYPED_TEST(Constellations, SayNothingOfDifferentPlaces) {
  constexpr int D = TypeParam::value;
  Dice dice(5), other_dice(6);
  const Map<D> a = stretch(wander<D>(dice, {}), 0, 6);
  const Map<D> b = in_session(stretch(wander<D>(other_dice, {}), 0, 6), 1);
  EXPECT_FALSE(place_by_constellations(a, b));
  EXPECT_THAT(complaint_of<DisconnectedError>([&] { associate_unplaced(a, b); }),
              HasSubstr("cannot be placed by their points"));
}

TEST(ConstellationsOfRows, CannotTellOneRowFromTheNext) {
  Dice dice(7);
  const auto rows_seen_from = [&](int first) {
    LocalMap<2> map;
    map.anchor = pose_anchor<2>(pose_key(0));
    std::vector<int> offsets{0};
    for (int i = first; i < first + 8; ++i) {
      for (int j = 0; j < 6; ++j) {
        map.add_term<Point2>(point_key(static_cast<std::uint64_t>(10 * i + j)),
                             noisy<Point2>(dice, Vec<2>(3.0 * (i - first), 3.0 * j), 0.02));
        offsets.push_back(offsets.back() + 2);
      }
    }
    map.information = SymmetricBlockMatrix::from_dense(
        offsets, 2500.0 * Eigen::MatrixXd::Identity(offsets.back(), offsets.back()));
    return to_map(map);
  };
  EXPECT_FALSE(place_by_constellations(rows_seen_from(0), in_session(rows_seen_from(3), 1)));
}

TYPED_TEST(Constellations, LeadToTheJoinOfSessions) {
  constexpr int D = TypeParam::value;
  Dice dice(8);
  const Wandering<D> world = wander<D>(dice, {});
  const Map<D> monday = stretch(world, 0, 6);
  const Map<D> tuesday = in_session(stretch(world, 3, 9), 1);
  const Map<D> wednesday = in_session(stretch(world, 6, 12), 2);
  const std::vector<Map<D>> maps{monday, tuesday, wednesday};
  const AssociatedSessions<D> found = associate_sessions(std::span<const Map<D>>(maps));
  EXPECT_THAT(found.report.warnings, ::testing::IsEmpty());
  const JoinResult<D> joined = join_all(std::span<const Map<D>>(found.maps), {});
  ASSERT_EQ(joined.maps.size(), 1U);
  // The same place in two sessions' names is the same place.
  const Values<D>& x = joined.maps[0].values;
  for (const std::uint64_t p : {4U, 5U, 6U}) {
    if (!x.contains(pose_key(p)) || !x.contains(pose_key(p, 1))) continue;
    EXPECT_LT((x.pose(pose_key(p)).t - x.pose(pose_key(p, 1)).t).norm(), 0.2);
  }
}

}  // namespace
}  // namespace mapjoin
