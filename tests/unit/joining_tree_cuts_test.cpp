#include "mapjoin/joining/tree_cuts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <numeric>
#include <vector>

#include "mapjoin/joining/report.h"
#include "mapjoin/joining/tree_walk.h"
#include "mapjoin/solvers/block_ordering.h"
#include "tests/support/clique_problem.h"

namespace mapjoin {
namespace {

using testing_support::CliqueProblem;

/// A line of poses with a closure every ten: most of it hangs on one path of the tree.
CliqueProblem line(int poses) {
  CliqueProblem out(std::vector<std::int32_t>(static_cast<std::size_t>(poses), 3));
  for (std::int32_t k = 0; k + 1 < poses; ++k) out.add({k, k + 1}, 3);
  for (std::int32_t k = 0; k + 37 < poses; k += 10) out.add({k, k + 37}, 3);
  return out;
}

std::vector<std::int64_t> sizes(int leaf, int arity, const CliqueProblem& problem) {
  JoinOptions options;
  options.leaf_variables = leaf;
  options.arity = arity;
  return submap_sizes(options, static_cast<std::int64_t>(problem.dims().size()));
}

struct SampleOfCuts {
  explicit SampleOfCuts(const CliqueProblem& problem, int leaf, int arity, int threads = 1)
      : observations(problem.cliques().size()),
        structure(analyze(problem.dims(), problem.cliques(),
                          order_blocks(problem.dims(), problem.cliques()))),
        cuts(cut_tree(structure, observations, sizes(leaf, arity, problem))),
        plan(plan_cuts(structure, cuts, threads)) {}
  std::int64_t observations;
  FrontalStructure structure;
  std::vector<Cut> cuts;
  CutPlan plan;
};

std::vector<SampleOfCuts> samples() {
  std::vector<SampleOfCuts> out;
  for (const int leaf : {4, 32, 100000}) {
    out.emplace_back(line(1500), leaf, 16);
    out.emplace_back(testing_support::grid_problem(25, 25, 3), leaf, 4);
  }
  return out;
}

TEST(TreeCuts, HaveEveryObservationOnce) {
  for (const SampleOfCuts& s : samples()) {
    std::vector<std::int64_t> all;
    for (const Cut& cut : s.cuts) {
      for (const auto& group : cut.groups) {
        EXPECT_FALSE(group.empty());
        all.insert(all.end(), group.begin(), group.end());
      }
    }
    std::sort(all.begin(), all.end());
    std::vector<std::int64_t> expected(static_cast<std::size_t>(s.observations));
    std::iota(expected.begin(), expected.end(), 0);
    EXPECT_EQ(all, expected);
  }
}

TEST(TreeCuts, AreSubtreesWithinTheSubtreeOfTheirParent) {
  for (const SampleOfCuts& s : samples()) {
    for (std::size_t c = 0; c < s.cuts.size(); ++c) {
      const Cut& cut = s.cuts[c];
      for (std::int32_t f = cut.first; f < cut.root; ++f) {
        EXPECT_LE(s.structure.fronts[f].parent, cut.root);
        EXPECT_GE(s.structure.fronts[f].parent, cut.first);
      }
      for (const std::int32_t child : cut.children) {
        const Cut& below = s.cuts[static_cast<std::size_t>(child)];
        EXPECT_LT(static_cast<std::size_t>(child), c);
        EXPECT_EQ(below.parent, static_cast<std::int32_t>(c));
        EXPECT_GE(below.first, cut.first);
        EXPECT_LT(below.root, cut.root);
        EXPECT_LT(below.variables, cut.variables);
      }
    }
  }
}

TEST(TreeCuts, ArePlannedWithEveryGroupOnceBeforeWhatJoinsIt) {
  int with_leaves = 0;
  for (const SampleOfCuts& s : samples()) {
    ASSERT_EQ(s.plan.tasks.size(), s.plan.forest.size());
    std::vector<std::size_t> next(s.cuts.size(), 0);
    std::vector<int> leaves(s.cuts.size(), 0);
    std::vector<int> waits_for(s.plan.tasks.size(), 0);
    for (std::size_t t = 0; t < s.plan.tasks.size(); ++t) {
      const CutTask& task = s.plan.tasks[t];
      const auto c = static_cast<std::size_t>(task.cut);
      EXPECT_EQ(task.first, next[c]);
      next[c] = task.end;
      const FrontTask& node = s.plan.forest[t];
      if (node.parent >= 0) {
        ASSERT_GT(static_cast<std::size_t>(node.parent), t);
        ++waits_for[static_cast<std::size_t>(node.parent)];
        const CutTask& above = s.plan.tasks[static_cast<std::size_t>(node.parent)];
        EXPECT_EQ(above.leaf, -1);
        EXPECT_EQ(above.cut, task.leaf >= 0 ? task.cut : s.cuts[c].parent);
        EXPECT_GT(node.path_cost, s.plan.forest[static_cast<std::size_t>(node.parent)].path_cost);
      }
      if (task.leaf < 0) continue;
      EXPECT_EQ(task.leaf, leaves[c]);
      ++leaves[c];
    }
    for (std::size_t c = 0; c < s.cuts.size(); ++c) {
      EXPECT_EQ(next[c], s.cuts[c].groups.size());
      EXPECT_EQ(leaves[c], s.plan.leaves[c]);
      with_leaves += leaves[c] > 0 ? 1 : 0;
    }
    for (std::size_t t = 0; t < waits_for.size(); ++t)
      EXPECT_EQ(waits_for[t], s.plan.forest[t].waits_for);
  }
  EXPECT_GT(with_leaves, 0);
}

// Where one cut has most of the work, no thread should be alone with it.
TEST(TreeCuts, OfMoreThanTheirShareAreDoneByAllThreadsTogether) {
  const SampleOfCuts alone(testing_support::grid_problem(40, 40, 3), 16, 8, 1);
  EXPECT_EQ(std::ranges::count(alone.plan.together, 1), 0);
  std::ptrdiff_t before = 0;
  for (const int threads : {2, 8}) {
    const SampleOfCuts s(testing_support::grid_problem(40, 40, 3), 16, 8, threads);
    ASSERT_EQ(s.plan.together.size(), s.plan.tasks.size());
    const auto together = std::ranges::count(s.plan.together, 1);
    EXPECT_GT(together, before);  // shares are smaller
    before = together;
    EXPECT_LT(together, static_cast<std::ptrdiff_t>(s.cuts.size()) / 2);
    for (std::size_t t = 0; t < s.plan.tasks.size(); ++t) {
      if (s.plan.together[t] == 0) continue;
      EXPECT_EQ(s.plan.tasks[t].leaf, -1);
      const std::int32_t above = s.plan.forest[t].parent;
      EXPECT_TRUE(above < 0 || s.plan.together[static_cast<std::size_t>(above)] == 1);
    }
  }
}

TEST(Forest, IsWalkedChildrenFirstAndWhatIsTogetherLast) {
  // 0 and 1 below 4, 2 and 3 below 5, both below 6; a tree 7 by itself.
  std::vector<FrontTask> nodes(8);
  const std::vector<std::int32_t> parent{4, 4, 5, 5, 6, 6, -1, -1};
  for (std::size_t n = nodes.size(); n-- > 0;) {
    nodes[n].parent = parent[n];
    nodes[n].path_cost = 1.0;
    if (parent[n] < 0) continue;
    nodes[n].path_cost += nodes[static_cast<std::size_t>(parent[n])].path_cost;
    ++nodes[static_cast<std::size_t>(parent[n])].waits_for;
  }
  const std::vector<char> together{0, 0, 0, 0, 0, 1, 1, 0};
  const ForestPart apart = part_of(nodes, together);
  EXPECT_EQ(apart.number, (std::vector<std::int32_t>{0, 1, 2, 3, 4, 7}));
  std::vector<std::int32_t> parents;
  std::vector<double> costs;
  for (const FrontTask& node : apart.nodes) {
    parents.push_back(node.parent);
    costs.push_back(node.path_cost);
  }
  EXPECT_EQ(parents, (std::vector<std::int32_t>{4, 4, -1, -1, -1, -1}));
  EXPECT_EQ(costs, (std::vector<double>{2, 2, 1, 1, 1, 1}));
  for (const int threads : {1, 2, 5}) {
    SCOPED_TRACE(threads);
    WorkerPool pool(threads);
    std::vector<int> when(nodes.size(), -1);
    std::atomic<int> clock = 0;
    walk_forest(nodes, together, pool, {}, [&](int node, int thread, LoopRunner) {
      when[static_cast<std::size_t>(node)] = clock++;
      EXPECT_TRUE(together[static_cast<std::size_t>(node)] == 0 || thread == 0);
    });
    EXPECT_EQ(clock, 8);
    for (std::size_t n = 0; n < nodes.size(); ++n) {
      EXPECT_TRUE(parent[n] < 0 || when[n] < when[static_cast<std::size_t>(parent[n])]);
    }
    EXPECT_TRUE(threads == 1 || when[6] == 7);
    // What one node throws leaves out what is above it, together or not.
    std::vector<char> done(nodes.size(), 0);
    EXPECT_THROW(walk_forest(nodes, together, pool, {},
                             [&](int node, int, LoopRunner) {
                               if (node == 3) throw InputError("no");
                               done[static_cast<std::size_t>(node)] = 1;
                             }),
                 InputError);
    EXPECT_EQ(done, (std::vector<char>{1, 1, 1, 0, 1, 0, 0, 1}));
  }
}

}  // namespace
}  // namespace mapjoin
