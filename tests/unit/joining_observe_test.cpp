// Joining whole graphs with their observations: the result is the least squares optimum, whatever
// the tree, the threads and the names.

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "mapjoin/evaluation/evaluate.h"
#include "mapjoin/evaluation/simulate.h"
#include "mapjoin/graph/symmetric.h"
#include "mapjoin/joining/join_all.h"
#include "tests/support/ceres_reference.h"
#include "tests/support/modes.h"
#include "tests/support/random_maps.h"

namespace mapjoin {
namespace {

using namespace test;  // NOLINT

template <class T>
class JoinGraph : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(JoinGraph, Dimensions);

JoinOptions small_joins(Mode mode = Mode::kOptimal) {
  JoinOptions out = small_leaves(mode);
  out.refine_tolerance = 2e-8;  // what the bounds here go by
  return out;
}

/// The optimum next to the truth, in the frame of the lowest pose.
template <int D>
Values<D> optimum(const MeasurementGraph<D>& graph, Values<D> truth) {
  const Key lowest =
      graph.variables.key(graph.variables.column(graph.variables.find_column(Tag("pose"))).first);
  truth.transform(truth.pose(lowest).inverse());
  return CeresReference<D>(graph).minimise(truth, lowest);
}

template <int D>
void expect_optimum(const MeasurementGraph<D>& graph, const Values<D>& best,
                    const JoinResult<D>& result) {
  ASSERT_EQ(result.maps.size(), 1U);
  const double chi2_best = CeresReference<D>(graph).chi2(best);
  EXPECT_NEAR(result.report.chi2, chi2_best, 1e-7 * (1e-3 + chi2_best));
  EXPECT_NEAR(CeresReference<D>(graph).chi2(result.maps[0].values), result.report.chi2,
              1e-8 * (1e-3 + chi2_best));
  EXPECT_NEAR(chi2(result.maps[0].values, graph), result.report.chi2, 1e-8 * (1e-3 + chi2_best));
  // 2e-8 of a chi2 of some hundreds, where the refinement may stop, are some thousandths of a
  // standard deviation; and those are up to 0.3 here.
  EXPECT_LT(distance(result.maps[0].values, best), 2e-3);
  EXPECT_TRUE(result.report.minimum);
}

TYPED_TEST(JoinGraph, FindsTheOptimumByEveryTreeAndStrategy) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    const auto sample = random_graph<D>(
        dice, {.poses = 60, .points = 40, .closures = 30, .noise = 0.05, .shuffle = seed > 1});
    const Values<D> best = optimum(sample.graph, sample.truth);
    for (const TreeShape tree : {TreeShape::kGraph, TreeShape::kOrder}) {
      for (const Strategy strategy : {Strategy::kDivideAndConquer, Strategy::kSequential}) {
        JoinOptions options = small_joins();
        options.tree = tree;
        options.strategy = strategy;
        expect_optimum(sample.graph, best, join_all(sample.graph, options));
      }
    }
    JoinOptions wide;
    wide.refine_tolerance = small_joins().refine_tolerance;
    expect_optimum(sample.graph, best, join_all(sample.graph, wide));
    const double least = CeresReference<D>(sample.graph).chi2(best);
    EXPECT_NEAR(join_all(sample.graph).report.chi2, least, 1e-6 * least);  // as it comes
  }
}

template <int D>
void check_world(World world, std::int64_t poses) {
  SimulationOptions simulation = simulation_defaults(world);
  simulation.poses = poses;
  const Simulation<D> sample = simulate<D>(simulation);
  const JoinResult<D> result = join_all(sample.graph, small_joins());
  expect_optimum(sample.graph, optimum(sample.graph, sample.truth), result);
  // chi2 of an optimum is about the number of residuals less unknowns.
  const double freedom =
      static_cast<double>(sample.graph.residuals()) - sample.graph.variables.scalars() + kGauge<D>;
  EXPECT_NEAR(result.report.chi2, freedom, 6.0 * std::sqrt(2.0 * freedom));
}

TEST(JoinSimulatedWorlds, FindsTheOptimum) {
  check_world<2>(World::kManhattan, 400);
  check_world<2>(World::kLandmarks2d, 150);
  check_world<3>(World::kSphere, 250);
  check_world<3>(World::kGrid3d, 250);
  check_world<3>(World::kLandmarks3d, 100);
}

TYPED_TEST(JoinGraph, FindsTheTruthInExactMeasurementsWithoutRefining) {
  constexpr int D = TypeParam::value;
  Dice dice(4);
  const auto sample =
      random_graph<D>(dice, {.poses = 80, .points = 40, .noise = 0.0, .shuffle = true});
  Values<D> truth = sample.truth;
  truth.transform(truth.pose(pose_key(0)).inverse());
  for (const Mode mode : {Mode::kObserve, Mode::kSummary, Mode::kPaper, Mode::kOptimal}) {
    const JoinResult<D> result = join_all(sample.graph, small_joins(mode));
    ASSERT_EQ(result.maps.size(), 1U);
    EXPECT_LT(distance(result.maps[0].values, truth), 1e-9);
    EXPECT_LT(result.report.chi2, 1e-12);
    EXPECT_TRUE(result.report.minimum);
    EXPECT_EQ(result.maps[0].anchor, pose_anchor<D>(pose_key(0)));
  }
}

template <int D>
void expect_same_bits(const JoinResult<D>& a, const JoinResult<D>& b) {
  ASSERT_EQ(a.maps.size(), b.maps.size());
  EXPECT_EQ(a.report.chi2, b.report.chi2);
  EXPECT_EQ(a.report.chi2_linear, b.report.chi2_linear);
  for (std::size_t m = 0; m < a.maps.size(); ++m) {
    ASSERT_EQ(a.maps[m].variables(), b.maps[m].variables());
    EXPECT_EQ(a.maps[m].information, b.maps[m].information);
    for (int i = 0; i < a.maps[m].values.size(); ++i) {
      const int size = a.maps[m].variables().kind(i).value_size;
      for (int s = 0; s < size; ++s)
        ASSERT_EQ(a.maps[m].values.value(i)[s], b.maps[m].values.value(i)[s]);
    }
  }
}

TYPED_TEST(JoinGraph, GivesTheSameBitsOnAnyNumberOfThreads) {
  constexpr int D = TypeParam::value;
  Dice dice(5);
  const auto sample =
      random_graph<D>(dice, {.poses = 300, .points = 150, .closures = 80, .noise = 0.03});
  for (const Mode mode : {Mode::kOptimal, Mode::kObserve, Mode::kSummary, Mode::kPaper}) {
    JoinOptions options = small_joins(mode);
    const JoinResult<D> one = join_all(sample.graph, options);
    for (const int threads : {2, 3}) {
      options.threads = threads;
      expect_same_bits(one, join_all(sample.graph, options));
    }
    options.workers = std::make_shared<WorkerPool>(2);
    for (int call = 0; call < 3; ++call) expect_same_bits(one, join_all(sample.graph, options));
  }
}

/// The same measurements in another order, with other ids.
template <int D>
MeasurementGraph<D> renamed(Dice& dice, const MeasurementGraph<D>& graph,
                            std::map<Key, Key>& names) {
  std::vector<Key> keys;
  for (int i = 0; i < graph.variables.size(); ++i) keys.push_back(graph.variables.key(i));
  std::vector<std::uint64_t> fresh = ids(static_cast<int>(keys.size()));
  std::shuffle(fresh.begin(), fresh.end(), dice.generator());
  for (std::size_t k = 0; k < keys.size(); ++k) {
    names[keys[k]] = keys[k];
    names[keys[k]].id = fresh[k] * 1000003;  // sparse ids, too
  }
  MeasurementGraphBuilder<D> builder;
  for (auto c = graph.relative.rbegin(); c != graph.relative.rend(); ++c) {
    std::vector<std::size_t> order(c->size());
    std::iota(order.begin(), order.end(), 0U);
    std::shuffle(order.begin(), order.end(), dice.generator());
    for (const std::size_t k : order) {
      builder.add(*c->kind, names[graph.variables.key(c->from[k])],
                  names[graph.variables.key(c->to[k])],
                  c->z.data() + k * static_cast<std::size_t>(c->kind->value_size),
                  c->info.data() + k * static_cast<std::size_t>(c->kind->dim * c->kind->dim));
    }
  }
  return std::move(builder).build();
}

TYPED_TEST(JoinGraph, DoesNotDependOnNamesOrOrder) {
  constexpr int D = TypeParam::value;
  Dice dice(6);
  const auto sample =
      random_graph<D>(dice, {.poses = 120, .points = 50, .closures = 40, .noise = 0.05});
  JoinOptions options = small_joins();
  options.refine_tolerance = 1e-13;
  const JoinResult<D> plain = join_all(sample.graph, options);
  constexpr double kLeft = 1e-6;  // m, of what both refinements leave
  for (int round = 0; round < 3; ++round) {
    std::map<Key, Key> names;
    const auto graph = renamed(dice, sample.graph, names);
    const JoinResult<D> other = join_all(graph, options);
    EXPECT_NEAR(other.report.chi2, plain.report.chi2, 1e-12 * plain.report.chi2);
    ASSERT_EQ(other.maps.size(), 1U);
    Values<D> x = other.maps[0].values;
    x.transform(x.pose(names[pose_key(0)]).inverse());
    for (const auto& [key, name] : names) {
      if (key.type != Tag("pose")) continue;
      EXPECT_LT(distance(x.pose(name).t, plain.maps[0].values.pose(key).t), kLeft);
    }
  }
}

TYPED_TEST(JoinGraph, GivesTheInformationAtItsValues) {
  constexpr int D = TypeParam::value;
  Dice dice(7);
  const auto sample = random_graph<D>(dice, {.poses = 30, .points = 15, .noise = 0.05});
  for (const Mode mode : {Mode::kObserve, Mode::kOptimal}) {
    const Map<D> map = join_all(sample.graph, small_joins(mode)).maps.at(0);
    const auto expected = CeresReference<D>(sample.graph).normal_equations(map.values);
    EXPECT_LT(relative_distance(map.information.dense(), expected.H), 1e-8);
    ASSERT_NE(map.observations, nullptr);
    EXPECT_EQ(map.observations->size(), sample.graph.size());
  }
}

TYPED_TEST(JoinGraph, JoinsLocalMapsThatCoupleTheirVariables) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    const auto world = random_graph<D>(dice, {.poses = 46, .points = 30, .noise = 0.0});
    std::vector<LocalMap<D>> maps;
    CeresReference<D> reference;
    for (std::uint64_t k = 0; k + 5 < 46; k += 3) {
      std::vector<Key> terms;
      for (std::uint64_t t = k + 1; t <= k + 5; ++t) terms.push_back(pose_key(t));
      for (int p = 0; p < 4; ++p)
        terms.push_back(point_key(static_cast<std::uint64_t>(dice.below(30))));  // maybe twice
      maps.push_back(random_local_map<D>(dice, world.truth, k, terms, 0.05));
      reference.add(maps.back());
    }
    MeasurementGraphBuilder<D> builder;
    for (const LocalMap<D>& map : maps) builder.add(map);
    const MeasurementGraph<D> graph = std::move(builder).build();
    std::vector<int> numbers = numbers_in(graph.variables, world.truth.variables());
    const Values<D> best = optimum(graph, subset(world.truth, numbers));
    for (const TreeShape tree : {TreeShape::kGraph, TreeShape::kOrder}) {
      JoinOptions options = small_joins();
      options.tree = tree;
      const auto result = join_all<D>(std::span<const LocalMap<D>>(maps), options);
      expect_optimum(graph, best, result);
      EXPECT_NEAR(reference.chi2(result.maps.at(0).values), result.report.chi2,
                  1e-8 * result.report.chi2);
    }
  }
}

TYPED_TEST(JoinGraph, CarriesSummariesAlongInTheOtherModes) {
  constexpr int D = TypeParam::value;
  Dice dice(9);
  const auto sample = random_graph<D>(dice, {.poses = 60, .points = 30, .noise = 0.01});
  const Values<D> best = optimum(sample.graph, sample.truth);
  const double chi2_best = CeresReference<D>(sample.graph).chi2(best);
  for (const Mode mode : {Mode::kSummary, Mode::kPaper, Mode::kObserve}) {
    const JoinResult<D> result = join_all(sample.graph, small_joins(mode));
    ASSERT_EQ(result.maps.size(), 1U);
    EXPECT_GE(result.report.chi2, chi2_best * (1 - 1e-9)) << "below the optimum";
    EXPECT_LT(result.report.chi2, 1.5 * chi2_best);
    EXPECT_NEAR(result.report.chi2, chi2(result.maps[0].values, sample.graph),
                1e-8 * result.report.chi2);
    const Eigen::VectorXd found = eigenvalues(result.maps[0].information.dense());
    EXPECT_GT(found.minCoeff(), -1e-10 * found.maxCoeff());
    EXPECT_EQ(result.maps[0].observations != nullptr, mode == Mode::kObserve);
  }
}

}  // namespace
}  // namespace mapjoin
