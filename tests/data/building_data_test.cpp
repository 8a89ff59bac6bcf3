// Local maps built from the raw data sets: Fig. 8 of Linear SLAM, one optimum however the recording
// is cut, and consistency from raw controls and observations.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

#include "mapjoin/building/csv_log.h"
#include "mapjoin/building/solve.h"
#include "mapjoin/evaluation/consistency.h"
#include "mapjoin/evaluation/evaluate.h"
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
        const bool features = GetParam().folder == std::string("landmark_graphs");
        for (const double n : {1.0, 5.0, 50.0, 200.0}) {
          const Segmentation segments = segment(log, {By::kMaps, n});
          for (const Builder builder : {Builder::kNonlinear, Builder::kFilter}) {
            for (const LocalFrame frame :
                 {LocalFrame::kStart, LocalFrame::kEnd, LocalFrame::kFeatures}) {
              if (frame == LocalFrame::kFeatures && !features) continue;
              const SolvedLog<D> solved =
                  solve_by_local_maps(log, segments, {.builder = builder, .frame = frame}, {});
              EXPECT_NEAR(solved.result.report.chi2, GetParam().optimum, 1e-6 * GetParam().optimum)
                  << n << " maps, builder " << static_cast<int>(builder) << ", frame "
                  << static_cast<int>(frame);
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

/// A simulated run, and the rms of the noise that is in its files.
struct Run {
  const char* name;
  double speed, turn_rate, range, bearing;  ///< m/s, degrees/s, m, degrees
};

class RawSimulation : public ::testing::TestWithParam<Run> {
 protected:
  static constexpr double kDegree = std::numbers::pi / 180.0;

  /// Nominal but for the turn rate, whose rms data/README.md gives.
  static CsvLogOptions stated() {
    CsvLogOptions options;
    options.sigma_turn_rate = GetParam().turn_rate * kDegree;
    options.nearest = 0.5;  // five sigmas: some ranges in the files are negative
    return options;
  }
  static void expect(const CsvLogOptions& options, double maps, bool two_sided) {
    const std::string folder = std::string("simulation/") + GetParam().name;
    const auto found = data_file(folder);
    const auto truth = true_beacons(GetParam().name);
    if (!found || !truth) GTEST_SKIP() << missing_data(folder);
    const RawLog<2> log = read_csv_log(*found, options).log;
    const SolvedLog<2> solved =
        solve_by_local_maps(log, segment(log, {By::kMaps, maps}), {.keep = Keep::kEndPose}, {});
    ASSERT_EQ(solved.result.maps.size(), 1U);
    EXPECT_EQ(solved.refused, 0U);
    const Consistency c = consistency(solved.result.maps[0], *truth);
    RecordProperty("nees", std::to_string(c.nees));
    EXPECT_LE(c.nees, two_sided ? c.upper : c.one_sided) << maps << " maps";
    EXPECT_GE(c.nees, two_sided ? c.lower : 0.8 * c.dimension) << maps << " maps";
  }
};

TEST_P(RawSimulation, IsConsistentWithTheTrueBeacons) {
  for (const double maps : {50.0, 200.0}) expect(stated(), maps, false);
}

/// Nominal noise is more than there is: ranges and bearings end at two sigmas, and nothing slips.
TEST_P(RawSimulation, WithTheNoiseThatIsInItNeesIsWhereItShouldBe) {
  CsvLogOptions own = stated();
  own.sigma_speed = GetParam().speed;
  own.sigma_sideways = 0.001;
  own.sigma_range = GetParam().range;
  own.sigma_bearing = GetParam().bearing * kDegree;
  expect(own, 50.0, true);
}

INSTANTIATE_TEST_SUITE_P(Data, RawSimulation,
                         ::testing::Values(Run{"simu_8240", 0.0198, 2.9, 0.0955, 0.951},
                                           Run{"simu_35188", 0.0191, 1.9, 0.0959, 0.960}),
                         [](const auto& run) { return std::string(run.param.name); });

}  // namespace
}  // namespace mapjoin::test
