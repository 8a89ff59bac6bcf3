// Joining by features alone on the data sets: Table 5 and Fig. 13 of Linear SLAM, consistency, and
// a world of space whose truth is known.
#include <gtest/gtest.h>

#include <fstream>

#include "mapjoin/evaluation/consistency.h"
#include "mapjoin/evaluation/evaluate.h"
#include "mapjoin/evaluation/simulate.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/frames/local_map.h"
#include "mapjoin/frames/parse_anchor.h"
#include "mapjoin/joining/features_only.h"
#include "mapjoin/solvers/marginalize.h"
#include "tests/support/beacons.h"
#include "tests/support/data_sets.h"
#include "tests/support/modes.h"

namespace mapjoin::test {
namespace {

template <int D>
JoinResult<D> join_features(const FeatureOnlyMaps<D>& features, Mode mode,
                            Strategy strategy = Strategy::kDivideAndConquer) {
  JoinOptions options;
  options.mode = mode;
  options.strategy = strategy;
  return join_all(std::span<const Map<D>>(features.maps), {}, options);
}

/// A row of Table 5: RMSE of features to the optimum over the same maps (I-DMJ), as printed; and
/// the frame of Fig. 13.
struct FrameRow {
  std::string maps;
  std::string frame;
  double rmse;

  friend std::ostream& operator<<(std::ostream& out, const FrameRow& row) {
    return out << row.maps;
  }
};

class Table5 : public testing::TestWithParam<FrameRow> {};

TEST_P(Table5, IsReachedByDivideAndConquerAndTheOptimumByBothStrategies) {
  const FrameRow& row = GetParam();
  const DataSet set{"local_maps", row.maps};
  const auto problem = load(set);
  if (!problem) GTEST_SKIP() << missing(set);
  const auto features =
      features_only(std::span<const LocalMap<2>>(std::get<Problem<2>>(*problem).local_maps));
  const Anchor<2> frame = parse_anchor<2>(row.frame);
  const JoinResult<2> optimum = join_features(features, Mode::kOptimal);
  ASSERT_EQ(optimum.maps.size(), 1U);
  EXPECT_TRUE(optimum.report.minimum);
  EXPECT_EQ(optimum.report.poses, 0);
  const Values<2> best = change_frame(optimum.maps[0], frame).values;
  const JoinResult<2> sequential = join_features(features, Mode::kOptimal, Strategy::kSequential);
  EXPECT_NEAR(sequential.report.chi2, optimum.report.chi2, 1e-6 * optimum.report.chi2);
  EXPECT_LT(deviation(sequential.maps.at(0).values, best).aligned_feature_rmse, 1e-4);
  for (const Mode mode : {Mode::kPaper, Mode::kSummary}) {
    const JoinResult<2> result = join_features(features, mode);
    ASSERT_EQ(result.maps.size(), 1U);
    EXPECT_EQ(result.report.solves_per_join, 1);
    EXPECT_EQ(result.report.root_solves, 1);
    EXPECT_GT(result.report.chi2, optimum.report.chi2);
    const Map<2> map = change_frame(result.maps[0], frame);
    EXPECT_EQ(map.values.point(frame.keys[0]), Vec<2>(0, 0));
    EXPECT_LE(deviation(map.values, best).aligned_feature_rmse, row.rmse);
  }
}

INSTANTIATE_TEST_SUITE_P(, Table5,
                         testing::Values(FrameRow{"victoria_park_200", "points:84,85", 0.193141},
                                         FrameRow{"dlr_200", "points:367,369", 0.393460}));

TEST(FeaturesOnly, Simulation870EndsNearTheOptimumOfTheMapsWithPoses) {
  const DataSet set{"local_maps", "simu3d_870"};
  const auto problem = load(set);
  if (!problem) GTEST_SKIP() << missing(set);
  const Problem<3>& given = std::get<Problem<3>>(*problem);
  const auto features = features_only(std::span<const LocalMap<3>>(given.local_maps));
  const Values<3> whole = given.join({}).maps.at(0).values;
  const Anchor<3> frame = parse_anchor<3>("points:1758,1757,1359");
  for (const Mode mode : {Mode::kPaper, Mode::kSummary, Mode::kOptimal}) {
    const JoinResult<3> result = join_features(features, mode);
    ASSERT_EQ(result.maps.size(), 1U);
    const Map<3> map = change_frame(result.maps[0], frame);
    EXPECT_EQ(map.values.point(frame.keys[1]).tail<2>(), Vec<2>(0, 0));
    EXPECT_LE(deviation(map.values, whole).aligned_feature_rmse, 0.002);
  }
}

struct SimulatedWorld {
  std::string maps, world;
  int dimension;  ///< of Table 3, less the 3 of the frame

  friend std::ostream& operator<<(std::ostream& out, const SimulatedWorld& w) {
    return out << w.maps;
  }
};

class NeesOfFeatures : public testing::TestWithParam<SimulatedWorld> {};

TEST_P(NeesOfFeatures, IsConsistentInEveryMode) {
  const SimulatedWorld& world = GetParam();
  const DataSet set{"local_maps", world.maps};
  const auto problem = load(set);
  const auto truth = true_beacons(world.world);
  if (!problem || !truth) GTEST_SKIP() << missing(set);
  const auto features =
      features_only(std::span<const LocalMap<2>>(std::get<Problem<2>>(*problem).local_maps));
  for (const Mode mode : kModes) {
    const Consistency c = consistency(join_features(features, mode).maps.at(0), *truth);
    EXPECT_EQ(c.dimension, world.dimension);
    EXPECT_LE(c.nees, c.one_sided);
    EXPECT_GE(c.nees, 0.9 * c.dimension);
  }
}

INSTANTIATE_TEST_SUITE_P(Table3, NeesOfFeatures,
                         testing::Values(SimulatedWorld{"simu_8240_50", "simu_8240", 1224 - 3},
                                         SimulatedWorld{"simu_35188_700", "simu_35188", 8404 - 3}));

/// Local maps of a world: what is measured from `steps` poses on end, in the frame of the first.
template <int D>
std::vector<LocalMap<D>> cut(const MeasurementGraph<D>& graph, std::uint64_t steps) {
  std::vector<std::vector<std::int64_t>> parts;
  std::int64_t number = 0;
  for (const auto& column : graph.relative) {
    for (const std::int32_t from : column.from) {
      const std::size_t part = graph.variables.key(from).id / steps;
      if (part >= parts.size()) parts.resize(part + 1);
      parts[part].push_back(number++);
    }
  }
  std::vector<LocalMap<D>> out;
  for (const auto& part : parts)
    out.push_back(as_local_map(
        join_all(subgraph(graph, std::span<const std::int64_t>(part)), {}).maps.at(0)));
  return out;
}

TEST(FeaturesOnly, OfASimulatedWorldOf870MapsAreNearlyAsGoodAsWithPoses) {
  SimulationOptions options = simulation_defaults(mapjoin::World::kLandmarks3d);
  options.poses = 870 * 3;
  options.visible_features = 10.0;
  const Simulation<3> world = simulate<3>(options);
  const std::vector<LocalMap<3>> maps = cut(world.graph, 3);
  ASSERT_EQ(maps.size(), 870U);
  const JoinResult<3> whole = join_all(std::span<const LocalMap<3>>(maps));
  ASSERT_EQ(whole.maps.size(), 1U);
  const double with_poses = deviation(whole.maps[0].values, world.truth).aligned_feature_rmse;
  const auto features = features_only(std::span<const LocalMap<3>>(maps));
  EXPECT_GT(features.maps.size(), 400U);
  const JoinResult<3> result = join_features(features, Mode::kOptimal);
  ASSERT_EQ(result.maps.size(), 1U);
  const double without = deviation(result.maps[0].values, world.truth).aligned_feature_rmse;
  EXPECT_LE(without, 1.2 * with_poses) << with_poses;
  const Consistency c = consistency(result.maps[0], world.truth, 0.999);
  EXPECT_EQ(c.dimension, result.maps[0].variables().scalars() - 6);
  EXPECT_TRUE(c.consistent()) << c.lower << " " << c.nees << " " << c.upper;
  RecordProperty("rmse_with_poses", std::to_string(with_poses));
  RecordProperty("rmse_of_features_only", std::to_string(without));
  RecordProperty("nees", std::to_string(c.nees));
}

}  // namespace
}  // namespace mapjoin::test
