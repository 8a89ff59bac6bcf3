// The simulation of SLSJF (its section IV-A): beacons in rows and columns, a vehicle that drives at
// random among them, local maps by a filter, joined. Are errors as large as the map says? Needs no
// data.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <vector>

#include "mapjoin/building/simulate_log.h"
#include "mapjoin/building/solve.h"
#include "mapjoin/evaluation/chi_squared.h"
#include "mapjoin/evaluation/consistency.h"
#include "mapjoin/filtering/slsjf.h"
#include "mapjoin/frames/local_map.h"
#include "mapjoin/solvers/covariance.h"
#include "mapjoin/solvers/relative.h"
#include "tests/support/runs.h"

namespace mapjoin::test {
namespace {

/// A normal error is inside two standard deviations with this probability.
constexpr double kExpected = 0.9545;

Map<2> joined_map(const SimulatedLog& simulated, double maps, Builder builder) {
  const Segmentation segments = segment(simulated.log, {SegmentRule::By::kMaps, maps});
  SolvedLog<2> solved = solve_by_local_maps(simulated.log, segments,
                                            {.builder = builder, .keep = Keep::kEndPose}, {});
  EXPECT_EQ(solved.result.maps.size(), 1U);
  return std::move(solved.result.maps.at(0));
}

/// The share of the coordinates of every fourth feature that is within two standard deviations of
/// the truth, as seen from the nearest pose of the map, where a common error
/// of all, such as a turn of the whole, does not count once for each: one run is enough.
double share_inside_nearby(const Map<2>& map, const Values<2>& truth) {
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
    const Vec<2> e =
        seen.as<Point2>() - truth.pose(pose_keys[near]).inverse() * truth.point(keys[f]);
    for (int s = 0; s < 2; ++s, ++all)
      inside += std::abs(e(s)) <= 2.0 * std::sqrt(seen.covariance(s, s)) ? 1 : 0;
  }
  return static_cast<double>(inside) / all;
}

/// What many runs come to. Errors of one run are those of one map: a turn of the whole moves all of
/// them together, so that in one run nearly all are inside and in another hardly any. Only the mean
/// over runs is near the probability.
struct Runs {
  const char* name;
  Builder builder;
  std::vector<double> shares = {};
  double nees = 0.0;
  int dimension = 0;

  void add(const LogSimulationOptions& world, double maps) {
    const SimulatedLog simulated = simulate_log(world);
    const Map<2> map = joined_map(simulated, maps, builder);
    shares.push_back(coverage(map, simulated.truth).share());
    const Consistency c = consistency(map, simulated.truth);
    nees += c.nees;
    dimension += c.dimension;
  }
  double share() const {
    return std::accumulate(shares.begin(), shares.end(), 0.0) / static_cast<double>(shares.size());
  }
  /// Two standard deviations of the mean, were all errors of a run inside or none: shares of that
  /// mean cannot spread more.
  double most_spread() const {
    return 2.0 * std::sqrt(kExpected * (1.0 - kExpected) / static_cast<double>(shares.size()));
  }
  double nees_a_dimension() const { return nees / dimension; }
  double nees_at(double probability) const {
    return chi_squared_quantile(probability, dimension) / dimension;
  }
  /// For scripts/results.py.
  void print() const {
    std::printf(
        "%s, %s, %d runs: mean share inside 2 sigma %.4f, plus or minus %.4f, least %.4f; mean "
        "NEES a dimension %.4f, 95%% between %.4f and %.4f\n",
        name, builder == Builder::kFilter ? "ekf" : "nls", static_cast<int>(shares.size()), share(),
        most_spread(), *std::min_element(shares.begin(), shares.end()), nees_a_dimension(),
        nees_at(0.025), nees_at(0.975));
  }
};

Runs run_many(const char* name, LogSimulationOptions world, double maps, int runs,
              Builder builder) {
  constexpr std::size_t kFew = 10;  // what a smaller experiment would have seen
  constexpr int kMany = 100;
  Runs out{name, builder};
  for (int run = 1; run <= runs; ++run) {
    world.seed = static_cast<std::uint64_t>(run);
    out.add(world, maps);
    if (out.shares.size() == kFew && runs < kMany) out.print();
  }
  out.print();
  EXPECT_NEAR(out.share(), kExpected, out.most_spread());
  return out;
}

/// As the paper has it: 150 m x 150 m, 2500 beacons, 27924 poses, 600 local maps by a filter.
TEST(SlsjfWorld, ErrorsAreAsLargeAsStated) {
  const Runs many = run_many("150 m x 150 m", {}, 600.0, runs(8, 30), Builder::kFilter);
  EXPECT_NEAR(many.nees_a_dimension(), 1.0, 0.02);
}

/// A corner of it, driven often enough for a mean that means something. So many runs show what
/// linearising costs, the filter twice as much: about one percent. With a tenth of the noise,
/// stated as such, nothing of it is left.
TEST(SlsjfWorld, ErrorsInACornerOfItAreAsLargeAsStated) {
  LogSimulationOptions corner;
  corner.poses = 1200;
  corner.beacons_a_side = 10;
  constexpr Builder kBuilders[] = {Builder::kNonlinear, Builder::kFilter};
  for (const Builder builder : kBuilders) {
    const Runs many = run_many("30 m x 30 m", corner, 26.0, runs(50, 250), builder);
    EXPECT_NEAR(many.nees_a_dimension(), 1.0, 0.02);
  }
  CsvLogOptions& sensors = corner.sensors;
  for (double* const sigma :
       {&sensors.sigma_speed, &sensors.sigma_sideways, &sensors.sigma_turn_rate,
        &sensors.sigma_range, &sensors.sigma_bearing})
    *sigma *= 0.1;
  for (const Builder builder : kBuilders) {
    const Runs many =
        run_many("30 m x 30 m, a tenth of the noise", corner, 26.0, runs(50, 250), builder);
    EXPECT_GE(many.nees_a_dimension(), many.nees_at(0.025));
    EXPECT_LE(many.nees_a_dimension(), many.nees_at(0.975));
  }
}

TEST(SlsjfWorld, ErrorsRelativeToTheNearestPoseAreInsideTheirBoundsInEveryRun) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    LogSimulationOptions world;
    world.seed = seed;
    const SimulatedLog simulated = simulate_log(world);
    const double share =
        share_inside_nearby(joined_map(simulated, 600.0, Builder::kFilter), simulated.truth);
    std::printf("the whole world, seed %d: share inside 2 sigma of the nearest pose %.4f\n",
                static_cast<int>(seed), share);
    EXPECT_GT(share, 0.93) << seed;
    EXPECT_LT(share, 0.98) << seed;
  }
}

/// The filter itself, linearised once. Where things are near each other it is right about itself;
/// which way the whole map lies it may believe to know too well (docs/filters.md).
TEST(SlsjfSimulation, TheFiltersErrorsAreInsideTheirBoundsSeenFromNearby) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    LogSimulationOptions world;
    world.seed = seed;
    world.speed = 0.5;
    const SimulatedLog simulated = simulate_log(world);
    const BuiltMaps<2> built =
        build_local_maps(simulated.log, segment(simulated.log, {SegmentRule::By::kMaps, 600}),
                         {.builder = Builder::kFilter, .keep = Keep::kEndPose});
    std::vector<LocalMap<2>> maps;
    for (const Map<2>& map : built.maps) maps.push_back(as_local_map(map));
    const double part =
        share_inside_nearby(slsjf(std::span<const LocalMap<2>>(maps)).map, simulated.truth);
    EXPECT_GT(part, 0.93) << seed;
    EXPECT_LT(part, 0.98) << seed;
    std::printf("SLSJF, world %d: %.4f inside two sigma\n", static_cast<int>(seed), part);
  }
}

}  // namespace
}  // namespace mapjoin::test
