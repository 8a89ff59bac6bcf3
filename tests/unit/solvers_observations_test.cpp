// The linear systems of joins: normal equations inside the fronts, CHOLMOD, and plain dense
// algebra.

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <vector>

#include "mapjoin/graph/index.h"
#include "mapjoin/graph/whole_piece.h"
#include "mapjoin/solvers/observation_system.h"
#include "mapjoin/solvers/sparse_cholesky.h"
#include "mapjoin/solvers/submap_kernel.h"
#include "tests/support/ceres_reference.h"
#include "tests/support/dense.h"
#include "tests/support/random_maps.h"
#include "tests/support/user_types.h"

namespace mapjoin {
namespace {

using namespace test;  // NOLINT

template <class T>
class Observations : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(Observations, Dimensions);

/// A graph of relative measurements and of dense local maps, some of which measure a variable
/// twice, or the pose of another.
template <int D>
RandomGraph<D> mixed_graph(Dice& dice) {
  RandomGraph<D> out = random_graph<D>(dice, {.poses = 12, .points = 8, .sightings = 2});
  MeasurementGraphBuilder<D> builder;
  builder.add(out.graph);
  builder.add(random_local_map<D>(dice, out.truth, 3,
                                  {pose_key(7), point_key(2), pose_key(1), point_key(5)}, 0.05));
  builder.add(random_local_map<D>(
      dice, out.truth, 9, {point_key(1), pose_key(2), pose_key(10), pose_key(2), point_key(1)},
      0.05));
  out.graph = std::move(builder).build();
  return out;
}

TYPED_TEST(Observations, AreLinearisedAsTheDefinitionSays) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    const auto sample = mixed_graph<D>(dice);
    const Values<D> x = noisy(dice, sample.truth, 0.2);  // where residuals are large
    const Piece<D> piece = whole_piece(sample.graph, x);
    Places places(sample.graph.variables.size());
    const ObservationList<D> list(sample.graph, piece, places);
    const auto expected = CeresReference<D>(sample.graph).normal_equations(x);
    EXPECT_NEAR(list.chi2(piece), expected.chi2, 1e-9 * expected.chi2);
    EXPECT_LT(relative_distance(list.information(piece).dense(), expected.H), 1e-9);
    ObservationSystem<D> system(sample.graph, piece, {}, places);
    EXPECT_LT(relative_distance(system.information(piece).dense(), expected.H), 1e-9);
    WorkerPool pool(2);
    EXPECT_NEAR(system.chi2(piece, pool), expected.chi2, 1e-9 * expected.chi2);
  }
}

TYPED_TEST(Observations, AreSolvedAsDenseAlgebraSolvesThem) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    const auto sample = mixed_graph<D>(dice);
    const Values<D> x = noisy(dice, sample.truth, 0.1);
    const Piece<D> piece = whole_piece(sample.graph, x);
    Places places(sample.graph.variables.size());
    const auto normal = CeresReference<D>(sample.graph).normal_equations(x);
    std::vector<std::int32_t> backwards(static_cast<std::size_t>(sample.graph.variables.size()));
    std::iota(backwards.rbegin(), backwards.rend(), 0);
    for (const auto& rank : {std::vector<std::int32_t>{}, backwards}) {
      ObservationSystem<D> system(sample.graph, piece, rank, places);
      FrontalCholesky cholesky;
      WorkerPool pool(1);
      Eigen::VectorXd d;
      const auto step = system.solve(piece, cholesky, pool, d);
      ASSERT_TRUE(step.ok());
      EXPECT_NEAR(step.chi2, normal.chi2, 1e-9 * normal.chi2);
      EXPECT_LT((normal.H * d - normal.b).norm(), 1e-8 * normal.b.norm());
      EXPECT_NEAR(step.predicted_decrease, normal.b.dot(d), 1e-8 * normal.b.dot(d));

      // CHOLMOD with the first pose held: the same but for a motion of the whole.
      const SymmetricBlockMatrix H = system.information(piece);
      const int pose = x.variables().offset(x.variables().require(pose_key(0), "test"));
      std::vector<int> dropped(static_cast<std::size_t>(kGauge<D>));
      std::iota(dropped.begin(), dropped.end(), pose);
      SparseCholesky sparse;
      sparse.analyze(H, dropped);
      ASSERT_EQ(sparse.factorize(H), -1);
      const Eigen::VectorXd other = sparse.solve(normal.b);
      const Eigen::MatrixXd g = x.gauge();
      const Eigen::VectorXd difference = d - other;
      const Eigen::VectorXd motion = test::dense_least_squares(g, difference);
      EXPECT_LT((g * motion - difference).norm(), 1e-7 * (1.0 + d.norm()));
    }
  }
}

TYPED_TEST(Observations, AreSolvedAgainWithTheOldMatrixAndTheNewGradient) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    const auto sample = mixed_graph<D>(dice);
    const Values<D> x = noisy(dice, sample.truth, 0.1);
    const Values<D> moved = noisy(dice, x, 0.05);
    const Piece<D> before = whole_piece(sample.graph, x);
    const Piece<D> now = whole_piece(sample.graph, moved);
    Places places(sample.graph.variables.size());
    const Eigen::MatrixXd H = CeresReference<D>(sample.graph).normal_equations(x).H;
    const auto normal = CeresReference<D>(sample.graph).normal_equations(moved);
    ObservationSystem<D> system(sample.graph, before, {}, places);
    for (const int threads : {1, 2}) {
      FrontalCholesky cholesky;
      WorkerPool pool(threads);
      Eigen::VectorXd d;
      ASSERT_TRUE(system.solve(before, cholesky, pool, d).ok());
      EXPECT_FALSE(system.solve_again(now, cholesky, pool, 1e-9, d));  // promises more than that
      const auto again = system.solve_again(now, cholesky, pool, 100.0 * normal.chi2, d);
      ASSERT_TRUE(again);
      const auto& step = *again;
      EXPECT_NEAR(step.chi2, normal.chi2, 1e-9 * normal.chi2);
      EXPECT_NEAR(step.predicted_decrease, normal.b.dot(d), 1e-8 * normal.b.dot(d));
      // But for what holds the gauge, the scalars of one pose: the new gradient is not quite blind
      // to the old matrix's free motions.
      const Eigen::VectorXd rest = H * d - normal.b;
      EXPECT_LE((rest.array().abs() > 1e-8 * normal.b.norm()).count(), kGauge<D>);
    }
  }
}

TYPED_TEST(Observations, AreCorrectedAfterAStepToAHigherOrder) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    const auto sample = random_graph<D>(dice, {.poses = 60, .points = 20, .closures = 20});
    Piece<D> piece = whole_piece(sample.graph, noisy(dice, sample.truth, 0.02));
    const auto then = piece.data;
    Places places(sample.graph.variables.size());
    ObservationSystem<D> system(sample.graph, piece, {}, places);
    FrontalCholesky cholesky;
    WorkerPool pool(2);
    Eigen::VectorXd d, chord;
    const auto step = [&](const Eigen::VectorXd& by) {
      retract(sample.graph.variables, piece, std::span<const double>(by.data(), at(by.size())));
      return system.chi2(piece, pool);
    };
    ASSERT_TRUE(system.solve(piece, cholesky, pool, d).ok());
    ASSERT_TRUE(system.correct(then, piece, cholesky, pool, 1e9, chord));
    EXPECT_LT((chord - d).norm(), 1e-6 * d.norm());  // no step yet: all of it is missing
    const double stepped = step(d);
    EXPECT_FALSE(system.correct(then, piece, cholesky, pool, 1e-12, d));  // promises more
    const auto correction = system.correct(then, piece, cholesky, pool, 1e9, d);
    ASSERT_TRUE(correction);
    EXPECT_NEAR(correction->chi2, stepped, 1e-9 * stepped);
    const double corrected = step(d);
    for (int more = 0; more < 10; ++more) {
      ASSERT_TRUE(system.solve(piece, cholesky, pool, d).ok());
      step(d);
    }
    const double least = system.chi2(piece, pool);
    EXPECT_LT(corrected - least, 0.1 * (stepped - least));
    EXPECT_NEAR(correction->predicted_decrease, stepped - corrected, 0.2 * (stepped - corrected));
  }
}

TYPED_TEST(Observations, OfSubmapsAreNotCorrected) {
  constexpr int D = TypeParam::value;
  Dice dice(1);
  const auto sample = mixed_graph<D>(dice);
  const Piece<D> piece = whole_piece(sample.graph, noisy(dice, sample.truth, 0.1));
  Places places(sample.graph.variables.size());
  ObservationSystem<D> system(sample.graph, piece, {}, places);
  FrontalCholesky cholesky;
  WorkerPool pool(1);
  Eigen::VectorXd d;
  ASSERT_TRUE(system.solve(piece, cholesky, pool, d).ok());
  EXPECT_FALSE(system.correct(piece.data, piece, cholesky, pool, 1e9, d));
}

TYPED_TEST(Observations, GiveTheSameBitsOnAnyNumberOfThreads) {
  constexpr int D = TypeParam::value;
  Dice dice(4);
  const auto sample = random_graph<D>(dice, {.poses = 300, .points = 100, .closures = 60});
  const Piece<D> piece = whole_piece(sample.graph, noisy(dice, sample.truth, 0.05));
  Places places(sample.graph.variables.size());
  std::vector<Eigen::VectorXd> results;
  std::vector<double> chi2;
  for (const int threads : {1, 2, 3}) {
    ObservationSystem<D> system(sample.graph, piece, {}, places);
    FrontalCholesky cholesky;
    WorkerPool pool(threads);
    results.emplace_back();
    ASSERT_TRUE(system.solve(piece, cholesky, pool, results.back()).ok());
    chi2.push_back(system.chi2(piece, pool));
  }
  EXPECT_EQ(results[0], results[1]);
  EXPECT_EQ(results[0], results[2]);
  EXPECT_EQ(chi2[0], chi2[1]);
  EXPECT_EQ(chi2[0], chi2[2]);
}

/// Gradient and Gauss-Newton matrix of one submap, at any anchor, by differences of its residual.
template <int D>
void check_submap(const MeasurementGraph<D>& graph, const Values<D>& x) {
  const auto& maps = graph.submaps;
  ASSERT_EQ(maps.size(), 1U);
  const CliqueList list = cliques(graph);
  const auto first = list.variables.begin() + list.start[list.size() - 1];
  const std::vector<std::int32_t> clique(first, list.variables.end());
  std::vector<std::int32_t> rows{0};
  for (const std::int32_t v : clique) rows.push_back(rows.back() + graph.variables.dim(v));
  const int n = rows.back();
  const auto evaluate = [&](const Values<D>& at, const DenseTarget* target) {
    std::vector<const double*> values;
    for (const std::int32_t v : clique) values.push_back(at.value(v));
    SubmapScratch scratch;
    return linearize_submap(graph, 0, values.data(), rows, target, scratch);
  };
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(n + 1, n);
  const DenseTarget target{H.data(), n + 1, n, nullptr, 0, n};
  const double chi2 = evaluate(x, &target);
  EXPECT_NEAR(evaluate(x, nullptr), chi2, 1e-12 * chi2);

  const auto shifted = [&](int k, double h) {
    std::vector<double> d(static_cast<std::size_t>(graph.variables.scalars()), 0.0);
    const auto owner = std::upper_bound(rows.begin(), rows.end(), k) - rows.begin() - 1;
    const int v = clique[static_cast<std::size_t>(owner)];
    d[static_cast<std::size_t>(graph.variables.offset(v) + k -
                               rows[static_cast<std::size_t>(owner)])] = h;
    Values<D> y = x;
    y.retract(d);
    return y;
  };
  // The residual by the definition: local(X, frame(x) x) of every term.
  Eigen::MatrixXd I;
  const auto residual = [&](const Values<D>& at) {
    std::vector<const double*> anchors;
    std::vector<Key> keys;
    for (const std::int32_t a : maps.anchor_variables) {
      anchors.push_back(at.value(a));
      keys.push_back(graph.variables.key(a));
    }
    const Rigid<D> into = maps.anchors[0]->frame(anchors.data(), keys.data());
    std::vector<double> r;
    for (std::size_t t = 0; t < maps.term_variable.size(); ++t) {
      const int v = maps.term_variable[t];
      const VariableKind<D>& kind = graph.variables.kind(v);
      std::vector<double> seen(at.value(v), at.value(v) + kind.value_size);
      kind.transform(into, seen.data(), 1);
      std::vector<double> part(static_cast<std::size_t>(kind.dim));
      kind.local(maps.values.data() + maps.term_value[t], seen.data(), 1, part.data());
      r.insert(r.end(), part.begin(), part.end());
    }
    return Eigen::VectorXd(
        Eigen::Map<Eigen::VectorXd>(r.data(), static_cast<Eigen::Index>(r.size())));
  };
  const Eigen::VectorXd r = residual(x);
  std::vector<int> start{0};
  for (const std::int32_t v : maps.term_variable)
    start.push_back(start.back() + graph.variables.dim(v));
  I = Eigen::MatrixXd::Zero(r.size(), r.size());
  for (std::size_t b = 0; b < maps.block_row.size(); ++b) {
    const auto i = static_cast<std::size_t>(maps.block_row[b]);
    const auto j = static_cast<std::size_t>(maps.block_column[b]);
    const Eigen::Map<const Eigen::MatrixXd> block(maps.information.data() + maps.block_value[b],
                                                  start[i + 1] - start[i], start[j + 1] - start[j]);
    I.block(start[i], start[j], block.rows(), block.cols()) = block;
    if (i != j) I.block(start[j], start[i], block.cols(), block.rows()) = block.transpose();
  }
  EXPECT_NEAR(chi2, r.dot(I * r), 1e-10 * chi2);
  Eigen::MatrixXd J(r.size(), n);
  for (int k = 0; k < n; ++k)
    J.col(k) = (residual(shifted(k, 1e-5)) - residual(shifted(k, -1e-5))) / 2e-5;
  const Eigen::MatrixXd lower = H.topRows(n);
  EXPECT_LT(relative_distance(lower.selfadjointView<Eigen::Lower>(),
                              Eigen::MatrixXd(J.transpose() * I * J)),
            1e-6);
  const Eigen::VectorXd b = H.row(n).transpose();
  EXPECT_LT(relative_distance(b, Eigen::VectorXd(-J.transpose() * I * r)), 1e-6);
  for (int k = 0; k < n; ++k) {
    const double slope =
        (evaluate(shifted(k, 1e-5), nullptr) - evaluate(shifted(k, -1e-5), nullptr)) / 2e-5;
    EXPECT_NEAR(-2.0 * b(k), slope, 1e-5 * (1.0 + b.cwiseAbs().maxCoeff()));
  }
}

TYPED_TEST(Observations, SubmapsFromAPoseHaveTheRightSlopes) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    const Values<D> all = random_values<D>(dice, ids(4), ids(3));
    std::vector<Key> terms{pose_key(0), point_key(1), pose_key(3), point_key(2)};
    if (seed % 2 == 0) terms.insert(terms.end(), {pose_key(0), point_key(2), point_key(2)});
    MeasurementGraphBuilder<D> builder;
    builder.add(random_local_map<D>(dice, all, 1, terms, 0.3));
    const MeasurementGraph<D> graph = std::move(builder).build();
    check_submap(graph, part_of(all, {0, 1, 3}, {1, 2}));
  }
}

TEST(SubmapsOfAnyKind, HaveTheRightSlopesFromTwoPointsToo) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    ValuesBuilder<2> values;
    values.add<Point2>(point_key(1), random_point<2>(dice));
    values.add<Point2>(point_key(2), random_point<2>(dice));
    values.add<Point2>(point_key(3), random_point<2>(dice));
    values.add<Pose2>(pose_key(5), random_pose<2>(dice));
    values.add<Wall>({Tag("wall"), 0, 6}, {1.0, 2.0});
    values.add<BiasType<2>>({Tag("bias"), 0, 7}, Vec<1>(0.3));
    const Values<2> x = std::move(values).build();
    LocalMap<2> map;
    map.anchor = two_points(1, 3);
    const Rigid2 into = motion_into(map.anchor, x);
    std::vector<int> offsets{0};
    const auto add = [&]<class T>(const Key& key, const ValueOf<T>& z) {
      map.add_term<T>(key, noisy<T>(dice, z, 0.2));
      offsets.push_back(offsets.back() + T::dim);
    };
    add.operator()<Point2>(point_key(2), into * x.point(point_key(2)));
    add.operator()<Pose2>(pose_key(5), into * x.pose(pose_key(5)));
    add.operator()<Wall>({Tag("wall"), 0, 6},
                         Wall::transform<double>(into, x.at<Wall>({Tag("wall"), 0, 6})));
    add.operator()<Point2>(point_key(3), into * x.point(point_key(3)));  // partly pinned
    add.operator()<BiasType<2>>({Tag("bias"), 0, 7}, Vec<1>(0.1));
    map.values[map.values.size() - 2] = 0.0;  // its y is the frame's
    Eigen::MatrixXd I = dice.definite(offsets.back());
    const int pinned = offsets[3] + 1;
    I.row(pinned).setZero();
    I.col(pinned).setZero();
    map.information = SymmetricBlockMatrix::from_dense(offsets, I);
    MeasurementGraphBuilder<2> builder;
    builder.add(map);
    const MeasurementGraph<2> graph = std::move(builder).build();
    ASSERT_EQ(graph.variables, x.variables());
    check_submap(graph, x);
  }
}

/// A random positive definite block matrix, and which of its scalars are left out.
struct System {
  SymmetricBlockMatrix H;
  std::vector<int> dropped, kept;
};
System random_system(Dice& dice, int blocks) {
  System out;
  std::vector<int> offsets{0};
  for (int k = 0; k < blocks; ++k) offsets.push_back(offsets.back() + 1 + dice.below(6));
  const auto dim = [&](int i) {
    return offsets[static_cast<std::size_t>(i) + 1] - offsets[static_cast<std::size_t>(i)];
  };
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(offsets.back(), offsets.back());
  for (int k = 0; k < 2 * blocks; ++k) {
    const int i = dice.below(blocks);
    const int j = std::min(blocks - 1, i + dice.below(4));
    if (i == j) continue;
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(dim(i) + dim(j), offsets.back());
    J.middleCols(offsets[static_cast<std::size_t>(i)], dim(i)) = dice.matrix(J.rows(), dim(i));
    J.middleCols(offsets[static_cast<std::size_t>(j)], dim(j)) = dice.matrix(J.rows(), dim(j));
    dense += J.transpose() * J;
  }
  dense.diagonal().array() += 0.1;
  out.H = SymmetricBlockMatrix::from_dense(offsets, dense);
  for (int s = 0; s < offsets.back(); ++s)
    (dice.below(5) == 0 ? out.dropped : out.kept).push_back(s);
  return out;
}

TEST(SparseCholesky, SolvesAsDenseAlgebraDoesByEitherMethod) {
  using Method = SparseCholesky::Method;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    System system = random_system(dice, 2 + dice.below(25));
    for (const Method method : {Method::kAutomatic, Method::kSimplicial, Method::kSupernodal}) {
      SparseCholesky cholesky(method);
      cholesky.analyze(system.H, system.dropped);
      for (const double scale : {1.0, 3.0}) {  // other numbers in the same pattern
        SymmetricBlockMatrix H = system.H;
        for (double& v : H.values()) v *= scale;
        ASSERT_EQ(cholesky.factorize(H), -1);
        const Eigen::MatrixXd dense = H.dense();
        const Eigen::MatrixXd b = dice.matrix(dense.rows(), 3);
        const Eigen::MatrixXd x = cholesky.solve(b);
        const Eigen::MatrixXd expected =
            test::dense_solve(dense(system.kept, system.kept), b(system.kept, Eigen::all));
        EXPECT_LT(distance(x(system.kept, Eigen::all), expected), 1e-9);
        EXPECT_TRUE(x(system.dropped, Eigen::all).isZero(0.0));
      }
    }
  }
}

TEST(SparseCholesky, SaysWhichScalarIsNotDetermined) {
  using Method = SparseCholesky::Method;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    System system = random_system(dice, 4 + dice.below(20));
    const int bad =
        system.kept[static_cast<std::size_t>(dice.below(static_cast<int>(system.kept.size())))];
    Eigen::MatrixXd dense = system.H.dense();
    const Eigen::MatrixXd good = dense;
    dense.row(bad).setZero();
    dense.col(bad).setZero();
    const double entry = seed % 2 == 0 ? 0.0 : -1.0;
    dense(bad, bad) = entry;
    for (const Method method : {Method::kSimplicial, Method::kSupernodal}) {
      SparseCholesky cholesky(method);
      cholesky.analyze(system.H, system.dropped);
      SymmetricBlockMatrix H(system.H);
      for (int j = 0; j < H.size(); ++j) {
        for (auto s = H.begin(j); s < H.end(j); ++s) {
          Eigen::Map<Eigen::MatrixXd>(H.block(s), H.dim(H.row(s)), H.dim(j)) =
              dense.block(H.offset(H.row(s)), H.offset(j), H.dim(H.row(s)), H.dim(j));
        }
      }
      EXPECT_EQ(cholesky.factorize(H), bad);
      // And can be used again.
      ASSERT_EQ(cholesky.factorize(system.H), -1);
      const Eigen::VectorXd b = dice.matrix(good.rows(), 1);
      const Eigen::VectorXd x = cholesky.solve(b);
      EXPECT_LT((good(system.kept, system.kept) * x(system.kept) - b(system.kept)).norm(),
                1e-8 * b.norm());
    }
  }
}

}  // namespace
}  // namespace mapjoin
