#include "mapjoin/solvers/frontal_cholesky.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cstdint>
#include <limits>
#include <numeric>
#include <random>
#include <set>
#include <vector>

#include "mapjoin/graph/error.h"
#include "mapjoin/solvers/front_layout.h"
#include "tests/support/clique_problem.h"
#include "tests/support/dense.h"

namespace mapjoin {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

using testing_support::analyze;
using testing_support::graph_of;
using testing_support::grid_problem;
using testing_support::random_dims;
using testing_support::random_problem;
using Problem = testing_support::CliqueProblem;

VectorXd solve(const Problem& problem, const FrontalStructure& structure, int threads = 1) {
  WorkerPool pool(threads);
  FrontalCholesky cholesky;
  EXPECT_TRUE(cholesky.factorize(structure, problem.assembler(structure), pool).ok());
  VectorXd x(problem.scalars());
  cholesky.solve(x, pool);
  return x;
}

void expect_solves(const Problem& problem, const FrontalStructure& structure) {
  const VectorXd x = solve(problem, structure);
  const MatrixXd h = problem.dense();
  const VectorXd expected = test::dense_solve(h, problem.dense_rhs());
  EXPECT_LT((x - expected).norm(), 1e-9 * expected.norm());
}

TEST(FrontalCholesky, AgreesWithDenseCholeskyOnRandomGraphsOfMixedDimensions) {
  for (unsigned seed = 1; seed <= 60; ++seed) {
    const int variables = 1 + static_cast<int>(seed * seed % 97);
    const Problem problem =
        random_problem(variables, static_cast<int>(seed % 7) * variables / 3, seed);
    SCOPED_TRACE(seed);
    expect_solves(problem, analyze(problem));
  }
}

TEST(FrontalCholesky, AgreesWithDenseCholeskyForEveryOrderingAndWithoutMerging) {
  const Problem problem = random_problem(80, 120, 7);
  for (const OrderingMethod method :
       {OrderingMethod::kAutomatic, OrderingMethod::kMinimumDegree,
        OrderingMethod::kNestedDissection, OrderingMethod::kNatural}) {
    for (const bool merge : {false, true}) {
      MergingOptions merging;
      merging.merge_fronts = merge;
      expect_solves(problem, analyze(problem, {.method = method}, merging));
    }
  }
}

TEST(FrontalCholesky, AgreesWithDenseCholeskyOnFrontsWiderThanABlockOfPivots) {
  for (const int dim : {1, 2, 3, 6}) {
    const Problem problem = random_problem(60, 400, 3, std::vector<std::int32_t>(60, dim));
    expect_solves(problem, analyze(problem));
  }
}

TEST(FrontalCholesky, SolvesASingleVariable) {
  for (int dim = 1; dim <= 9; ++dim) {
    Problem problem({dim});
    problem.add_full({0});
    expect_solves(problem, analyze(problem));
  }
}

TEST(FrontalCholesky, AcceptsAnEmptyProblem) {
  const Problem problem(std::vector<std::int32_t>{});
  EXPECT_EQ(solve(problem, analyze(problem), 2).size(), 0);
}

TEST(FrontalCholesky, SolvesDisconnectedGraphs) {
  Problem problem(random_dims(60, 5));
  for (int component = 0; component < 12; ++component) {
    for (int i = 0; i < 5; ++i) problem.add_full({component * 5 + i});
    for (int i = 1; i < 5; ++i) problem.add({component * 5 + i - 1, component * 5 + i}, 3);
  }
  expect_solves(problem, analyze(problem));
}

TEST(FrontalCholesky, GivesTheSameBitsForAnyNumberOfThreads) {
  for (const Problem& problem :
       {grid_problem(60, 60, 3), grid_problem(30, 30, 6), random_problem(150, 900, 2)}) {
    const FrontalStructure structure = analyze(problem);
    const VectorXd one = solve(problem, structure, 1);
    for (const int threads : {2, 3, 5}) {
      for (int repeat = 0; repeat < 5; ++repeat)
        ASSERT_EQ(one, solve(problem, structure, threads)) << threads;
    }
  }
}

TEST(FrontalCholesky, AnalysesTheSameOnAnyNumberOfThreads) {
  for (const Problem& problem : {grid_problem(40, 40, 3), random_problem(150, 900, 2)}) {
    const FrontalStructure one = analyze(problem);  // from the cliques' stars alone
    const BlockGraph graph = graph_of(problem);
    const auto order = order_blocks(problem.dims(), graph);
    for (const int threads : {1, 2, 3}) {
      WorkerPool pool(threads);
      const FrontalStructure s =
          mapjoin::analyze(problem.dims(), problem.cliques(), graph, order, &pool);
      EXPECT_EQ(s.order, one.order);
      EXPECT_EQ(s.updates, one.updates);
      EXPECT_EQ(s.owned, one.owned);
      EXPECT_EQ(s.clique_row, one.clique_row);
      ASSERT_EQ(s.runs.size(), one.runs.size());
      for (std::size_t r = 0; r < s.runs.size(); ++r) {
        EXPECT_EQ(s.runs[r].from, one.runs[r].from);
        EXPECT_EQ(s.runs[r].to, one.runs[r].to);
        EXPECT_EQ(s.runs[r].length, one.runs[r].length);
      }
      ASSERT_EQ(s.fronts.size(), one.fronts.size());
      for (std::size_t f = 0; f < s.fronts.size(); ++f) {
        EXPECT_EQ(s.fronts[f].panel, one.fronts[f].panel);
        EXPECT_EQ(s.fronts[f].update, one.fronts[f].update);
        EXPECT_EQ(s.run_range[f].begin, one.run_range[f].begin);
      }
      EXPECT_EQ(s.tasks.size(), one.tasks.size());
    }
  }
}

/// First front of the subtree of each front.
std::vector<std::int32_t> subtree_begins(const FrontalStructure& structure) {
  std::vector<std::int32_t> begin(structure.fronts.size());
  for (std::int32_t f = 0; f < static_cast<std::int32_t>(begin.size()); ++f) {
    const auto children = structure.children_of(f);
    begin[static_cast<std::size_t>(f)] =
        children.empty() ? f : begin[static_cast<std::size_t>(children.front())];
  }
  return begin;
}

TEST(FrontalCholesky, HasSubtreesMadeOfWholeTasksThatWaitForTheirOwnChildrenAlone) {
  const Problem problem = grid_problem(60, 60, 3);
  const FrontalStructure structure = analyze(problem);
  const auto begin = subtree_begins(structure);
  int with_several = 0;
  for (std::int32_t root = 0; root < static_cast<std::int32_t>(begin.size()); ++root) {
    const std::int32_t first = begin[static_cast<std::size_t>(root)];
    const std::vector<FrontTask> tasks = tasks_of_subtree(structure, first, root);
    with_several += tasks.size() > 1 ? 1 : 0;
    std::int32_t next = first;
    std::vector<int> waits_for(tasks.size(), 0);
    for (std::size_t t = 0; t < tasks.size(); ++t) {
      EXPECT_EQ(tasks[t].begin, next);
      next = tasks[t].end;
      if (t + 1 == tasks.size()) {
        EXPECT_EQ(tasks[t].parent, -1);
        continue;
      }
      const std::int32_t above = structure.fronts[tasks[t].end - 1].parent;
      ASSERT_GT(tasks[t].parent, static_cast<std::int32_t>(t));
      ASSERT_LT(tasks[t].parent, static_cast<std::int32_t>(tasks.size()));
      const FrontTask& parent = tasks[static_cast<std::size_t>(tasks[t].parent)];
      EXPECT_TRUE(parent.begin <= above && above < parent.end);
      ++waits_for[static_cast<std::size_t>(tasks[t].parent)];
    }
    EXPECT_EQ(next, root + 1);
    for (std::size_t t = 0; t < tasks.size(); ++t) EXPECT_EQ(tasks[t].waits_for, waits_for[t]);
  }
  EXPECT_GT(with_several, 10);
}

TEST(FrontalCholesky, FactorizesEverySubtreeToTheSameBitsOnAnyNumberOfThreads) {
  const Problem problem = grid_problem(40, 40, 3);
  const FrontalStructure structure = analyze(problem);
  const auto begin = subtree_begins(structure);
  WorkerPool alone;
  WorkerPool three(3);
  for (std::int32_t root = 0; root < static_cast<std::int32_t>(begin.size()); ++root) {
    const std::int32_t first = begin[static_cast<std::size_t>(root)];
    if (root - first < 20 || structure.fronts[static_cast<std::size_t>(root)].parent < 0) continue;
    std::vector<std::vector<double>> x;
    std::vector<double> decrease;
    for (WorkerPool* pool : {&alone, &three}) {
      FrontalCholesky cholesky;
      cholesky.reserve(structure);
      ASSERT_TRUE(
          cholesky.factorize_subtree(structure, first, root, problem.assembler(structure), *pool)
              .ok());
      x.emplace_back(static_cast<std::size_t>(problem.scalars()), 0.0);
      decrease.push_back(0.0);
      const std::vector<std::int32_t> held{0, 1, 2};
      ASSERT_TRUE(cholesky.close_subtree(first, root, held, x.back(), decrease.back(), *pool));
    }
    EXPECT_EQ(x[0], x[1]);
    EXPECT_EQ(decrease[0], decrease[1]);
  }
}

TEST(FrontalCholesky, FactorizesAgainWithTheSameStructure) {
  const Problem problem = grid_problem(20, 20, 3);
  const FrontalStructure structure = analyze(problem);
  WorkerPool pool(2);
  FrontalCholesky cholesky;
  VectorXd first(problem.scalars());
  ASSERT_TRUE(cholesky.factorize(structure, problem.assembler(structure), pool).ok());
  cholesky.solve(first, pool);
  const Problem other = grid_problem(20, 20, 3, 2);
  VectorXd x(problem.scalars());
  ASSERT_TRUE(cholesky.factorize(structure, other.assembler(structure), pool).ok());
  cholesky.solve(x, pool);
  EXPECT_LT((other.dense() * x - other.dense_rhs()).norm(), 1e-8);
  ASSERT_TRUE(cholesky.factorize(structure, problem.assembler(structure), pool).ok());
  cholesky.solve(x, pool);
  EXPECT_EQ(x, first);
}

// Two systems of one pattern: the matrix of the first, then the right-hand side of the second.
TEST(FrontalCholesky, EliminatesAnotherRightHandSideWithTheFactorThereIs) {
  for (unsigned seed = 1; seed <= 12; ++seed) {
    SCOPED_TRACE(seed);
    const int size = 3 + static_cast<int>(seed);
    const int dim = 1 + static_cast<int>(seed % 9);
    const Problem problem = grid_problem(size, 2 * size, dim, seed);
    const Problem other = grid_problem(size, 2 * size, dim, seed + 100);
    const FrontalStructure structure = analyze(problem);
    const VectorXd b = other.dense_rhs();
    const VectorXd expected = test::dense_solve(problem.dense(), b);
    VectorXd first;
    for (const int threads : {1, 2, 3}) {
      WorkerPool pool(threads);
      FrontalCholesky cholesky;
      ASSERT_TRUE(cholesky.factorize(structure, problem.assembler(structure), pool).ok());
      VectorXd x(problem.scalars());
      for (int repeat = 0; repeat < 2; ++repeat) {  // nothing is used up
        EXPECT_TRUE(cholesky.eliminate(other.rhs_assembler(structure), pool));
        cholesky.solve(x, pool);
        EXPECT_LT((x - expected).norm(), 1e-9 * expected.norm());
        EXPECT_NEAR(cholesky.squared_norm_of_y(), b.dot(expected), 1e-9 * b.dot(expected));
        if (first.size() == 0) first = x;
        EXPECT_EQ(x, first);
      }
    }
  }
}

TEST(FrontalCholesky, GivesUpARightHandSideThatPromisesMoreThanAsked) {
  const Problem problem = grid_problem(40, 40, 3, 1);
  const FrontalStructure structure = analyze(problem);
  for (const int threads : {1, 2, 3}) {
    WorkerPool pool(threads);
    FrontalCholesky cholesky;
    ASSERT_TRUE(cholesky.factorize(structure, problem.assembler(structure), pool).ok());
    const double all = cholesky.squared_norm_of_y();
    int fronts = 0;  // of one thread
    const auto eliminate = [&](double most) {
      fronts = 0;
      const auto rhs = problem.rhs_assembler(structure);
      return cholesky.eliminate(
          [&](std::int32_t front, double* to, double* room) {
            if (threads == 1) ++fronts;
            rhs(front, to, room);
          },
          pool, most);
    };
    EXPECT_TRUE(eliminate((1.0 + 1e-9) * all));
    EXPECT_NEAR(cholesky.squared_norm_of_y(), all, 1e-9 * all);
    EXPECT_FALSE(eliminate((1.0 - 1e-6) * all));
    EXPECT_FALSE(eliminate(0.1 * all));
    if (threads == 1) {
      EXPECT_LT(fronts, static_cast<int>(structure.fronts.size()));
    }
    EXPECT_FALSE(eliminate(std::numeric_limits<double>::quiet_NaN()));
  }
}

TEST(FrontalCholesky, SolvesForSeveralRightHandSides) {
  const Problem problem = random_problem(70, 150, 11);
  const FrontalStructure structure = analyze(problem);
  FrontalCholesky cholesky;
  ASSERT_TRUE(cholesky.factorize(structure, problem.assembler(structure)).ok());
  const MatrixXd b = MatrixXd::Random(problem.scalars(), 5);
  MatrixXd x = b;
  cholesky.solve_in_place(x);
  EXPECT_LT((problem.dense() * x - b).norm(), 1e-8 * b.norm());
}

TEST(FrontalCholesky, ReportsDeterminantAndDecrease) {
  const Problem problem = random_problem(30, 40, 4);
  const FrontalStructure structure = analyze(problem);
  FrontalCholesky cholesky;
  ASSERT_TRUE(cholesky.factorize(structure, problem.assembler(structure)).ok());
  const MatrixXd h = problem.dense();
  const VectorXd b = problem.dense_rhs();
  EXPECT_NEAR(cholesky.log_determinant(),
              2 * h.llt().matrixL().toDenseMatrix().diagonal().array().log().sum(), 1e-8);
  EXPECT_NEAR(cholesky.squared_norm_of_y(), b.dot(test::dense_solve(h, b).col(0)),
              1e-8 * b.squaredNorm());
}

TEST(FrontalCholesky, ConditionalsAreTheColumnsOfTheFactor) {
  const Problem problem = random_problem(40, 60, 9);
  const FrontalStructure structure = analyze(problem);
  FrontalCholesky cholesky;
  ASSERT_TRUE(cholesky.factorize(structure, problem.assembler(structure)).ok());
  MatrixXd l = MatrixXd::Zero(problem.scalars(), problem.scalars());
  for (std::int32_t f = 0; f < static_cast<std::int32_t>(structure.fronts.size()); ++f) {
    const Front& front = structure.fronts[f];
    const FrontConditional conditional = cholesky.conditional(f);
    l.block(front.first_scalar, front.first_scalar, front.pivot_dim, front.pivot_dim) =
        conditional.l11.triangularView<Eigen::Lower>();
    int row = 0;
    for (const auto k : structure.updates_of(f)) {
      const int dim = structure.dims[structure.order[k]];
      l.block(structure.scalar_at[k], front.first_scalar, dim, front.pivot_dim) =
          conditional.l21.middleRows(row, dim);
      row += dim;
    }
  }
  MatrixXd permuted(problem.scalars(), problem.scalars());  // rows of H in elimination order
  std::vector<int> scalar;
  for (const auto v : structure.order) {
    for (int i = 0; i < structure.dims[v]; ++i) scalar.push_back(structure.scalar_of[v] + i);
  }
  const MatrixXd h = problem.dense();
  EXPECT_LT((l * l.transpose() - MatrixXd(h(scalar, scalar))).norm(), 1e-10 * h.norm());
}

TEST(FrontalCholesky, NamesAVariableThatIsNotDetermined) {
  for (const int threads : {1, 2}) {
    Problem problem(std::vector<std::int32_t>(50, 3));
    for (int v = 0; v < 50; ++v) {
      if (v != 17) problem.add_full({v});
      if (v > 0 && v != 17 && v != 18) problem.add({v - 1, v}, 3);
    }
    problem.add({17}, 2);  // two rows for three unknowns
    const FrontalStructure structure = analyze(problem);
    WorkerPool pool(threads);
    FrontalCholesky cholesky;
    EXPECT_EQ(cholesky.factorize(structure, problem.assembler(structure), pool).failed_variable,
              17);
  }
}

TEST(FrontalCholesky, NamesAVariableNoMeasurementTouches) {
  Problem problem({3, 2, 3});
  problem.add_full({0, 2});
  const FrontalStructure structure = analyze(problem);
  FrontalCholesky cholesky;
  EXPECT_EQ(cholesky.factorize(structure, problem.assembler(structure)).failed_variable, 1);
}

TEST(FrontalCholesky, FindsASystemWithoutAnchorSingular) {
  // Differences only: a constant added to all variables changes nothing.
  const int n = 200;
  Problem problem(std::vector<std::int32_t>(n, 1));
  const MatrixXd difference = (MatrixXd(2, 2) << 1, -1, -1, 1).finished();
  for (int v = 0; v < n; ++v) problem.add({v, (v + 1) % n}, difference / 3, VectorXd::Zero(2));
  for (int v = 0; v < n; v += 7)
    problem.add({v, (v * v + 3) % n}, difference / 7, VectorXd::Zero(2));
  for (const int threads : {1, 2}) {
    const FrontalStructure structure = analyze(problem);
    WorkerPool pool(threads);
    FrontalCholesky cholesky;
    EXPECT_EQ(cholesky.factorize(structure, problem.assembler(structure), pool).failed_variable,
              structure.order.back());
  }
}

TEST(FrontalCholesky, FindsAnIndefiniteSystemAndRecoversWithTheNext) {
  Problem problem = random_problem(30, 40, 3, std::vector<std::int32_t>(30, 3));
  const FrontalStructure good_structure = analyze(problem);
  FrontalCholesky cholesky;
  Problem bad = problem;
  bad.add({12}, -1e4 * MatrixXd::Identity(3, 3), VectorXd::Zero(3));
  const FrontalStructure bad_structure = analyze(bad);
  EXPECT_FALSE(cholesky.factorize(bad_structure, bad.assembler(bad_structure)).ok());
  ASSERT_TRUE(cholesky.factorize(good_structure, problem.assembler(good_structure)).ok());
  VectorXd x(problem.scalars());
  cholesky.solve(x);
  EXPECT_LT((problem.dense() * x - problem.dense_rhs()).norm(), 1e-8);
}

TEST(FrontalCholesky, FailsOnNotANumber) {
  Problem problem = random_problem(20, 10, 3);
  problem.add({4}, MatrixXd::Constant(problem.dims()[4], problem.dims()[4], std::nan("")),
              VectorXd::Zero(problem.dims()[4]));
  const FrontalStructure structure = analyze(problem);
  FrontalCholesky cholesky;
  EXPECT_FALSE(cholesky.factorize(structure, problem.assembler(structure)).ok());
}

// Measurements x_0 = 0, x_{i+1} - x_i = 1 and x_i = i of a million variables: the tree may be as
// deep as the chain is long.
TEST(FrontalCholesky, SolvesAChainOfAMillionVariablesInAnyOrder) {
  const int n = 1000000;
  const std::vector<std::int32_t> dims(n, 1);
  std::vector<std::int64_t> start = {0, 1};
  std::vector<std::int32_t> vars = {0};
  for (int v = 1; v < n; ++v) {
    vars.insert(vars.end(), {v - 1, v});
    start.push_back(static_cast<std::int64_t>(vars.size()));
  }
  const Cliques cliques{start, vars};
  for (const bool natural : {true, false}) {
    const auto order = order_blocks(
        dims, cliques,
        {.method = natural ? OrderingMethod::kNatural : OrderingMethod::kMinimumDegree});
    const FrontalStructure structure = mapjoin::analyze(dims, cliques, order);
    const auto assemble = [&](std::int32_t front, const FrontView& view) {
      for (const std::int64_t k : structure.owned_by(front)) {
        const auto at = structure.clique_rows(k);
        if (k == 0) {
          view.add(at[0], at[0], Eigen::Matrix<double, 1, 1>(1));
          continue;
        }
        view.add(at[0], at[0], Eigen::Matrix<double, 1, 1>(1));
        view.add(at[1], at[1], Eigen::Matrix<double, 1, 1>(2));
        view.add(at[1], at[0], Eigen::Matrix<double, 1, 1>(-1));
        view.rhs(at[1]) += 1 + static_cast<double>(k);
        view.rhs(at[0]) -= 1;
      }
    };
    WorkerPool pool(2);
    FrontalCholesky cholesky;
    ASSERT_TRUE(cholesky.factorize(structure, assemble, pool).ok());
    VectorXd x(n);
    cholesky.solve(x, pool);
    for (const int v : {0, 1, n / 2, n - 1}) EXPECT_NEAR(x[v], v, 1e-6);
  }
}

TEST(FrontalCholesky, OnDiskIsTheSameBits) {
  const Problem problem = grid_problem(60, 60, 6);
  const FrontalStructure structure = analyze(problem);
  ASSERT_GT(structure.statistics.factor_bytes, 8 << 20);  // several portions
  const VectorXd expected = solve(problem, structure);
  for (const int threads : {1, 2}) {
    for (const std::int64_t resident : {0, 4 << 20}) {
      FrontalCholesky cholesky({.residence = {.bytes = resident, .directory = {}}});
      WorkerPool pool(threads);
      VectorXd x(problem.scalars());
      for (int repetition = 0; repetition < 2; ++repetition) {
        ASSERT_TRUE(cholesky.factorize(structure, problem.assembler(structure), pool).ok());
        cholesky.solve(x, pool);
        EXPECT_EQ(x, expected);
      }
    }
  }
}

TEST(FrontalCholesky, SaysWhereItCannotWriteAFactor) {
  const Problem problem = grid_problem(5, 5, 3);
  const FrontalStructure structure = analyze(problem);
  FrontalCholesky cholesky({.residence = {.bytes = 0, .directory = "/nowhere/at/all"}});
  try {
    cholesky.factorize(structure, problem.assembler(structure));
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("/nowhere/at/all"));
  }
}

TEST(Fronts, RefuseAnOrderThatIsNotAPermutation) {
  const Problem problem = random_problem(4, 3, 1);
  EXPECT_THROW(
      mapjoin::analyze(problem.dims(), problem.cliques(), std::vector<std::int32_t>{0, 1, 1, 3}),
      InputError);
  EXPECT_THROW(
      mapjoin::analyze(problem.dims(), problem.cliques(), std::vector<std::int32_t>{0, 1, 2}),
      InputError);
}

// By brute force: eliminate block by block and record which later blocks are coupled.
TEST(Fronts, WithoutMergingHoldExactlyTheFill) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const Problem problem = random_problem(50, 60, seed);
    MergingOptions merging;
    merging.merge_fronts = false;
    const FrontalStructure s = analyze(problem, {}, merging);
    std::vector<std::set<int>> later(50);
    for (std::int64_t k = 0; k < problem.cliques().size(); ++k) {
      for (const auto u : problem.cliques()[k]) {
        for (const auto v : problem.cliques()[k]) {
          if (s.position[u] < s.position[v]) later[s.position[u]].insert(s.position[v]);
        }
      }
    }
    for (int k = 0; k < 50; ++k) {
      for (const int i : later[k]) later[i].insert(later[k].upper_bound(i), later[k].end());
    }
    for (std::int32_t f = 0; f < static_cast<std::int32_t>(s.fronts.size()); ++f) {
      const Front& front = s.fronts[f];
      for (int k = front.first_position; k < front.end_position; ++k) {
        std::set<int> expected;
        for (int i = k + 1; i < front.end_position; ++i) expected.insert(i);
        for (const int i : s.updates_of(f)) expected.insert(i);
        EXPECT_EQ(later[k], expected);
      }
    }
  }
}

}  // namespace
}  // namespace mapjoin
