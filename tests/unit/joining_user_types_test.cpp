// Joining with types of variables and anchors that the library does not know.

#include <gtest/gtest.h>

#include <span>
#include <vector>

#include "mapjoin/joining/join_all.h"
#include "tests/support/random_maps.h"
#include "tests/support/user_types.h"

namespace mapjoin {
namespace {

using namespace test;  // NOLINT

const Mode kModes[] = {Mode::kPaper, Mode::kSummary, Mode::kObserve, Mode::kOptimal};

JoinOptions small_leaves(Mode mode) {
  JoinOptions out;
  out.mode = mode;
  out.leaf_variables = 10;
  out.arity = 4;
  return out;
}

TEST(JoinWhatUsersAdd, MapsInFramesOfFeatures) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    const Values<2> all = random_values<2>(dice, ids(6), ids(8));
    std::vector<Map<2>> maps;
    for (std::uint64_t k = 0; k < 2; ++k)
      maps.push_back(
          map_of<2>(dice, part_of(all, ids(3, 3 * k), ids(6, 2 * k)), two_points(2 + k, 4 + k)));
    Values<2> truth = all;
    truth.transform(truth.pose(pose_key(0)).inverse());
    for (const Mode mode : {Mode::kSummary, Mode::kObserve, Mode::kOptimal}) {
      const JoinResult<2> result =
          join_all<2>(std::span<const Map<2>>(maps), {}, small_leaves(mode));
      ASSERT_EQ(result.maps.size(), 1U);
      ASSERT_EQ(result.maps[0].variables(), truth.variables());
      EXPECT_LT(distance(result.maps[0].values, truth), 1e-8);
    }
  }
}

TEST(JoinWhatUsersAdd, VariablesOfAUsersTypes) {
  Dice dice(9);
  const auto sample = random_graph<2>(dice, {.poses = 40, .points = 5, .noise = 0.0});
  MeasurementGraphBuilder<2> builder;
  builder.add(sample.graph);
  const auto key = [](const char* type, std::uint64_t id) { return Key{Tag(type), 0, id}; };
  std::vector<Wall::Value<double>> walls;
  for (std::uint64_t w = 0; w < 6; ++w) {
    walls.push_back({dice.uniform(-3, 3), dice.uniform(-9, 9)});
    for (std::uint64_t from = w; from < 40; from += 7) {
      const auto z =
          Wall::transform<double>(sample.truth.pose(pose_key(from)).inverse(), walls.back());
      builder.add<Wall>(pose_key(from), key("wall", w), z, dice.definite(2));
    }
  }
  builder.add<BiasType<2>>(pose_key(4), key("bias", 1), Vec<1>(0.25), Mat<1, 1>(4.0));
  const auto graph = std::move(builder).build();
  for (const Mode mode : kModes) {
    const Map<2> map = join_all(graph, small_leaves(mode)).maps.at(0);
    const Rigid2 T = sample.truth.pose(pose_key(0)).inverse();
    for (std::uint64_t w = 0; w < 6; ++w) {
      const auto expected = Wall::transform<double>(T, walls[w]);
      const auto found = map.values.at<Wall>(key("wall", w));
      EXPECT_LT(Wall::local<double>(expected, found).norm(), 1e-8);
    }
    EXPECT_NEAR(map.values.at<BiasType<2>>(key("bias", 1))(0), 0.25, 1e-12);
  }
}

}  // namespace
}  // namespace mapjoin
