// The simulation of D-SLAM map joining (its section VII, Fig. 4): a square of 40 m with 196
// beacons, five local maps; what EKF SLAM over the whole run, D-SLAM (a local map an instant) and
// D-SLAM map joining know of a feature over time.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <vector>

#include "mapjoin/building/build.h"
#include "mapjoin/building/csv_log.h"
#include "mapjoin/building/ekf_slam.h"
#include "mapjoin/building/simulate_log.h"
#include "mapjoin/evaluation/chi_squared.h"
#include "mapjoin/evaluation/consistency.h"
#include "mapjoin/filtering/dslam.h"
#include "mapjoin/frames/local_map.h"
#include "mapjoin/io/local_maps.h"
#include "mapjoin/solvers/covariance.h"
#include "tests/support/beacons.h"
#include "tests/support/data.h"

namespace mapjoin::test {
namespace {

constexpr int kLocalMaps = 5;

SimulatedLog square(std::uint64_t seed) {
  LogSimulationOptions world;
  world.beacons_a_side = 14;
  world.spacing = 40.0 / 14.0;
  world.sensor_range = 5.0;
  world.poses = 1500;
  world.seed = seed;
  return simulate_log(world);
}

/// As both papers build them: by EKF SLAM, keeping the features and the end pose.
std::vector<LocalMap<2>> local_maps(const RawLog<2>& log, const SegmentRule& rule) {
  std::vector<LocalMap<2>> out;
  const auto built = build_local_maps(log, segment(log, rule),
                                      {.builder = Builder::kFilter, .keep = Keep::kEndPose});
  for (const Map<2>& map : built.maps) out.push_back(as_local_map(map));
  return out;
}

/// The three points that the most local maps have seen.
std::vector<Key> often_seen(const std::vector<LocalMap<2>>& maps) {
  std::map<Key, int> count;
  for (const LocalMap<2>& map : maps) {
    for (const Key& key : map.keys) count[key] -= key.type == Tag("point") ? 1 : 0;
  }
  std::vector<Key> keys;
  for (const auto& [key, n] : count) keys.push_back(key);
  std::stable_sort(keys.begin(), keys.end(),
                   [&](const Key& a, const Key& b) { return count[a] < count[b]; });
  keys.resize(3);
  return keys;
}

/// One sigma of a position, whichever way its coordinates point.
double bound(const Eigen::MatrixXd& P) { return std::sqrt(0.5 * P.trace()); }

/// The bound of a point after every local map that has it.
template <class Filter>
std::vector<double> bounds(Filter& filter, const std::vector<LocalMap<2>>& maps, const Key& key) {
  std::vector<double> out;
  const DslamInput<2> input = dslam_input(std::span<const LocalMap<2>>(maps));
  const auto look = [&] {
    if (filter.values().contains(key)) out.push_back(bound(filter.covariance(std::span(&key, 1))));
  };
  filter.fuse(input.first);
  look();
  for (const Map<2>& map : input.further) {
    filter.fuse(map);
    look();
  }
  return out;
}

/// Fig. 4: all bounds shrink; map joining's ends close to EKF SLAM's, D-SLAM's above both.
TEST(DslamSimulation, JoiningIsNearlyAsCertainAsEkfSlamAndDslamIsLess) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const SimulatedLog world = square(seed);
    const auto maps = local_maps(world.log, {SegmentRule::By::kMaps, kLocalMaps});
    const auto instants = local_maps(world.log, {SegmentRule::By::kPoses, 1});
    ASSERT_EQ(maps.size(), static_cast<std::size_t>(kLocalMaps));
    for (const Key& key : often_seen(maps)) {
      EkfSlam<2> slam(world.log);
      std::vector<double> by_slam;
      while (slam.step()) {
        if (slam.knows(key)) by_slam.push_back(bound(slam.covariance(key)));
      }
      DslamJoin<2> joining, dslam;
      const std::vector<double> joined = bounds(joining, maps, key);
      const std::vector<double> each = bounds(dslam, instants, key);
      for (const auto& curve : {by_slam, joined, each}) {
        for (std::size_t k = 1; k < curve.size(); ++k)
          EXPECT_LE(curve[k], curve[k - 1] * (1.0 + 1e-3)) << to_string(key) << " " << k;
      }
      EXPECT_LT(joined.back(), 1.2 * by_slam.back()) << seed << " " << to_string(key);
      EXPECT_GT(joined.back(), 0.95 * by_slam.back()) << "it has less information";
      EXPECT_GT(each.back(), joined.back()) << seed << " " << to_string(key);
      RecordProperty("seed_" + std::to_string(seed) + "_" + to_string(key),
                     std::to_string(by_slam.back()) + " " + std::to_string(joined.back()) + " " +
                         std::to_string(each.back()));
    }
  }
}

/// Errors inside their bounds, by NEES: of one map errors hang together too much to be counted.
TEST(DslamSimulation, ErrorsAreInsideTheirBounds) {
  double nees[3] = {};
  int dimension = 0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const SimulatedLog world = square(seed);
    const auto maps = local_maps(world.log, {SegmentRule::By::kMaps, kLocalMaps});
    const auto instants = local_maps(world.log, {SegmentRule::By::kPoses, 1});
    Values<2> beacons = world.truth;
    const Map<2> found[] = {ekf_slam(world.log).map, dslam(std::span<const LocalMap<2>>(maps)).map,
                            dslam(std::span<const LocalMap<2>>(instants)).map};
    ValuesBuilder<2> truth;  // what all three know: the first pose, and features
    truth.add<Pose2>(pose_key(0), Rigid2::identity());
    const VariableSet<2>& common = found[1].variables();
    for (const Key& key : common.column(common.find_column(Tag("point"))).keys) {
      if (found[0].values.contains(key) && found[2].values.contains(key))
        truth.add<Point2>(key, beacons.point(key));
    }
    const Values<2> known = std::move(truth).build();
    for (std::size_t k = 0; k < 3; ++k) nees[k] += consistency(found[k], known).nees;
    dimension += consistency(found[0], known).dimension;
  }
  for (const double x : nees) {
    EXPECT_GT(x, chi_squared_quantile(0.001, dimension)) << x / dimension;
    EXPECT_LT(x, chi_squared_quantile(0.999, dimension)) << x / dimension;
  }
}

/// The same on the published world: local maps of others by joining, the raw data by EKF SLAM.
TEST(DslamSimulation, TheFivePublishedLocalMapsAgreeWithEkfSlamOverTheirRecording) {
  const auto folder = data_file("mat/simu_535_5");
  const auto raw = data_file("simulation/simu_535");
  const auto truth = true_beacons("simu_535");
  if (!folder || !raw || !truth) GTEST_SKIP() << missing_data("simulation/simu_535");
  std::vector<LocalMap<2>> maps;
  try {
    maps = std::get<LocalMapSet<2>>(read_local_maps(*folder)).maps;
  } catch (const InputError& error) {
    GTEST_SKIP() << error.what();  // a build without matio
  }
  CsvLogOptions options;
  options.sigma_turn_rate = 4.1 * std::numbers::pi / 180.0;  // rms in the file, data/README.md
  options.nearest = 0.5;
  const CsvLog recorded = read_csv_log(*raw, options);
  EkfSlam<2> slam(recorded.log);
  while (slam.step()) {
  }
  const FilterResult<2> joined = dslam(std::span<const LocalMap<2>>(maps));
  const Covariance<2> covariance(joined.map);
  const VariableSet<2>& features = joined.map.variables();
  int compared = 0, inside = 0;
  for (const Key& key : features.column(features.find_column(Tag("point"))).keys) {
    if (!slam.knows(key)) continue;
    ++compared;
    const Eigen::MatrixXd P = covariance.block(key, key);
    const double ratio = bound(P) / bound(slam.covariance(key));
    EXPECT_GT(ratio, 0.9) << to_string(key);
    EXPECT_LT(ratio, 1.5) << to_string(key);  // what noise the maps were built for is not known
    const Vec<2> e = joined.map.values.point(key) - truth->point(key);
    inside += e.dot(P.ldlt().solve(e)) < chi_squared_quantile(0.997, 2) ? 1 : 0;
  }
  EXPECT_GT(compared, 20);
  EXPECT_GE(inside, compared * 8 / 10) << "of " << compared;
}

}  // namespace
}  // namespace mapjoin::test
