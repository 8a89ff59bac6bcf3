// Many simulated runs: maps are as good as they say. Needs no data.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>

#include "mapjoin/evaluation/chi_squared.h"
#include "mapjoin/evaluation/consistency.h"
#include "mapjoin/evaluation/simulate.h"
#include "mapjoin/joining/join_all.h"
#include "mapjoin/solvers/marginalize.h"

namespace mapjoin::test {
namespace {

/// Fifty would do to see a gross error; of fifty, one mean in twenty falls outside by chance.
constexpr std::uint64_t kRuns = 500;
constexpr std::uint64_t kFew = 50;

/// Sums over runs: NEES of independent runs is chi-squared with the sum of the dimensions.
struct Sum {
  double nees = 0.0;
  int dimension = 0;
  int runs = 0;

  void add(const Consistency& c) {
    nees += c.nees;
    dimension += c.dimension;
    ++runs;
  }
  double low() const { return chi_squared_quantile(0.025, dimension) / runs; }
  double high() const { return chi_squared_quantile(0.975, dimension) / runs; }
  /// For scripts/results.py.
  void print(const char* world, const char* what) const {
    std::printf("%s, %s, %d runs: mean NEES %.2f, 95%% between %.2f and %.2f\n", world, what, runs,
                nees / runs, low(), high());
  }
  /// The mean lies in its two-sided 95% interval.
  void expect_consistent(const char* world, const char* what) const {
    print(world, what);
    EXPECT_LE(low(), nees / runs);
    EXPECT_LE(nees / runs, high());
  }
};

/// The truth of the features, and of the pose that fixes the frame.
template <int D>
Values<D> features_alone(const Values<D>& truth) {
  std::vector<int> keep = features_of(truth.variables());
  keep.insert(keep.begin(), truth.variables().require(pose_key(0), "test"));
  std::sort(keep.begin(), keep.end());
  return subset(truth, std::span<const int>(keep));
}

template <int D>
void run_many(World world, const char* name) {
  Sum whole, features;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    SimulationOptions options = simulation_defaults(world);
    options.poses = 200;
    options.seed = seed;
    const Simulation<D> run = simulate<D>(options);
    const JoinResult<D> joined = join_all(run.graph);
    ASSERT_EQ(joined.maps.size(), 1u) << "seed " << seed;
    whole.add(consistency(joined.maps[0], run.truth));
    features.add(consistency(joined.maps[0], features_alone(run.truth)));
    if (seed == kFew) {
      whole.expect_consistent(name, "everything");
      features.print(name, "features");
    }
  }
  whole.expect_consistent(name, "everything");
  features.expect_consistent(name, "features");
}

TEST(ManyRuns, OfLandmarksInThePlaneAreConsistent) {
  run_many<2>(World::kLandmarks2d, "landmarks2d");
}

TEST(ManyRuns, OfLandmarksInSpaceAreConsistent) { run_many<3>(World::kLandmarks3d, "landmarks3d"); }

}  // namespace
}  // namespace mapjoin::test
