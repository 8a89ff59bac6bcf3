// Local maps built from the raw data sets: Fig. 8 of Linear SLAM, one optimum however the recording
// is cut, and consistency from raw controls and observations.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

#include "mapjoin/building/csv_log.h"
#include "mapjoin/building/simulate_log.h"
#include "mapjoin/building/solve.h"
#include "mapjoin/evaluation/chi_squared.h"
#include "mapjoin/evaluation/consistency.h"
#include "mapjoin/evaluation/evaluate.h"
#include "mapjoin/solvers/covariance.h"
#include "mapjoin/solvers/relative.h"
#include "tests/support/beacons.h"
#include "tests/support/data.h"
#include "tests/support/data_sets.h"

namespace mapjoin::test {
namespace {

using By = SegmentRule::By;

class BuiltFrom : public ::testing::TestWithParam<DataSet> {};

TEST_P(BuiltFrom, ItsMeasurementsEndsInOneOptimum) {
  const auto any = load(GetParam());
  if (!any) GTEST_SKIP() << missing(GetParam());
  std::visit(
      [&]<int D>(const Problem<D>& problem) {
        const RawLog<D> log = raw_log(problem.graph);
        for (const double n : {50.0, 200.0}) {
          const Segmentation segments = segment(log, {By::kMaps, n});
          for (const Builder builder : {Builder::kNonlinear, Builder::kFilter}) {
            for (const LocalFrame frame : {LocalFrame::kStart, LocalFrame::kEnd}) {
              if (builder == Builder::kFilter && n < 100.0) continue;  // dense: minutes
              const SolvedLog<D> solved =
                  solve_by_local_maps(log, segments, {.builder = builder, .frame = frame}, {});
              EXPECT_NEAR(solved.result.report.chi2, GetParam().optimum, 1e-6 * GetParam().optimum)
                  << n;
            }
          }
        }
      },
      *any);
}

INSTANTIATE_TEST_SUITE_P(Data, BuiltFrom,
                         ::testing::Values(DataSet{"landmark_graphs", "victoria_park", 9012.7196},
                                           DataSet{"landmark_graphs", "dlr", 27688.5556},
                                           DataSet{"pose_graphs", "intel_943", 546.461112},
                                           DataSet{"pose_graphs", "manhattan_3500", 137.912951},
                                           DataSet{"pose_graphs", "sphere_2500", 1153.854381},
                                           DataSet{"pose_graphs", "parking_garage_1661",
                                                   1.2888299}),
                         [](const auto& set) { return set.param.name; });

/// Fig. 8: observing joins stay within 5 mm of the optimum over the same local maps.
TEST(BuiltFromVictoriaPark, ObservingIsNearTheOptimumOverTheSameLocalMaps) {
  const DataSet set{"landmark_graphs", "victoria_park"};
  const auto any = load(set);
  if (!any) GTEST_SKIP() << missing(set);
  const RawLog<2> log = raw_log(std::get<Problem<2>>(*any).graph);
  for (const double n : {5.0, 20.0, 100.0, 6898.0}) {
    const Segmentation segments = segment(log, {By::kMaps, n});
    const BuiltMaps<2> built = build_local_maps(log, segments);
    EXPECT_EQ(built.maps.size(), static_cast<std::size_t>(n));
    EXPECT_EQ(built.used.size(), log.size());
    const JoinResult<2> optimum = join_all(std::span<const Map<2>>(built.maps), {}, {});
    JoinOptions options;
    options.mode = Mode::kObserve;
    options.tree = TreeShape::kOrder;
    const JoinResult<2> observed = solve_by_local_maps(log, segments, {}, options).result;
    EXPECT_EQ(observed.report.refine_solves, 0);
    const Deviation apart = deviation(observed.maps[0].values, optimum.maps[0].values);
    EXPECT_LT(apart.pose_rmse, 0.005) << n;
    EXPECT_LT(apart.feature_rmse, 0.005) << n;
  }
}

class RawSimulation : public ::testing::TestWithParam<std::pair<const char*, double>> {};

/// The turn rates in the files are noisier than nominal, as data/README.md says: their rms is used.
TEST_P(RawSimulation, IsConsistentWithTheTrueBeacons) {
  const auto [name, degrees] = GetParam();
  const auto folder = data_file(std::string("simulation/") + name);
  const auto truth = true_beacons(name);
  if (!folder || !truth) GTEST_SKIP() << missing_data(std::string("simulation/") + name);
  CsvLogOptions options;
  options.sigma_turn_rate = degrees * std::numbers::pi / 180.0;
  options.nearest = 0.5;  // five sigmas: some ranges in the files are negative
  const RawLog<2> log = read_csv_log(*folder, options).log;
  const SolvedLog<2> solved =
      solve_by_local_maps(log, segment(log, {By::kPoses, 50}), {.keep = Keep::kEndPose}, {});
  ASSERT_EQ(solved.result.maps.size(), 1U);
  EXPECT_EQ(solved.refused, 0U);
  const Consistency c = consistency(solved.result.maps[0], *truth);
  RecordProperty("nees", std::to_string(c.nees));
  RecordProperty("dimension", c.dimension);
  EXPECT_LE(c.nees, c.one_sided) << "dimension " << c.dimension;
  EXPECT_GE(c.nees, 0.8 * c.dimension);
}

INSTANTIATE_TEST_SUITE_P(Data, RawSimulation,
                         ::testing::Values(std::pair("simu_8240", 2.9),
                                           std::pair("simu_35188", 1.9)),
                         [](const auto& set) { return std::string(set.param.first); });

/// SLSJF section IV-A: 2500 beacons, 27924 poses, 600 local maps by a filter, joined.
TEST(SlsjfSimulation, ErrorsAreInsideTheirBounds) {
  double nees = 0.0;
  int dimension = 0;
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    LogSimulationOptions world;
    world.seed = seed;
    const SimulatedLog simulated = simulate_log(world);
    const Segmentation segments = segment(simulated.log, {By::kMaps, 600});
    ASSERT_EQ(segments.maps.size(), 600U);
    const SolvedLog<2> solved = solve_by_local_maps(
        simulated.log, segments, {.builder = Builder::kFilter, .keep = Keep::kEndPose}, {});
    ASSERT_EQ(solved.result.maps.size(), 1U);
    const Map<2>& map = solved.result.maps[0];
    const Consistency c = consistency(map, simulated.truth);
    nees += c.nees;
    dimension += c.dimension;

    // Of features as seen from the nearest pose of the map, so that a common error of all, such as
    // a turn of the whole map, does not count once for each.
    const Covariance<2> covariance(map);
    const auto poses = map.values.column<Pose2>();
    const auto& pose_keys = map.variables().column(map.variables().find_column(Tag("pose"))).keys;
    const auto& keys = map.variables().column(map.variables().find_column(Tag("point"))).keys;
    int inside = 0;
    int all = 0;
    for (std::size_t f = 0; f < keys.size(); f += 4) {
      const Vec<2>& p = map.values.point(keys[f]);
      std::size_t near = 0;
      for (std::size_t k = 0; k < poses.size(); ++k)
        near = (poses[k].t - p).norm() < (poses[near].t - p).norm() ? k : near;
      const mapjoin::Relative seen = relative(map, covariance, pose_keys[near], keys[f]);
      const Vec<2> truth =
          simulated.truth.pose(pose_keys[near]).inverse() * simulated.truth.point(keys[f]);
      const Vec<2> e = seen.as<Point2>() - truth;
      for (int s = 0; s < 2; ++s, ++all)
        inside += std::abs(e(s)) <= 2.0 * std::sqrt(seen.covariance(s, s)) ? 1 : 0;
    }
    const double part = static_cast<double>(inside) / all;
    EXPECT_GT(part, 0.93) << seed;
    EXPECT_LT(part, 0.98) << seed;
    RecordProperty("inside_" + std::to_string(seed), std::to_string(part));
    RecordProperty("nees_" + std::to_string(seed), std::to_string(c.nees / c.dimension));
  }
  EXPECT_GT(nees, chi_squared_quantile(0.025, dimension)) << nees / dimension;
  EXPECT_LT(nees, chi_squared_quantile(0.975, dimension)) << nees / dimension;
}

}  // namespace
}  // namespace mapjoin::test
