#include "mapjoin/evaluation/simulate.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <set>

#include "mapjoin/evaluation/evaluate.h"
#include "mapjoin/evaluation/random.h"

namespace mapjoin {
namespace {

constexpr World kPlane[] = {World::kManhattan, World::kLandmarks2d};
constexpr World kSpace[] = {World::kSphere, World::kGrid3d, World::kLandmarks3d};

SimulationOptions options(World world, std::int64_t poses, std::uint64_t seed = 1) {
  SimulationOptions out = simulation_defaults(world);
  out.poses = poses;
  out.seed = seed;
  return out;
}

template <class F>
void for_all_worlds(const F& f) {
  for (const World world : kPlane) {
    SCOPED_TRACE(name(world));
    f.template operator()<2>(world);
  }
  for (const World world : kSpace) {
    SCOPED_TRACE(name(world));
    f.template operator()<3>(world);
  }
}

TEST(Random, DrawsWhatItPromises) {
  Random random(7);
  const int n = 200000;
  double sum = 0, squares = 0, fourth = 0, uniform = 0;
  std::vector<int> counts(5, 0);
  for (int k = 0; k < n; ++k) {
    const double x = random.normal();
    sum += x;
    squares += x * x;
    fourth += x * x * x * x;
    uniform += random.uniform();
    ++counts[static_cast<std::size_t>(random.below(5))];
  }
  EXPECT_NEAR(sum / n, 0.0, 0.01);
  EXPECT_NEAR(squares / n, 1.0, 0.02);
  EXPECT_NEAR(fourth / n, 3.0, 0.15);
  EXPECT_NEAR(uniform / n, 0.5, 0.005);
  for (const int count : counts) EXPECT_NEAR(count, n / 5, 700);
}

TEST(Random, IsTheSameEverywhere) {
  // Written down once: a change of these numbers changes every simulated world.
  Random random(1);
  EXPECT_EQ(random.bits(), 12966619160104079557ULL);
  EXPECT_EQ(random.bits(), 9600361134598540522ULL);
  EXPECT_NE(Random(1, 1).bits(), Random(1, 2).bits());
}

TEST(Simulate, NamesItsWorlds) {
  for_all_worlds([]<int D>(World world) {
    EXPECT_EQ(parse_world(name(world)), world);
    EXPECT_EQ(dimension(world), D);
  });
  EXPECT_THROW(parse_world("venus"), InputError);
}

TEST(Simulate, WithoutNoiseTheTruthFitsExactly) {
  for_all_worlds([]<int D>(World world) {
    SimulationOptions o = options(world, 400);
    o.noise = 0.0;
    const Simulation<D> world_and_truth = simulate<D>(o);
    EXPECT_LT(chi2(world_and_truth.truth, world_and_truth.graph), 1e-18);
  });
}

TEST(Simulate, NoiseIsWhatTheInformationSays) {
  for_all_worlds([]<int D>(World world) {
    const Simulation<D> s = simulate<D>(options(world, 3000));
    const auto residuals = static_cast<double>(s.graph.residuals());
    EXPECT_NEAR(chi2(s.truth, s.graph), residuals, 4 * std::sqrt(2 * residuals));
  });
}

TEST(Simulate, IsDeterminedByItsOptions) {
  for_all_worlds([]<int D>(World world) {
    const Simulation<D> a = simulate<D>(options(world, 300));
    const Simulation<D> b = simulate<D>(options(world, 300));
    const Simulation<D> c = simulate<D>(options(world, 300, 2));
    ASSERT_EQ(a.graph.relative.size(), b.graph.relative.size());
    for (std::size_t k = 0; k < a.graph.relative.size(); ++k) {
      EXPECT_EQ(a.graph.relative[k].z, b.graph.relative[k].z);
      EXPECT_EQ(a.graph.relative[k].to, b.graph.relative[k].to);
    }
    EXPECT_NE(a.graph.relative[0].z, c.graph.relative[0].z);
  });
}

TEST(Simulate, NoiseDoesNotMoveTheWorld) {
  SimulationOptions o = options(World::kLandmarks2d, 300);
  const Simulation<2> a = simulate<2>(o);
  o.sigma_translation = 0.5;
  o.noise = 3.0;
  const Simulation<2> b = simulate<2>(o);
  ASSERT_EQ(a.truth.variables(), b.truth.variables());
  EXPECT_EQ(a.truth.local(b.truth).norm(), 0.0);
}

TEST(Simulate, IsOnePiece) {
  for_all_worlds([]<int D>(World world) {
    const Simulation<D> s = simulate<D>(options(world, 500));
    EXPECT_EQ(connected_components(s.graph).size(), 1U);
    EXPECT_EQ(s.graph.variables, s.truth.variables());
    EXPECT_EQ(s.truth.template column<PoseType<D>>().size(), 500U);
    EXPECT_LT((s.truth.pose(pose_key(0)).t.norm()), 1e-12);
  });
}

TEST(Simulate, HasAsManyEdgesAsAsked) {
  for (const World world : {World::kManhattan, World::kSphere, World::kGrid3d}) {
    SCOPED_TRACE(name(world));
    const auto edges = [&](double per_pose) {
      SimulationOptions o = options(world, 5000);
      o.edges_per_pose = per_pose;
      return dimension(world) == 2 ? simulate<2>(o).graph.size() : simulate<3>(o).graph.size();
    };
    EXPECT_EQ(edges(1.0), 4999U);
    EXPECT_NEAR(static_cast<double>(edges(1.5)), 7500, 400);
    EXPECT_NEAR(static_cast<double>(edges(2.0)), 10000, 800);
  }
}

TEST(Simulate, NoPoseHasMoreLoopClosuresThanPromised) {
  SimulationOptions o = options(World::kManhattan, 5000);
  o.world_size = 10;  // everybody is always everywhere
  o.edges_per_pose = 4.0;
  const Simulation<2> s = simulate<2>(o);
  std::vector<int> out(5000, 0);
  std::vector<int> in(5000, 0);
  std::set<std::pair<int, int>> pairs;
  for (std::size_t k = 0; k < s.graph.relative[0].size(); ++k) {
    const int from = s.graph.relative[0].from[k];
    const int to = s.graph.relative[0].to[k];
    EXPECT_TRUE(pairs.emplace(from, to).second) << from << " " << to;
    if (from + 1 == to) continue;
    EXPECT_GT(from, to);
    EXPECT_LE((s.truth.pose(pose_key(static_cast<std::uint64_t>(from))).t -
               s.truth.pose(pose_key(static_cast<std::uint64_t>(to))).t)
                  .norm(),
              1.0 + 1e-12);
    ++out[static_cast<std::size_t>(from)];
    ++in[static_cast<std::size_t>(to)];
  }
  EXPECT_LE(*std::max_element(out.begin(), out.end()), 4);
  EXPECT_LE(*std::max_element(in.begin(), in.end()), 4);
}

TEST(Simulate, SeesTheFeaturesInRange) {
  SimulationOptions o = options(World::kLandmarks2d, 2000);
  o.noise = 0.0;
  o.sensor_range = 4.0;
  o.visible_features = 6.0;
  const Simulation<2> s = simulate<2>(o);
  ASSERT_EQ(s.graph.relative.size(), 2U);
  const auto& seen = s.graph.relative[0];  // points come before poses
  EXPECT_EQ(seen.kind->tag, Tag("point"));
  EXPECT_NEAR(static_cast<double>(seen.size()) / 2000, 6.0, 1.0);
  for (std::size_t k = 0; k < seen.size(); ++k) {
    EXPECT_LE(std::hypot(seen.z[2 * k], seen.z[2 * k + 1]), 4.0 + 1e-12);
  }
  const auto& ids = s.truth.variables().column(0).keys;
  EXPECT_EQ(ids.front().id, 100000U);
  EXPECT_EQ(ids.back().id, 100000U + ids.size() - 1);

  o.max_observations = 3;
  std::vector<int> count(2000, 0);
  const Simulation<2> few = simulate<2>(o);
  for (const int from : few.graph.relative[0].from) {
    ++count[static_cast<std::size_t>(few.graph.variables.key(from).id)];
  }
  EXPECT_EQ(*std::max_element(count.begin(), count.end()), 3);
}

TEST(Simulate, OnePoseIsAWorldToo) {
  for_all_worlds([]<int D>(World world) {
    const Simulation<D> s = simulate<D>(options(world, 1));
    EXPECT_GE(s.truth.size(), 1);
  });
}

TEST(Simulate, RefusesWhatMakesNoSense) {
  const auto refuses = [](auto change) {
    SimulationOptions o = options(World::kManhattan, 10);
    change(o);
    EXPECT_THROW(simulate<2>(o), InputError);
  };
  refuses([](auto& o) { o.poses = 0; });
  refuses([](auto& o) { o.sigma_translation = 0.0; });
  refuses([](auto& o) { o.sigma_rotation = std::nan(""); });
  refuses([](auto& o) { o.edges_per_pose = 0.5; });
  refuses([](auto& o) { o.noise = -1; });
  refuses([](auto& o) { o.world_size = -1; });
  refuses([](auto& o) { o.world = World::kSphere; });
}

}  // namespace
}  // namespace mapjoin
