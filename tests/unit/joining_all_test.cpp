// Joining what falls apart, what is not determined, what was joined before, what is cancelled, and
// what is long.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pthread.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "mapjoin/evaluation/simulate.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/frames/local_map.h"
#include "mapjoin/graph/whole_piece.h"
#include "mapjoin/joining/join_all.h"
#include "mapjoin/joining/refine.h"
#include "tests/support/ceres_reference.h"
#include "tests/support/modes.h"
#include "tests/support/random_maps.h"

namespace mapjoin {
namespace {

using namespace test;  // NOLINT
using ::testing::HasSubstr;

template <class T>
class JoinAll : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(JoinAll, Dimensions);

/// A graph with every id raised, or in another session.
template <int D>
MeasurementGraph<D> shifted(const MeasurementGraph<D>& graph, std::uint64_t by,
                            std::uint32_t session = 0) {
  const auto name = [&](int v) {
    Key key = graph.variables.key(v);
    key.id += by;
    key.session = session;
    return key;
  };
  MeasurementGraphBuilder<D> builder;
  for (const auto& c : graph.relative) {
    for (std::size_t k = 0; k < c.size(); ++k) {
      builder.add(*c.kind, name(c.from[k]), name(c.to[k]),
                  c.z.data() + k * static_cast<std::size_t>(c.kind->value_size),
                  c.info.data() + k * static_cast<std::size_t>(c.kind->dim * c.kind->dim));
    }
  }
  return std::move(builder).build();
}

template <int D>
MeasurementGraph<D> both(const MeasurementGraph<D>& a, const MeasurementGraph<D>& b) {
  MeasurementGraphBuilder<D> builder;
  builder.add(a);
  builder.add(b);
  return std::move(builder).build();
}

template <int D>
void link(MeasurementGraphBuilder<D>& builder, const Key& from, const Key& to, const Rigid<D>& z) {
  constexpr int G = kGauge<D>;
  builder.template add<PoseType<D>>(from, to, z, 100.0 * Mat<G, G>::Identity());
}

TYPED_TEST(JoinAll, ReturnsThePiecesOfDisconnectedData) {
  constexpr int D = TypeParam::value;
  Dice dice(1);
  const auto one = random_graph<D>(dice, {.poses = 40, .points = 20}).graph;
  const auto two = shifted(random_graph<D>(dice, {.poses = 50, .points = 10}).graph, 1000);
  const auto three = shifted(random_graph<D>(dice, {.poses = 5, .points = 2}).graph, 500);
  const auto graph = both(both(two, one), three);
  for (const Mode mode : kModes) {
    const JoinResult<D> result = join_all(graph, small_leaves(mode));
    ASSERT_EQ(result.maps.size(), 3U);
    EXPECT_EQ(result.report.components, 3);
    const std::uint64_t lowest[] = {0, 500, 1000};
    double sum = 0.0;
    for (std::size_t m = 0; m < 3; ++m) {
      EXPECT_EQ(result.maps[m].anchor, pose_anchor<D>(pose_key(lowest[m])));
      const auto& part = m == 0 ? one : m == 1 ? three : two;
      EXPECT_EQ(result.maps[m].variables(), part.variables);
      const JoinResult<D> alone = join_all(part, small_leaves(mode));
      sum += alone.report.chi2;
      if (mode == Mode::kOptimal) {
        EXPECT_LT(distance(result.maps[m].values, alone.maps.at(0).values), 1e-4);
        EXPECT_EQ(result.maps[m].observations->size(), part.size());
      }
    }
    if (mode == Mode::kOptimal) {
      EXPECT_NEAR(result.report.chi2, sum, 1e-6 * sum);
    }
  }
}

TYPED_TEST(JoinAll, NeverLinksWhatOneFeatureTouches) {
  // Two recordings that saw one and the same feature: that is connected, and yet not rigid.
  constexpr int D = TypeParam::value;
  Dice dice(2);
  const auto one = random_graph<D>(dice, {.poses = 30, .points = 10}).graph;
  MeasurementGraphBuilder<D> builder;
  builder.add(one);
  builder.add(shifted(random_graph<D>(dice, {.poses = 30, .points = 10}).graph, 1000));
  const Mat<D, D> I = 100.0 * Mat<D, D>::Identity();
  builder.template add<PointType<D>>(pose_key(3), point_key(5000), random_point<D>(dice), I);
  builder.template add<PointType<D>>(pose_key(1003), point_key(5000), random_point<D>(dice), I);
  const auto graph = std::move(builder).build();
  for (const Mode mode : {Mode::kSummary, Mode::kObserve, Mode::kOptimal}) {
    const JoinResult<D> result = join_all(graph, small_leaves(mode));
    ASSERT_EQ(result.maps.size(), 2U);
    EXPECT_EQ(result.maps[0].anchor, pose_anchor<D>(pose_key(0)));
    EXPECT_EQ(result.maps[1].anchor, pose_anchor<D>(pose_key(1000)));
    EXPECT_TRUE(result.maps[0].values.contains(point_key(5000)));
    EXPECT_TRUE(result.maps[1].values.contains(point_key(5000)));
  }
}

TYPED_TEST(JoinAll, NamesAVariableThatIsNotDetermined) {
  constexpr int D = TypeParam::value;
  Dice dice(3);
  const auto base = random_graph<D>(dice, {.poses = 40, .points = 10}).graph;
  for (const Mode mode : {Mode::kObserve, Mode::kOptimal}) {
    MeasurementGraphBuilder<D> builder;
    builder.add(base);
    Mat<D, D> blind = 100.0 * Mat<D, D>::Identity();
    blind(D - 1, D - 1) = 0.0;
    builder.template add<PointType<D>>(pose_key(7), point_key(777), Vec<D>::Ones(), blind);
    EXPECT_THAT(complaint_of<SingularError>(
                    [&] { (void)join_all(std::move(builder).build(), small_leaves(mode)); }),
                HasSubstr("point:777"));
    constexpr int G = kGauge<D>;
    MeasurementGraphBuilder<D> other;
    other.add(base);
    Mat<G, G> position = Mat<G, G>::Zero();
    position.template topLeftCorner<D, D>().setIdentity();
    Rigid<D> z;
    z.t.setOnes();
    other.template add<PoseType<D>>(pose_key(7), pose_key(888), z, position);
    EXPECT_THAT(complaint_of<SingularError>(
                    [&] { (void)join_all(std::move(other).build(), small_leaves(mode)); }),
                HasSubstr("pose:888"));
  }
}

TYPED_TEST(JoinAll, TakesSemidefiniteMeasurementsThatTogetherDetermine) {
  // Features of which every pose sees one direction only, and edges that know only the position or
  // only the orientation: no leaf of the tree is determined by itself.
  constexpr int D = TypeParam::value;
  constexpr int G = kGauge<D>;
  for (const Mode mode : {Mode::kObserve, Mode::kOptimal}) {
    Dice dice(4);
    const auto sample = random_graph<D>(dice, {.poses = 60, .points = 0, .noise = 0.01});
    MeasurementGraphBuilder<D> builder;
    builder.add(sample.graph);
    ValuesBuilder<D> truth;
    for (std::uint64_t k = 0; k < 60; ++k)
      truth.template add<PoseType<D>>(pose_key(k), sample.truth.pose(pose_key(k)));
    for (std::uint64_t p = 0; p < 20; ++p) {
      const Vec<D> x = sample.truth.pose(pose_key(3 * p)) * random_point<D>(dice, 3.0);
      truth.template add<PointType<D>>(point_key(p), x);
      for (int s = 0; s < 2 * D; ++s) {
        const auto from = pose_key((3 * p + 11 * static_cast<std::uint64_t>(s)) % 60);
        const Mat<D, D> I = dice.semidefinite(D, 1, 100.0);
        builder.template add<PointType<D>>(from, point_key(p),
                                           Vec<D>(sample.truth.pose(from).inverse() * x), I);
      }
    }
    for (const bool position : {true, false}) {
      Mat<G, G> I = Mat<G, G>::Zero();
      I.template topLeftCorner<D, D>().setConstant(0.0);
      for (int k = 0; k < G; ++k) I(k, k) = (k < D) == position ? 100.0 : 0.0;
      const Rigid<D> step = random_pose<D>(dice);
      const auto from = pose_key(position ? 5 : 55);
      Rigid<D> z = sample.truth.pose(from).inverse() * sample.truth.pose(pose_key(0)) * step;
      builder.template add<PoseType<D>>(from, pose_key(600), z, I);
      if (position)
        truth.template add<PoseType<D>>(pose_key(600), sample.truth.pose(pose_key(0)) * step);
    }
    const auto graph = std::move(builder).build();
    Values<D> start = std::move(truth).build();
    start.transform(start.pose(pose_key(0)).inverse());
    const CeresReference<D> reference(graph);
    const Values<D> best = reference.minimise(start, pose_key(0));
    try {
      const JoinResult<D> result = join_all(graph, small_leaves(mode));
      ASSERT_EQ(result.maps.size(), 1U);
      if (mode == Mode::kOptimal) {
        EXPECT_NEAR(result.report.chi2, reference.chi2(best), 1e-6 * reference.chi2(best));
        EXPECT_LT(distance(result.maps[0].values, best), 1e-4);
      }
    } catch (const SingularError& error) {
      ADD_FAILURE() << error.what();
    }
  }
}

TYPED_TEST(JoinAll, StopsWhenItsCallbackSaysSo) {
  constexpr int D = TypeParam::value;
  Dice dice(5);
  const auto graph = random_graph<D>(dice, {.poses = 60, .points = 20}).graph;
  for (const Mode mode : kModes) {
    JoinOptions options = small_leaves(mode);
    double last = 0.0;
    int calls = 0;
    options.progress = [&](const Progress& progress) {
      ++calls;
      if (progress.phase == "join") {
        EXPECT_GE(progress.fraction, last);
        last = progress.fraction;
      }
      EXPECT_GE(progress.fraction, 0.0);
      EXPECT_LE(progress.fraction, 1.0);
      return true;
    };
    EXPECT_NO_THROW((void)join_all(graph, options));
    EXPECT_GT(calls, 0);
    for (int stop = 1; stop <= calls; ++stop) {
      int call = 0;
      options.progress = [&](const Progress&) { return ++call < stop; };
      EXPECT_THROW((void)join_all(graph, options), CancelledError);
      EXPECT_EQ(call, stop) << "it went on after it was told to stop";
    }
  }
}

TYPED_TEST(JoinAll, StopsWithSeveralThreadsToo) {
  constexpr int D = TypeParam::value;
  Dice dice(5);
  const auto graph = random_graph<D>(dice, {.poses = 60, .points = 20}).graph;
  JoinOptions options = small_leaves();
  options.threads = 3;
  options.progress = [](const Progress&) { return false; };
  EXPECT_THROW((void)join_all(graph, options), CancelledError);
  struct Gone {};
  options.progress = [](const Progress&) -> bool { throw Gone(); };
  EXPECT_THROW((void)join_all(graph, options), Gone);
}

TYPED_TEST(JoinAll, KeepsASharedGraphItself) {
  constexpr int D = TypeParam::value;
  Dice dice(8);
  const auto graph = std::make_shared<const MeasurementGraph<D>>(
      random_graph<D>(dice, {.poses = 30, .points = 10}).graph);
  const JoinResult<D> shared = join_all(graph, small_leaves());
  const JoinResult<D> copied = join_all(*graph, small_leaves());
  ASSERT_EQ(shared.maps.size(), 1U);
  EXPECT_EQ(shared.maps[0].observations, graph);
  EXPECT_NE(copied.maps.at(0).observations, graph);
  EXPECT_EQ(shared.report.chi2, copied.report.chi2);
}

/// The solves of refine alone, from given values.
template <int D>
RefineResult refined_from(const MeasurementGraph<D>& graph, const Values<D>& values,
                          double tolerance) {
  return refine_from(graph, values, 100, tolerance);
}

// Twelve times the usual noise and hardly a loop closure. One linear solve a wide join, however
// well refined afterwards, ends in another minimum; joins that check what was promised do not.
// Which of these worlds fail without safeguards depends on the elimination order; most do.
TEST(Safeguards, SaveWideJoinsThatFailWithoutThem) {
  int saved = 0;
  for (const unsigned seed : {8U, 9U, 10U, 13U, 16U}) {
    SimulationOptions world = simulation_defaults(World::kManhattan);
    world.poses = 400;
    world.seed = seed;
    world.noise = 12.0;
    world.edges_per_pose = 1.2;
    const Simulation<2> simulation = simulate<2>(world);
    const double best = refined_from(simulation.graph, simulation.truth, 1e-9).chi2;
    JoinOptions options;
    options.leaf_variables = 32;
    options.arity = 64;
    const JoinResult<2> guarded = join_all(simulation.graph, options);
    EXPECT_GT(guarded.report.redone_joins, 0);
    EXPECT_TRUE(guarded.report.minimum);
    EXPECT_NEAR(guarded.report.chi2, best, 1e-6 * best) << "seed " << seed;
    options.mode = Mode::kObserve;
    const JoinResult<2> unguarded = join_all(simulation.graph, options);
    const Values<2>& start = unguarded.maps.at(0).values;
    if (refined_from(simulation.graph, start, 1e-9).chi2 > 1.1 * best) ++saved;
  }
  EXPECT_GE(saved, 3);
}

TYPED_TEST(JoinAll, LeavesAsMuchAboveTheMinimumAsItMay) {
  constexpr int D = TypeParam::value;
  Dice dice(10);
  int earlier = 0;
  for (int world = 0; world < 20; ++world) {
    const auto graph =
        random_graph<D>(dice, {.poses = 40, .points = 10, .closures = 30, .noise = 0.05}).graph;
    JoinOptions options = small_leaves(Mode::kObserve);
    options.root_solves = 1;  // far from the minimum, by a last bad step
    const Values<D> start = join_all(graph, options).maps.at(0).values;
    const auto refined = [&](double tolerance) { return refined_from(graph, start, tolerance); };
    const RefineResult best = refined(0.0);
    for (const double tolerance : {1e-3, 1e-5, 1e-7}) {
      const RefineResult result = refined(tolerance);
      EXPECT_TRUE(result.minimum);
      // What is left is an estimate: it may be off by half.
      EXPECT_LE(result.chi2 - best.chi2, 1.5 * tolerance * best.chi2);
      if (result.solves < best.solves) ++earlier;
    }
  }
  EXPECT_GT(earlier, 30);  // of 60
}

// Streets bend when their loops close: the factor of the step that closed them serves to correct
// it, and what a whole solve would leave is as little.
TEST(Refinement, CorrectsALargeStepInsteadOfAnotherFactorization) {
  int with = 0, without = 0;
  for (int k = 0; k < 24; ++k) {
    SimulationOptions world = simulation_defaults(World::kManhattan);
    world.poses = 1500;
    world.seed = static_cast<std::uint64_t>(k);
    world.noise = 1.0 + k % 4;
    const MeasurementGraph<2> graph = simulate<2>(world).graph;
    JoinOptions options;
    options.mode = Mode::kObserve;
    options.root_solves = 1;
    const Values<2> start = join_all(graph, options).maps.at(0).values;
    const double best = refined_from(graph, start, 1e-12).chi2;
    const auto refined = [&](bool knows) {
      Piece<2> piece = whole_piece(graph, start);
      Places places(graph.variables.size());
      ObservationSystem<2> system(graph, piece, {}, places);
      FrontalCholesky cholesky;
      WorkerPool pool;
      LastSolve last;
      if (knows) last.values = piece.data;
      const auto step = linear_step(graph, piece, system, cholesky, pool);
      last.chi2 = step.chi2;
      last.promised = step.predicted_decrease;
      const RefineResult result =
          refine(graph, piece, system, cholesky, pool, 100, kRefineTolerance, {}, last);
      EXPECT_TRUE(result.minimum);
      EXPECT_LE(result.chi2 - best, 1e-6 * best) << "world " << k;
      return result.factorizations;
    };
    with += refined(true);
    without += refined(false);
  }
  EXPECT_LT(with, without);
  RecordProperty("with", with);
  RecordProperty("without", without);
}

/// What refine makes of the factor of a solve.
struct Refined {
  double promised = 0.0;  ///< by the solve, as a part of the chi2 it leads to
  RefineResult result;
  double above = 0.0;  ///< the minimum, as a part of it
};

/// Two solves of a small world, the second of which is refined. They begin beside its truth, least
/// to most standard deviations of a heading's error away.
Refined refine_from_beside_the_truth(std::uint64_t seed, double noise, double least, double most) {
  SimulationOptions world = simulation_defaults(World::kManhattan);
  world.poses = 400;
  world.seed = seed;
  world.noise = noise;
  const Simulation<2> made = simulate<2>(world);
  const MeasurementGraph<2>& graph = made.graph;
  Piece<2> piece = whole_piece(graph, made.truth);
  Dice dice(seed);
  std::vector<double> away(3 * static_cast<std::size_t>(piece.size()));
  const double far = dice.uniform(least, most) * std::sqrt(world.sigma_rotation * world.noise);
  for (double& a : away) a = far * dice.normal();
  retract(graph.variables, piece, std::span<const double>(away));
  Places places(graph.variables.size());
  ObservationSystem<2> system(graph, piece, {}, places);
  FrontalCholesky cholesky;
  WorkerPool pool;
  linear_step(graph, piece, system, cholesky, pool);
  LastSolve last;
  last.values = piece.data;
  const auto step = linear_step(graph, piece, system, cholesky, pool);
  last.chi2 = step.chi2;
  last.promised = step.predicted_decrease;
  Refined out;
  out.promised = last.promised / (last.chi2 - last.promised);
  const double best = refined_from(graph, to_values(graph.variables, piece), 1e-12).chi2;
  out.result = refine(graph, piece, system, cholesky, pool, 100, kRefineTolerance, {}, last);
  out.above = (out.result.chi2 - best) / best;
  return out;
}

// Where measurements are good, the last solve of a join takes most of chi2 away and is at the
// minimum all the same: its factor tells, without another.
TEST(Refinement, TrustsALargeStepThatEndsAtTheMinimum) {
  int trusted = 0, others = 0;
  for (std::uint64_t k = 0; k < 60; ++k) {
    // So far from the truth that the first step leaves errors like those of the measurements.
    const Refined run = refine_from_beside_the_truth(
        k, 0.002 * std::pow(1.2, static_cast<double>(k % 30)), 0.3, 3.0);
    if (run.promised < 0.5) continue;
    EXPECT_TRUE(run.result.minimum);
    EXPECT_LE(run.above, 1e-6) << "world " << k;
    (run.result.factorizations == 0 ? trusted : others) += 1;
  }
  EXPECT_GT(trusted, 5);  // or these worlds no longer show it
  EXPECT_GT(others, 5);
  RecordProperty("trusted", trusted);
  RecordProperty("others", others);
}

// Not as small as those that joins end with, not so large that its factor may be worth nothing.
TEST(Refinement, FinishesAMiddlingStepByItsFactor) {
  int middling = 0;
  for (std::uint64_t k = 0; k < 60; ++k) {
    const Refined run = refine_from_beside_the_truth(
        k, 0.002 * std::pow(1.2, static_cast<double>(k % 40)), 0.3, 3.0);
    if (run.promised < 0.01 || run.promised > 0.5) continue;
    ++middling;
    EXPECT_TRUE(run.result.minimum);
    EXPECT_LE(run.above, 1e-6) << "world " << k;
    EXPECT_EQ(run.result.factorizations, 0) << "world " << k;
  }
  EXPECT_GT(middling, 10);  // or these worlds no longer show it
  RecordProperty("middling", middling);
}

TYPED_TEST(JoinAll, RefusesEmptyInputAndSenselessOptions) {
  constexpr int D = TypeParam::value;
  Dice dice(6);
  EXPECT_THROW((void)join_all(MeasurementGraph<D>()), InputError);
  EXPECT_THROW((void)join_all<D>(std::span<const LocalMap<D>>()), InputError);
  EXPECT_THROW((void)join_all<D>(std::span<const Map<D>>(), MeasurementGraph<D>()), InputError);
  const auto graph = random_graph<D>(dice, {.poses = 4, .points = 2}).graph;
  for (int option = 0; option < 4; ++option) {
    JoinOptions options;
    (option == 0   ? options.threads
     : option == 1 ? options.leaf_variables
     : option == 2 ? options.arity
                   : options.max_refine_solves) = -1;
    EXPECT_THROW((void)join_all(graph, options), InputError) << option;
  }
  for (const double tolerance : {-1e-9, 0.01, std::numeric_limits<double>::quiet_NaN()}) {
    JoinOptions options;
    options.refine_tolerance = tolerance;
    EXPECT_THROW((void)join_all(graph, options), InputError) << tolerance;
  }
}

TYPED_TEST(JoinAll, RefinesToTheToleranceThatIsAskedFor) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 16; seed < 20; ++seed) {
    Dice dice(seed);
    const auto graph =
        random_graph<D>(dice, {.poses = 300, .points = 40, .closures = 200, .noise = 0.05}).graph;
    JoinOptions options;
    options.refine_tolerance = 0.0;
    const JoinResult<D> least = join_all(graph, options);
    ASSERT_EQ(least.maps.size(), 1u);
    int solves = 0;
    for (const double tolerance : {1e-3, 1e-5, 1e-7, 1e-10}) {
      options.refine_tolerance = tolerance;
      const JoinResult<D> result = join_all(graph, options);
      EXPECT_TRUE(result.report.minimum);
      EXPECT_GE(result.report.chi2, least.report.chi2 * (1.0 - 1e-12));
      EXPECT_LE(result.report.chi2, least.report.chi2 * (1.0 + tolerance)) << tolerance;
      EXPECT_GE(result.report.refine_solves, solves);
      solves = result.report.refine_solves;
    }
    EXPECT_GT(least.report.refine_solves, 1);
  }
}

TYPED_TEST(JoinAll, JoinsTwoSessionsByTheLinksBetweenThem) {
  constexpr int D = TypeParam::value;
  Dice dice(7);
  // One world; poses below 30 and from 30 on in recordings of their own, both counted from 0.
  const auto sample =
      random_graph<D>(dice, {.poses = 60, .points = 20, .closures = 40, .noise = 0.03});
  const auto name = [](const Key& key) {
    Key out = key;
    if (key.type == Tag("pose") && key.id >= 30) out = pose_key(key.id - 30, 1);
    return out;
  };
  MeasurementGraphBuilder<D> builders[4];  // first, second, links, all
  for (const auto& c : sample.graph.relative) {
    for (std::size_t k = 0; k < c.size(); ++k) {
      const Key from = name(sample.graph.variables.key(c.from[k]));
      const Key to = name(sample.graph.variables.key(c.to[k]));
      const bool pose = to.type == Tag("pose");
      const std::size_t part = pose && from.session != to.session ? 2 : from.session;
      for (const std::size_t b : {part, std::size_t{3}}) {
        builders[b].add(*c.kind, from, to,
                        c.z.data() + k * static_cast<std::size_t>(c.kind->value_size),
                        c.info.data() + k * static_cast<std::size_t>(c.kind->dim * c.kind->dim));
      }
    }
  }
  const auto links = std::move(builders[2]).build();
  const auto all = std::move(builders[3]).build();
  ASSERT_GT(links.size(), 3U);
  std::vector<Map<D>> maps;
  for (const int b : {0, 1}) {
    const auto part = std::move(builders[b]).build();
    maps.push_back(join_all(part, small_leaves()).maps.at(0));
  }
  const JoinResult<D> joined = join_all<D>(std::span<const Map<D>>(maps), links, small_leaves());
  const JoinResult<D> whole = join_all(all, small_leaves());
  ASSERT_EQ(joined.maps.size(), 1U);
  EXPECT_EQ(joined.maps[0].variables(), all.variables);
  EXPECT_NEAR(joined.report.chi2, whole.report.chi2, 1e-6 * whole.report.chi2);
  EXPECT_LT(distance(joined.maps[0].values, whole.maps.at(0).values), 1e-4);
  // By summaries alone: near, and judged by what it was given.
  const JoinResult<D> summary =
      join_all<D>(std::span<const Map<D>>(maps), links, small_leaves(Mode::kSummary));
  ASSERT_EQ(summary.maps.size(), 1U);
  EXPECT_LT(distance(summary.maps[0].values, whole.maps.at(0).values), 0.3);
  // And without links the sessions stay apart, though features may be shared by key.
  EXPECT_EQ(maps[0].values.contains(pose_key(0, 1)), false);
}

TYPED_TEST(JoinAll, JoinsFinishedMapsThatForgotTheirObservations) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    const Values<D> all = random_values<D>(dice, ids(12), ids(10));
    std::vector<Map<D>> maps;
    CeresReference<D> reference;
    for (std::uint64_t k = 0; k < 3; ++k) {
      const Values<D> x = noisy(dice, part_of(all, ids(5, 3 * k), ids(5, 2 * k)), 0.02);
      maps.push_back(map_of(dice, x, pose_anchor<D>(pose_key(3 * k + 2)), 100.0));
      reference.add(as_local_map(maps.back()));
    }
    maps[1] = change_frame(maps[1], pose_anchor<D>(pose_key(4)));  // solved in pose 5 all the same
    const JoinResult<D> result = join_all<D>(std::span<const Map<D>>(maps), {}, small_leaves());
    Values<D> start = part_of(all, ids(11), ids(9));
    start.transform(start.pose(pose_key(0)).inverse());
    const Values<D> best = reference.minimise(start, pose_key(0));
    ASSERT_EQ(result.maps.size(), 1U);
    EXPECT_NEAR(result.report.chi2, reference.chi2(best), 1e-6 * reference.chi2(best));
    EXPECT_LT(distance(result.maps[0].values, best), 1e-4);
    EXPECT_THAT(result.report.notes, ::testing::Contains(HasSubstr("3 of 3 maps")));
  }
}

TEST(JoinALot, AChainOf200000PosesWithoutDeepRecursion) {
  constexpr int kPoses = 200000;
  MeasurementGraphBuilder<2> builder;
  builder.reserve(kind_of<Pose2>(), kPoses);
  const Rigid2 step = rigid2(1.0, 0.0, 6.283185307179586 / 1000);
  Rigid2 end;
  for (std::uint64_t k = 1; k < kPoses; ++k) {
    link<2>(builder, pose_key(k - 1), pose_key(k), step);
    end = end * step;
  }
  const MeasurementGraph<2> graph = std::move(builder).build();
  struct Run {
    const MeasurementGraph<2>& graph;
    JoinResult<2> result;
  } run{graph, {}};
  // On a thread that has hardly a stack.
  pthread_attr_t small;
  pthread_attr_init(&small);
  ASSERT_EQ(pthread_attr_setstacksize(&small, 512 * 1024), 0);
  pthread_t thread{};
  const auto body = [](void* argument) -> void* {
    auto& job = *static_cast<Run*>(argument);
    JoinOptions options;
    options.information = false;
    job.result = join_all(job.graph, options);
    return nullptr;
  };
  ASSERT_EQ(pthread_create(&thread, &small, body, &run), 0);
  pthread_join(thread, nullptr);
  pthread_attr_destroy(&small);
  ASSERT_EQ(run.result.maps.size(), 1U);
  EXPECT_LT(run.result.report.chi2, 1e-6);
  EXPECT_LT(distance(run.result.maps[0].values.pose(pose_key(kPoses - 1)).t, end.t), 1e-3);
}

}  // namespace
}  // namespace mapjoin
