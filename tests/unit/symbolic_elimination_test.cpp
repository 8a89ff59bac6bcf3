#include "mapjoin/solvers/symbolic_elimination.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>
#include <set>
#include <vector>

#include "mapjoin/solvers/block_ordering.h"
#include "mapjoin/solvers/fronts.h"
#include "tests/support/clique_problem.h"

namespace mapjoin {
namespace {

using testing_support::analyze;
using testing_support::graph_of;
using testing_support::grid_problem;
using testing_support::random_problem;
using Index = std::int32_t;
using Problem = testing_support::CliqueProblem;

std::vector<Index> shuffled(Index size, unsigned seed) {
  std::vector<Index> order(static_cast<std::size_t>(size));
  std::iota(order.begin(), order.end(), 0);
  std::shuffle(order.begin(), order.end(), std::mt19937(seed));
  return order;
}

/// By brute force: the later positions each one is coupled with when it is eliminated.
std::vector<std::set<Index>> patterns(const BlockGraph& graph, const std::vector<Index>& position,
                                      Index eliminated) {
  std::vector<std::set<Index>> later(position.size());
  for (Index v = 0; v < graph.size(); ++v) {
    for (const Index u : graph[v]) {
      if (position[v] < eliminated && position[v] < position[u])
        later[position[v]].insert(position[u]);
    }
  }
  for (Index p = 0; p < eliminated; ++p) {
    for (const Index u : later[p]) {
      if (u < eliminated) later[u].insert(later[p].upper_bound(u), later[p].end());
    }
  }
  return later;
}

/// Every position has the pattern that its supernode says, and trees hang together as they should.
void expect_is(const SupernodeTree& tree, const std::vector<std::set<Index>>& expected,
               const Problem& problem, const std::vector<Index>& order, Index eliminated) {
  std::vector<std::set<Index>> left(static_cast<std::size_t>(tree.size()));  // of each supernode
  for (Index s = 0; s < tree.size(); ++s) {
    Index dim = 0;
    tree.for_each_update(s, [&](Index u) {
      EXPECT_TRUE(left[s].insert(u).second) << "twice";
      dim += problem.dims()[order[u]];
    });
    EXPECT_EQ(tree.update_blocks[s], static_cast<Index>(left[s].size()));
    EXPECT_EQ(tree.update_dim[s], dim);
    const bool is_root = left[s].empty() || *left[s].begin() >= eliminated;
    EXPECT_EQ(tree.parent[s], is_root ? -1 : tree.of[*left[s].begin()]);
    if (!is_root) {
      EXPECT_GT(tree.parent[s], s);
    }
  }
  std::vector<Index> pivot_dim(left.size(), 0);
  for (Index p = static_cast<Index>(order.size()); p-- > 0;) {
    const Index s = tree.of[p];
    pivot_dim[s] += problem.dims()[order[p]];
    EXPECT_LE(p, tree.last[s]);
    EXPECT_EQ(left[s], expected[p]) << p;
    left[s].insert(p);
  }
  EXPECT_EQ(tree.pivot_dim, pivot_dim);
}

TEST(SymbolicElimination, FindsThePatternsThatEliminationMakes) {
  for (unsigned seed = 1; seed <= 40; ++seed) {
    SCOPED_TRACE(seed);
    const auto variables = static_cast<int>(1 + seed * seed % 71);
    const Problem problem = random_problem(variables, static_cast<int>(seed % 5) * variables, seed);
    const BlockGraph graph = graph_of(problem);
    for (const std::vector<Index>& order :
         {shuffled(variables, seed), order_blocks(problem.dims(), graph)}) {
      const std::vector<Index> position = inverse_permutation(order);
      for (const Index eliminated : {variables, variables / 2, 0}) {
        expect_is(eliminate_symbolically(problem.dims(), graph, order, position, eliminated),
                  patterns(graph, position, eliminated), problem, order, eliminated);
      }
    }
  }
}

TEST(SymbolicElimination, MakesTheSameOfStarsAsOfAllLinks) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const Problem problem = random_problem(40, 90, seed);
    const std::vector<Index> order = shuffled(40, seed);
    const std::vector<Index> position = inverse_permutation(order);
    const BlockGraph stars = star_graph(position, problem.cliques());
    expect_is(eliminate_symbolically(problem.dims(), stars, order, position),
              patterns(graph_of(problem), position, 40), problem, order, 40);
  }
}

TEST(SymbolicElimination, OfAMillionPosesInALineNeedsNoStack) {
  constexpr Index kPoses = 1000000;
  BlockGraph line;
  for (Index v = 0; v < kPoses; ++v) {
    if (v > 0) line.neighbours.push_back(v - 1);
    if (v + 1 < kPoses) line.neighbours.push_back(v + 1);
    line.end_row();
  }
  std::vector<Index> order(kPoses);
  std::iota(order.begin(), order.end(), 0);
  const SupernodeTree tree =
      eliminate_symbolically(std::vector<Index>(kPoses, 3), line, order, order);
  // Each pose is coupled with the next one alone; the last two are one supernode.
  ASSERT_EQ(tree.size(), kPoses - 1);
  EXPECT_EQ(tree.parent.front(), 1);
  EXPECT_EQ(tree.pivot_dim.back(), 6);
}

TEST(EliminationFlops, AreThoseOfTheDenseFactorizationWhereAllIsCoupled) {
  const std::vector<std::int32_t> dims = {3, 2, 6, 1};
  const std::vector<std::int64_t> start = {0, 4};
  const std::vector<std::int32_t> vars = {0, 1, 2, 3};
  for (const std::vector<std::int32_t>& order :
       {std::vector<std::int32_t>{0, 1, 2, 3}, std::vector<std::int32_t>{2, 0, 3, 1}}) {
    EXPECT_EQ(elimination_flops(dims, block_graph(4, {start, vars}), order),
              12.0 * 13.0 * 25.0 / 6.0);
  }
}

TEST(EliminationFlops, AreThoseOfFrontsThatStoreNoZeros) {
  const Problem problem = grid_problem(20, 30, 3);
  const double fronts = analyze(problem, {}, {.merge_fronts = false, .cost = {}}).statistics.flops;
  const BlockGraph graph = graph_of(problem);
  const double counted =
      elimination_flops(problem.dims(), graph, order_blocks(problem.dims(), graph));
  EXPECT_LT(counted, fronts);  // which eliminate the right-hand side as well
  EXPECT_GT(counted, 0.9 * fronts);
}

}  // namespace
}  // namespace mapjoin
