#include "mapjoin/solvers/block_ordering.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <numeric>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "mapjoin/graph/error.h"
#include "mapjoin/solvers/nested_dissection.h"
#include "mapjoin/solvers/separator.h"
#include "mapjoin/solvers/symbolic_elimination.h"
#include "mapjoin/solvers/vertex_cut.h"
#include "tests/support/clique_problem.h"

namespace mapjoin {
namespace {

using testing_support::graph_of;
using testing_support::grid_problem;
using testing_support::random_problem;
using Problem = testing_support::CliqueProblem;
using Index = std::int32_t;

std::vector<Index> ordered(const Problem& problem, OrderingMethod method, int threads = 1) {
  WorkerPool pool(threads);
  return order_blocks(problem.dims(), problem.cliques(), {.method = method}, &pool);
}

/// Pairs of variables that are neighbours.
struct Links {
  std::vector<std::int64_t> start{0};
  std::vector<Index> vars;

  void add(Index a, Index b) {
    vars.insert(vars.end(), {a, b});
    start.push_back(static_cast<std::int64_t>(vars.size()));
  }
  Cliques cliques() const { return {start, vars}; }
};

double flops(const Problem& problem, OrderingMethod method) {
  return elimination_flops(problem.dims(), graph_of(problem), ordered(problem, method));
}

void expect_parted(const BlockGraph& graph, std::span<const Side> side) {
  for (Index v = 0; v < graph.size(); ++v) {
    if (side[v] != Side::kLeft) continue;
    for (const Index u : graph[v]) EXPECT_NE(side[u], Side::kRight) << v << " meets " << u;
  }
}

/// The size of a smallest cut among the variables at kCut, by trying all of their subsets.
int smallest_cut(const BlockGraph& graph, const std::vector<Side>& side) {
  std::vector<Index> band;
  for (Index v = 0; v < graph.size(); ++v) {
    if (side[v] == Side::kCut) band.push_back(v);
  }
  int least = static_cast<int>(band.size());
  for (unsigned kept = 0; kept < (1u << band.size()); ++kept) {
    // Everything that can be reached from the left without the kept ones.
    std::vector<char> removed(side.size(), 0), seen(side.size(), 0);
    for (std::size_t k = 0; k < band.size(); ++k) removed[band[k]] = (kept >> k & 1u) != 0;
    std::vector<Index> stack;
    for (Index v = 0; v < graph.size(); ++v) {
      if (side[v] == Side::kLeft) stack.push_back(v);
    }
    for (const Index v : stack) seen[v] = 1;
    bool parted = true;
    while (!stack.empty() && parted) {
      const Index v = stack.back();
      stack.pop_back();
      parted = side[v] != Side::kRight;
      for (const Index u : graph[v]) {
        if (seen[u] != 0 || removed[u] != 0) continue;
        seen[u] = 1;
        stack.push_back(u);
      }
    }
    if (parted) least = std::min(least, static_cast<int>(std::popcount(kept)));
  }
  return least;
}

TEST(BlockOrdering, ListsEachNeighbourOnce) {
  const std::vector<std::int64_t> start = {0, 2, 4, 7, 8};
  const std::vector<std::int32_t> vars = {0, 1, 1, 0, 0, 1, 3, 2};
  const BlockGraph graph = block_graph(4, {start, vars});
  EXPECT_EQ(graph.start, (std::vector<std::int32_t>{0, 2, 4, 4, 6}));
  EXPECT_EQ(graph.neighbours, (std::vector<std::int32_t>{1, 3, 0, 3, 0, 1}));
}

TEST(BlockOrdering, IsAPermutationForEveryMethod) {
  const Problem problem = random_problem(100, 130, 21);
  for (const OrderingMethod method :
       {OrderingMethod::kAutomatic, OrderingMethod::kMinimumDegree,
        OrderingMethod::kNestedDissection, OrderingMethod::kMetis, OrderingMethod::kNatural}) {
    auto order = order_blocks(problem.dims(), problem.cliques(), {.method = method});
    EXPECT_EQ(order, order_blocks(problem.dims(), problem.cliques(), {.method = method}));
    std::sort(order.begin(), order.end());
    for (int v = 0; v < 100; ++v) EXPECT_EQ(order[v], v);
  }
}

TEST(BlockOrdering, RefusesAVariableThatDoesNotExist) {
  const std::vector<std::int32_t> dims = {3, 3};
  const std::vector<std::int64_t> start = {0, 2};
  const std::vector<std::int32_t> vars = {0, 2};
  EXPECT_THROW(order_blocks(dims, {start, vars}), InputError);
}

TEST(ChainElimination, LeavesLoopsWithoutTheirChains) {
  // A loop of six with a tail of three, and a variable by itself.
  Links links;
  for (Index v = 0; v < 6; ++v) links.add(v, (v + 1) % 6);
  links.add(2, 6);
  links.add(6, 7);
  links.add(7, 8);
  const ReducedGraph reduced = eliminate_chains(block_graph(10, links.cliques()));
  EXPECT_EQ(reduced.variable.size(), 0u);  // a loop by itself is a chain too
  EXPECT_EQ(reduced.eliminated.size(), 10u);
}

TEST(ChainElimination, KeepsWhatHasThreeNeighboursAndTheLinksBetweenThem) {
  // K4 with a chain of two in each of its edges.
  Links links;
  Index next = 4;
  for (Index a = 0; a < 4; ++a) {
    for (Index b = a + 1; b < 4; ++b) {
      links.add(a, next);
      links.add(next, next + 1);
      links.add(next + 1, b);
      next += 2;
    }
  }
  const ReducedGraph reduced = eliminate_chains(block_graph(next, links.cliques()));
  EXPECT_EQ(reduced.variable, (std::vector<Index>{0, 1, 2, 3}));
  EXPECT_EQ(reduced.eliminated.size(), 12u);
  for (Index v = 0; v < 4; ++v) EXPECT_EQ(reduced.graph[v].size(), 3u);
}

TEST(VertexCut, IsOfTheSmallestSizeThereIs) {
  std::mt19937 random(3);
  for (int world = 0; world < 200; ++world) {
    const Problem problem =
        random_problem(20, 10 + world % 25, 100u + static_cast<unsigned>(world));
    const BlockGraph graph = graph_of(problem);
    // Random sides; what would join left and right goes to the band, up to eleven variables.
    std::vector<Side> side(20);
    for (Side& s : side) s = random() % 2 == 0 ? Side::kLeft : Side::kRight;
    for (Index v = 0; v < 20; ++v) {
      const bool meets = std::ranges::any_of(graph[v], [&](Index u) {
        return side[u] != Side::kCut && side[v] != Side::kCut && side[u] != side[v];
      });
      if (meets || random() % 5 == 0) side[v] = Side::kCut;
    }
    if (std::ranges::count(side, Side::kCut) > 12) continue;
    const int least = smallest_cut(graph, side);
    const std::vector<Side> before = side;
    VertexCut().shrink(graph, side);
    expect_parted(graph, side);
    EXPECT_EQ(std::ranges::count(side, Side::kCut), least) << "world " << world;
    for (int v = 0; v < 20; ++v) {
      if (before[v] != Side::kCut) {
        EXPECT_EQ(side[v], before[v]);
      }
    }
  }
}

/// Are clusters of connected variables, none empty, neighbours where their variables are?
void expect_clusters_of(const BlockGraph& graph, const Clusters& clusters) {
  ASSERT_EQ(clusters.of.size(), static_cast<std::size_t>(graph.size()));
  ASSERT_EQ(clusters.graph.size(), static_cast<Index>(clusters.size.size()));
  std::vector<Index> members(clusters.size.size(), 0);
  for (const Index c : clusters.of) ++members.at(static_cast<std::size_t>(c));
  EXPECT_EQ(members, clusters.size);
  EXPECT_EQ(std::ranges::count(members, 0), 0);
  for (Index v = 0; v < graph.size(); ++v) {
    for (const Index u : graph[v]) {
      const Index c = clusters.of[v], d = clusters.of[u];
      if (c != d) {
        EXPECT_EQ(std::ranges::count(clusters.graph[c], d), 1);
      }
    }
  }
}

TEST(Clusters, HoldAllVariablesAndMeetWhereTheseMeet) {
  const BlockGraph graph = graph_of(grid_problem(40, 30, 5));
  const Clusters clusters = grow_clusters(graph, 16);
  expect_clusters_of(graph, clusters);
  EXPECT_LE(std::ranges::max(clusters.size), 2 * 16);
  EXPECT_GE(clusters.size.size(), 1200u / 32);
}

TEST(Clusters, OfAPartAreThoseOfAllWithoutTheRest) {
  const BlockGraph graph = graph_of(grid_problem(40, 30, 6));
  const Clusters clusters = grow_clusters(graph, 16);
  std::vector<Index> number(1200, -1);
  Index next = 0;
  for (Index v = 0; v < 1200; ++v) {
    if (v % 40 < 17 && v % 7 != 0) number[v] = next++;
  }
  const BlockGraph part = part_of_graph(graph, number);
  ASSERT_EQ(part.size(), next);
  std::vector<Index> variable;
  for (Index v = 0; v < 1200; ++v) {
    if (number[v] >= 0) variable.push_back(v);
  }
  const Clusters of_part = clusters_of_part(clusters, number);
  expect_clusters_of(part, of_part);
  for (Index a = 0; a < next; ++a) {
    std::vector<Index> expected;
    for (const Index u : graph[variable[a]]) {
      if (number[u] >= 0) expected.push_back(number[u]);
    }
    EXPECT_TRUE(std::ranges::equal(part[a], expected));
    for (Index b = 0; b < next; ++b) {
      EXPECT_EQ(of_part.of[a] == of_part.of[b],
                clusters.of[variable[a]] == clusters.of[variable[b]]);
    }
  }
}

TEST(Separator, OfAGridIsAboutItsSide) {
  const Problem problem = grid_problem(60, 40, 1);
  const BlockGraph graph = graph_of(problem);
  SeparatorFinder finder;
  Clusters clusters;
  const auto side = finder.find(graph, clusters, 0);
  ASSERT_EQ(side.size(), 2400u);
  expect_parted(graph, side);
  EXPECT_LE(std::ranges::count(side, Side::kCut), 45);
  EXPECT_GE(std::ranges::count(side, Side::kLeft), 600);
  EXPECT_GE(std::ranges::count(side, Side::kRight), 600);
}

TEST(Separator, OfUnconnectedPiecesIsEmpty) {
  Links links;
  for (Index v = 0; v < 999; ++v) {
    if (v != 499) links.add(v, v + 1);
  }
  const BlockGraph graph = block_graph(1000, links.cliques());
  SeparatorFinder finder;
  Clusters clusters;
  const auto side = finder.find(graph, clusters, 0);
  ASSERT_EQ(side.size(), 1000u);
  expect_parted(graph, side);
  EXPECT_LE(std::ranges::count(side, Side::kCut), 1);
}

TEST(Separator, OfACliqueDoesNotExist) {
  std::vector<Index> vars(40);
  std::iota(vars.begin(), vars.end(), 0);
  const std::vector<std::int64_t> start = {0, 40};
  SeparatorFinder finder;
  Clusters clusters;
  EXPECT_TRUE(finder.find(block_graph(40, {start, vars}), clusters, 0).empty());
}

/// Streets: a grid of crossings whose links are chains of poses.
Problem streets(Index blocks, Index chain) {
  std::vector<std::pair<Index, Index>> links;
  Index next = blocks * blocks;
  const auto street = [&](Index a, Index b) {
    for (Index k = 0; k < chain; ++k) {
      links.emplace_back(a, next);
      a = next++;
    }
    links.emplace_back(a, b);
  };
  for (Index y = 0; y < blocks; ++y) {
    for (Index x = 0; x < blocks; ++x) {
      const Index v = y * blocks + x;
      if (x + 1 < blocks) street(v, v + 1);
      if (y + 1 < blocks) street(v, v + blocks);
      if (x + 1 < blocks && y + 1 < blocks && (x + y) % 3 == 0)
        links.emplace_back(v, v + blocks + 1);
    }
  }
  Problem problem(std::vector<Index>(static_cast<std::size_t>(next), 3));
  for (const auto& [a, b] : links) problem.add({a, b}, 3);
  return problem;
}

TEST(NestedDissection, MakesHardlyMoreWorkThanMetisAndLessThanMinimumDegree) {
  for (const Problem& problem : {grid_problem(150, 150, 5), streets(110, 2)}) {
    const double dissected = flops(problem, OrderingMethod::kNestedDissection);
    EXPECT_LT(dissected, 1.3 * flops(problem, OrderingMethod::kMetis));
    EXPECT_LT(dissected, 1.05 * flops(problem, OrderingMethod::kMinimumDegree));
  }
}

TEST(NestedDissection, IsTheSameForAnyNumberOfThreads) {
  const Problem problem = grid_problem(90, 90, 5);
  const std::vector<Index> order = ordered(problem, OrderingMethod::kNestedDissection);
  for (const int threads : {2, 3, 8})
    EXPECT_EQ(ordered(problem, OrderingMethod::kNestedDissection, threads), order);
}

TEST(NestedDissection, OrdersLongChainsAndLargeStarsAndCliques) {
  for (const bool star : {true, false}) {
    Links links;
    for (Index v = 1; v < 50000; ++v) links.add(star ? 0 : v - 1, v);
    for (Index v = 0; v < 1200; ++v) links.vars.push_back(v);  // larger than a small part
    links.start.push_back(static_cast<std::int64_t>(links.vars.size()));
    const std::vector<Index> dims(50000, 3);
    for (const OrderingMethod method :
         {OrderingMethod::kNestedDissection, OrderingMethod::kAutomatic}) {
      std::vector<Index> order = order_blocks(dims, links.cliques(), {.method = method});
      std::sort(order.begin(), order.end());
      for (Index v = 0; v < 50000; ++v) ASSERT_EQ(order[v], v);
    }
  }
}

TEST(BlockOrdering, DissectsWhereThatSavesWork) {
  for (const int side : {20, 60, 150}) {
    const Problem problem = grid_problem(side, side, 5);
    const double quick = flops(problem, OrderingMethod::kMinimumDegree);
    const double dissected = flops(problem, OrderingMethod::kNestedDissection);
    const double chosen = flops(problem, OrderingMethod::kAutomatic);
    // Minimum degree after its chains breaks ties in another way, for better or worse.
    EXPECT_LE(chosen, 1.1 * std::min(quick, dissected));
    if (side == 150) {
      EXPECT_EQ(chosen, dissected);
    }
  }
}

/// Poses that drive to and fro through a strip of features and see all those around.
Problem features_along_a_strip(Index poses, Index features, Index range) {
  std::vector<Index> dims(static_cast<std::size_t>(poses), 3);
  dims.resize(static_cast<std::size_t>(poses + features), 2);
  Problem problem(dims);
  for (Index k = 0; k + 1 < poses; ++k) problem.add({k, k + 1}, 3);
  for (Index k = 0; k < poses; ++k) {
    const Index lap = 2 * poses / 3;  // there, back, and half way there again
    const Index along = std::abs((k + lap / 2) % lap - lap / 2) * 2 * features / lap;
    const Index first = std::max(Index{0}, along - range);
    const Index last = std::min(features, along + range);
    for (Index f = first + k % 2; f < last; f += 2) problem.add({k, poses + f}, 3);
  }
  return problem;
}

TEST(Hubs, AreFeaturesThatManyPosesSee) {
  EXPECT_TRUE(has_hubs(graph_of(features_along_a_strip(600, 40, 3))));
  EXPECT_FALSE(has_hubs(graph_of(grid_problem(20, 20, 5))));
  Links all;
  for (Index v = 0; v < 30; ++v) {
    for (Index u = 0; u < v; ++u) all.add(u, v);
  }
  EXPECT_FALSE(has_hubs(block_graph(30, all.cliques())));
  EXPECT_FALSE(has_hubs(block_graph(3, Links().cliques())));
}

TEST(BlockOrdering, DissectsAmongHubsAtLittleCost) {
  const Problem problem = features_along_a_strip(6000, 200, 4);
  const std::vector<Index> order = ordered(problem, OrderingMethod::kAutomatic);
  for (const int threads : {2, 3})
    EXPECT_EQ(ordered(problem, OrderingMethod::kAutomatic, threads), order);
  EXPECT_LT(flops(problem, OrderingMethod::kAutomatic),
            1.2 * flops(problem, OrderingMethod::kMinimumDegree));
}

}  // namespace
}  // namespace mapjoin
