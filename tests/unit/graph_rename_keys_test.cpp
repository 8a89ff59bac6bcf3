#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "mapjoin/frames/change_frame.h"
#include "mapjoin/graph/rename_keys.h"
#include "mapjoin/joining/join_all.h"
#include "tests/support/random_maps.h"

namespace mapjoin {
namespace {

using namespace test;  // NOLINT
using ::testing::AllOf;
using ::testing::HasSubstr;

template <class T>
class RenameKeys : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(RenameKeys, Dimensions);

/// Numbers turned round, so that the order of all variables changes.
template <int D>
std::vector<std::pair<Key, Key>> turned_round(const VariableSet<D>& variables) {
  std::vector<std::pair<Key, Key>> out;
  for (int i = 0; i < variables.size(); ++i) {
    const Key key = variables.key(i);
    out.emplace_back(key, Key{key.type, 1, 1000 - key.id});
  }
  return out;
}
std::vector<std::pair<Key, Key>> reversed(std::vector<std::pair<Key, Key>> names) {
  for (auto& [from, to] : names) std::swap(from, to);
  return names;
}

TYPED_TEST(RenameKeys, ThereAndBackIsTheSameMap) {
  constexpr int D = TypeParam::value;
  Dice dice(1);
  const Map<D> map = random_map<D>(dice, ids(5), ids(6), 2);
  const auto names = turned_round(map.variables());
  const Map<D> other = rename_keys(map, Renaming(names));
  EXPECT_EQ(other.anchor.keys[0], (Key{"pose", 1, 998}));
  EXPECT_LT((other.values.pose({"pose", 1, 997}).t - map.values.pose(pose_key(3)).t).norm(), 1e-15);
  const Map<D> back = rename_keys(other, Renaming(reversed(names)));
  EXPECT_EQ(back.variables(), map.variables());
  EXPECT_LT(distance(back.values, map.values), 1e-15);
  EXPECT_EQ(distance(back.information.dense(), map.information.dense()), 0.0);
  EXPECT_EQ(back.anchor, map.anchor);
  EXPECT_EQ(back.solved_in, map.solved_in);
}

TYPED_TEST(RenameKeys, ChangesNothingButTheNames) {
  constexpr int D = TypeParam::value;
  Dice dice(2);
  const RandomGraph<D> world = random_graph<D>(dice, {});
  const auto names = turned_round(world.graph.variables);
  const JoinResult<D> before = join_all(world.graph);
  const JoinResult<D> after = join_all(rename_keys(world.graph, Renaming(names)));
  EXPECT_NEAR(after.report.chi2, before.report.chi2, 1e-6 * before.report.chi2);
  // A map with its observations, joined again.
  const Map<D> renamed = rename_keys(before.maps[0], Renaming(names));
  ASSERT_NE(renamed.observations, nullptr);
  EXPECT_EQ(renamed.observations->size(), before.maps[0].observations->size());
  EXPECT_EQ(renamed.observations->variables, renamed.variables());
  const JoinResult<D> again = join_all(std::span<const Map<D>>(&renamed, 1), {});
  EXPECT_NEAR(again.report.chi2, before.report.chi2, 1e-6 * before.report.chi2);
}

TYPED_TEST(RenameKeys, KeepsLocalMapsWhole) {
  constexpr int D = TypeParam::value;
  Dice dice(3);
  const Values<D> all = random_values<D>(dice, ids(3), ids(5));
  std::vector<Key> terms{pose_key(2)};
  for (const auto id : ids(5)) terms.push_back(point_key(id));
  MeasurementGraphBuilder<D> builder;
  builder.add(random_local_map<D>(dice, all, 0, terms, 0.1));
  const MeasurementGraph<D> graph = std::move(builder).build();
  ASSERT_EQ(graph.submaps.size(), 1U);
  const auto names = turned_round(graph.variables);
  const MeasurementGraph<D> there = rename_keys(graph, Renaming(names));
  const MeasurementGraph<D> back = rename_keys(there, Renaming(reversed(names)));
  EXPECT_EQ(back.variables, graph.variables);
  EXPECT_EQ(back.submaps.values, graph.submaps.values);
  const JoinResult<D> before = join_all(graph), after = join_all(there);
  EXPECT_NEAR(after.report.chi2, before.report.chi2, 1e-9);
  const Map<D> same = change_frame(after.maps[0], pose_anchor<D>({"pose", 1, 1000}));
  const Vec<D> difference =
      same.values.point({"point", 1, 998}) - before.maps[0].values.point(point_key(2));
  EXPECT_LT(difference.norm(), 1e-9);
}

TEST(Renaming, RefusesWhatIsNoRenaming) {
  EXPECT_THAT(complaint_of<InputError>([] {
                Renaming({{point_key(1), pose_key(1)}});
              }),
              AllOf(HasSubstr("point:1"), HasSubstr("another type")));
  EXPECT_THAT(complaint_of<InputError>([] {
                Renaming({{point_key(1), point_key(2)}, {point_key(1), point_key(3)}});
              }),
              HasSubstr("both to point:2 and to point:3"));
  Dice dice(4);
  const Map<2> map = random_map<2>(dice, ids(2), ids(3), 0);
  EXPECT_THAT(complaint_of<InputError>([&] {
                rename_keys(map, Renaming({{point_key(1), point_key(2)}}));
              }),
              AllOf(HasSubstr("point:1"), HasSubstr("would both become point:2")));
}

}  // namespace
}  // namespace mapjoin
