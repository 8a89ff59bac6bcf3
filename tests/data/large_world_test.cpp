// Worlds far larger than the real ones: joining ends in the same minimum as refinement that was
// told the truth. Needs no data.
#include <gtest/gtest.h>

#include <cstdio>

#include "mapjoin/evaluation/simulate.h"
#include "mapjoin/joining/join_all.h"
#include "mapjoin/joining/refine.h"

namespace mapjoin::test {
namespace {

/// chi2 of the minimum next to the truth.
template <int D>
double refined_from_truth(const Simulation<D>& world) {
  const RefineResult result = refine_from(world.graph, world.truth, 100, 1e-12);
  EXPECT_TRUE(result.minimum);
  return result.chi2;
}

class LargeWorld : public testing::TestWithParam<int> {};

TEST_P(LargeWorld, SolvesToTheOptimumNextToTheTruth) {
  SimulationOptions world_options = simulation_defaults(World::kManhattan);
  world_options.poses = GetParam();
  const Simulation<2> world = simulate<2>(world_options);
  const double from_truth = refined_from_truth(world);

  JoinOptions options;
  options.information = false;
  const JoinResult<2> result = join_all(world.graph, options);
  EXPECT_EQ(result.report.components, 1);
  EXPECT_TRUE(result.report.minimum);
  EXPECT_NEAR(result.report.chi2, from_truth, 1e-6 * from_truth);
  // For scripts/results.py.
  std::printf("manhattan %d: joined %.6f, refined from the truth %.6f\n", GetParam(),
              result.report.chi2, from_truth);
}

// Long drives between few, short sights of features: in some worlds two parts meet turned by more
// than half a turn, and the chain between them winds up (joining/uncoil.h). In which, depends on
// the order of elimination.
TEST(LargeLandmarkWorld, EndsAtTheOptimumWhereChainsWindUp) {
  SimulationOptions options = simulation_defaults(World::kLandmarks2d);
  options.poses = 30000;
  options.sensor_range = 1.5;
  options.max_observations = 88;
  int wound_up = 0;
  for (const int visible_features : {10, 30}) {
    options.visible_features = visible_features;
    for (const std::uint64_t seed : {1U, 2U, 3U}) {
      SCOPED_TRACE(seed);
      options.seed = seed;
      const Simulation<2> world = simulate<2>(options);
      const double from_truth = refined_from_truth(world);
      const JoinResult<2> result = join_all(world.graph);
      ASSERT_EQ(result.maps.size(), 1U);
      EXPECT_TRUE(result.report.minimum);
      EXPECT_NEAR(result.report.chi2, from_truth, 1e-6 * from_truth);
      for (const std::string& note : result.report.notes)
        wound_up += note.find("wound up") != std::string::npos ? 1 : 0;
    }
  }
  EXPECT_GE(wound_up, 1);  // or these worlds no longer show it: take others
}

INSTANTIATE_TEST_SUITE_P(, LargeWorld, testing::Values(20000, 63000, 200000),
                         testing::PrintToStringParamName());

}  // namespace
}  // namespace mapjoin::test
