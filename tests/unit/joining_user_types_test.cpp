// Joining with types of variables and anchors that the library does not know.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <span>
#include <vector>

#include "mapjoin/joining/join.h"
#include "mapjoin/joining/join_all.h"
#include "tests/support/modes.h"
#include "tests/support/random_maps.h"
#include "tests/support/user_types.h"

namespace mapjoin {
namespace {

using namespace test;  // NOLINT

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

/// Poses of two sessions that see the same features of type T, without noise, and nothing else in
/// common.
template <class T>
struct TwoDrives {
  static constexpr int D = T::ambient;
  std::vector<MeasurementGraph<D>> graphs;
  Values<D> truth;

  TwoDrives(Dice& dice, const std::vector<ValueOf<T>>& features) {
    ValuesBuilder<D> values;
    for (std::size_t f = 0; f < features.size(); ++f)
      values.template add<T>(Key{Tag(T::name), 0, f}, features[f]);
    for (std::uint32_t session = 0; session < 2; ++session) {
      MeasurementGraphBuilder<D> builder;
      std::vector<Rigid<D>> poses;
      for (std::uint64_t k = 0; k < 6; ++k) {
        poses.push_back(random_pose<D>(dice, 5.0));
        values.template add<PoseType<D>>(pose_key(k, session), poses[k]);
        if (k > 0)
          builder.template add<PoseType<D>>(pose_key(k - 1, session), pose_key(k, session),
                                            poses[k - 1].inverse() * poses[k],
                                            dice.definite(kGauge<D>));
        for (std::size_t f = 0; f < features.size(); ++f)
          builder.template add<T>(pose_key(k, session), Key{Tag(T::name), 0, f},
                                  T::template transform<double>(poses[k].inverse(), features[f]),
                                  dice.definite(T::dim));
      }
      graphs.push_back(std::move(builder).build());
    }
    truth = std::move(values).build();
    truth.transform(truth.pose(pose_key(0)).inverse());
  }
  std::vector<Map<D>> maps() const {
    std::vector<Map<D>> out;
    for (const auto& graph : graphs) out.push_back(join_all(graph).maps.at(0));
    return out;
  }
  MeasurementGraph<D> graph() const {
    MeasurementGraphBuilder<D> builder;
    for (const auto& part : graphs) builder.add(part);
    return std::move(builder).build();
  }
};

template <class T>
void expect_joins(const TwoDrives<T>& drives) {
  constexpr int D = T::ambient;
  const std::vector<Map<D>> maps = drives.maps();
  EXPECT_LT(distance(join(maps[0], maps[1]).values, drives.truth), 1e-8);
  for (const Mode mode : {Mode::kSummary, Mode::kObserve, Mode::kOptimal}) {
    const JoinResult<D> of_maps =
        join_all<D>(std::span<const Map<D>>(maps), {}, small_leaves(mode));
    ASSERT_EQ(of_maps.maps.size(), 1U);
    EXPECT_LT(distance(of_maps.maps[0].values, drives.truth), 1e-8);
    const JoinResult<D> of_graph = join_all(drives.graph(), small_leaves(mode));
    ASSERT_EQ(of_graph.maps.size(), 1U);
    EXPECT_LT(distance(of_graph.maps[0].values, drives.truth), 1e-8);
  }
}

TEST(JoinWhatUsersAdd, MapsThatShareOnlyLines) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    expect_joins(TwoDrives<own::Line>(dice, {{0.3, 2.0}, {1.4, -3.0}}));
    expect_joins(TwoDrives<own::Line>(dice, {{0.3, 2.0}, {0.3, 5.0}, {-2.0, 1.0}, {3.0, -8.0}}));
  }
}

TEST(JoinWhatUsersAdd, MapsThatShareOnlyPlanes) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    expect_joins(TwoDrives<own::Plane>(dice, {{Vec<3>(0, 0, 1), 2.0},
                                              {Vec<3>(1, 0.2, 0).normalized(), -3.0},
                                              {Vec<3>(0.1, 1, 0.3).normalized(), 4.0}}));
  }
}

TEST(JoinWhatUsersAdd, RefusesMapsThatShareTooFewLines) {
  Dice dice(4);
  for (const std::vector<own::Line::Value<double>>& lines :
       {std::vector<own::Line::Value<double>>{{0.3, 2.0}}, {{0.3, 2.0}, {0.3, 5.0}}}) {
    const TwoDrives<own::Line> drives(dice, lines);
    const std::vector<Map<2>> maps = drives.maps();
    EXPECT_THROW(join(maps[0], maps[1]), DisconnectedError);
    EXPECT_EQ(join_all(drives.graph()).maps.size(), 2U) << "side by side, nothing invented";
  }
}

TEST(JoinWhatUsersAdd, SaysWhichTypesOfferNothingToLayMapsBy) {
  Dice dice(5);
  const TwoDrives<Wall> drives(dice, {{0.3, 2.0}, {1.4, -3.0}});
  const std::vector<Map<2>> maps = drives.maps();
  const std::string complaint = complaint_of<DisconnectedError>([&] { join(maps[0], maps[1]); });
  EXPECT_THAT(complaint, ::testing::HasSubstr("wall:0 wall:1"));
  EXPECT_THAT(complaint, ::testing::HasSubstr("wall offers no position, rotation, direction"));
}

TEST(JoinWhatUsersAdd, SharedBiasesJoinNothing) {
  Dice dice(6);
  const TwoDrives<BiasType<3>> drives(dice, {Vec<1>(0.1), Vec<1>(0.2), Vec<1>(0.3)});
  const std::vector<Map<3>> maps = drives.maps();
  EXPECT_THROW(join(maps[0], maps[1]), DisconnectedError);
}

}  // namespace
}  // namespace mapjoin
