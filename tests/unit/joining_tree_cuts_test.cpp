#include "mapjoin/joining/tree_cuts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <vector>

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

struct Sample {
  explicit Sample(const CliqueProblem& problem, int leaf, int arity)
      : observations(problem.cliques().size()),
        structure(analyze(problem.dims(), problem.cliques(),
                          order_blocks(problem.dims(), problem.cliques()))),
        cuts(cut_tree(structure, observations, leaf, arity)),
        plan(plan_cuts(structure, cuts)) {}
  std::int64_t observations;
  FrontalStructure structure;
  std::vector<Cut> cuts;
  CutPlan plan;
};

std::vector<Sample> samples() {
  std::vector<Sample> out;
  for (const int leaf : {4, 32, 100000}) {
    out.emplace_back(line(1500), leaf, 16);
    out.emplace_back(testing_support::grid_problem(25, 25, 3), leaf, 4);
  }
  return out;
}

TEST(TreeCuts, HaveEveryObservationOnce) {
  for (const Sample& s : samples()) {
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
  for (const Sample& s : samples()) {
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
  for (const Sample& s : samples()) {
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

}  // namespace
}  // namespace mapjoin
