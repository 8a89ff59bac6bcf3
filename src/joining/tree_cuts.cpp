#include "mapjoin/joining/tree_cuts.h"

#include <algorithm>
#include <utility>

#include "mapjoin/graph/index.h"
#include "mapjoin/solvers/front_merging.h"

namespace mapjoin {

namespace {

/// Observations that one task lays out, of a cut that has many of its own; and what one costs, in
/// units of FrontCostModel.
constexpr std::size_t kLeafTask = 128;
constexpr double kLeafCost = 300.0;

/// A cut is large when it is more than this share of what each thread has to do: another thread may
/// wait so long for the one that has it.
constexpr double kLargeShare = 0.5;

class TreeCutter {
 public:
  TreeCutter(const FrontalStructure& structure, std::int64_t observations,
             std::span<const std::int64_t> sizes)
      : s_(structure), observations_(observations), sizes_(sizes) {
    const std::size_t fronts = s_.fronts.size();
    variables_.resize(fronts);
    fronts_below_.assign(fronts, 1);
    largest_child_.assign(fronts, 0);
    for (std::size_t f = 0; f < fronts; ++f) {
      variables_[f] += s_.fronts[f].end_position - s_.fronts[f].first_position;
      const std::int32_t parent = s_.fronts[f].parent;
      if (parent < 0) continue;
      variables_[at(parent)] += variables_[f];
      fronts_below_[at(parent)] += fronts_below_[f];
      largest_child_[at(parent)] = std::max(largest_child_[at(parent)], variables_[f]);
    }
  }

  std::vector<Cut> cuts() {
    std::vector<Cut> out;
    std::vector<std::int32_t> open;  // cuts whose parent is yet to come
    for (std::int32_t f = 0; f < static_cast<std::int32_t>(s_.fronts.size()); ++f) {
      if (!is_cut(f)) continue;
      Cut cut;
      cut.root = f;
      cut.variables = variables_[at(f)];
      cut.first = f + 1 - fronts_below_[at(f)];
      while (!open.empty() && out[at(open.back())].root >= cut.first) {
        cut.children.push_back(open.back());
        out[at(open.back())].parent = static_cast<std::int32_t>(out.size());
        open.pop_back();
      }
      std::reverse(cut.children.begin(), cut.children.end());
      gather(cut, out);
      open.push_back(static_cast<std::int32_t>(out.size()));
      out.push_back(std::move(cut));
    }
    return out;
  }

 private:
  /// A root of a tree, or the first front of its path whose subtree reaches one of the sizes.
  bool is_cut(std::int32_t f) const {
    if (s_.fronts[at(f)].parent < 0) return true;
    return std::ranges::any_of(sizes_, [&](std::int64_t size) {
      return largest_child_[at(f)] < size && size <= variables_[at(f)];
    });
  }

  void add_owned(std::int32_t front, std::vector<std::int64_t>& group) const {
    for (const std::int64_t k : s_.owned_by(front)) {
      if (k < observations_) group.push_back(k);
    }
  }

  /// Observations of the cut's fronts that no cut below has: small subtrees apart from the path
  /// they hang on.
  void gather(Cut& cut, const std::vector<Cut>& cuts) const {
    std::vector<std::int64_t> path;
    std::int32_t f = cut.root;
    std::size_t below = cut.children.size();
    while (f >= cut.first) {
      if (below > 0 && cuts[at(cut.children[below - 1])].root == f) {
        f = cuts[at(cut.children[--below])].first - 1;
        continue;
      }
      if (f != cut.root && variables_[at(f)] < sizes_.front() && !cut.children.empty()) {
        std::vector<std::int64_t> group;
        const std::int32_t first = f + 1 - fronts_below_[at(f)];
        for (std::int32_t g = first; g <= f; ++g) add_owned(g, group);
        if (!group.empty()) cut.groups.push_back(std::move(group));
        f = first - 1;
        continue;
      }
      add_owned(f, path);
      --f;
    }
    if (!path.empty()) cut.groups.push_back(std::move(path));
  }

  const FrontalStructure& s_;
  std::int64_t observations_;
  std::span<const std::int64_t> sizes_;
  std::vector<std::int64_t> variables_, largest_child_;
  std::vector<std::int32_t> fronts_below_;
};

/// Work for all fronts before each (+ 1). What a join costs is what its fronts cost, all of them:
/// those of the cuts below are computed again.
std::vector<double> running_cost(const FrontalStructure& structure) {
  std::vector<double> out{0.0};
  for (const Front& front : structure.fronts)
    out.push_back(out.back() + FrontCostModel()(front.pivot_dim, front.update_dim));
  return out;
}

/// Appends a cut's tasks; their costs are not yet those of their paths. \returns how many lay out
/// groups.
int add_tasks(CutPlan& plan, const Cut& cut, std::int32_t number, double cost) {
  CutTask task{number};
  std::size_t observations = 0, rest = 0;
  int leaves = 0;
  for (const auto& group : cut.groups) rest += group.size();
  for (std::size_t g = 0; g < cut.groups.size() && rest > kLeafTask; ++g) {
    observations += cut.groups[g].size();
    if (observations < kLeafTask) continue;
    task.leaf = leaves++;
    task.end = g + 1;
    plan.tasks.push_back(task);
    plan.forest.push_back({.path_cost = kLeafCost * static_cast<double>(observations)});
    rest -= observations;
    task.first = task.end;
    observations = 0;
  }
  task.leaf = -1;
  task.end = cut.groups.size();
  plan.tasks.push_back(task);
  plan.forest.push_back(
      {.waits_for = static_cast<std::int32_t>(cut.children.size()) + leaves, .path_cost = cost});
  return leaves;
}

}  // namespace

std::vector<Cut> cut_tree(const FrontalStructure& structure, std::int64_t observations,
                          std::span<const std::int64_t> sizes) {
  return TreeCutter(structure, observations, sizes).cuts();
}

CutPlan plan_cuts(const FrontalStructure& structure, const std::vector<Cut>& cuts, int threads) {
  const std::vector<double> before = running_cost(structure);
  const auto cost_of = [&](const Cut& cut) {
    return before[at(cut.root) + 1] - before[at(cut.first)];
  };
  double all = 0.0;
  for (const Cut& cut : cuts) {
    if (cut.parent >= 0) all += cost_of(cut);
  }
  const double large = kLargeShare * all / threads;
  CutPlan plan;
  std::vector<std::int32_t> task_of;
  for (const Cut& cut : cuts) {
    const double cost = cost_of(cut);
    plan.leaves.push_back(
        add_tasks(plan, cut, static_cast<std::int32_t>(plan.leaves.size()), cost));
    task_of.push_back(static_cast<std::int32_t>(plan.tasks.size()) - 1);
    plan.together.resize(plan.tasks.size(), 0);
    plan.together.back() = threads > 1 && cost > large ? 1 : 0;
  }
  for (std::size_t t = plan.tasks.size(); t-- > 0;) {  // parents first
    const CutTask& task = plan.tasks[t];
    FrontTask& node = plan.forest[t];
    const std::int32_t above = task.leaf >= 0 ? task.cut : cuts[at(task.cut)].parent;
    if (above < 0) continue;
    node.parent = task_of[at(above)];
    node.path_cost += plan.forest[at(node.parent)].path_cost;
  }
  return plan;
}

}  // namespace mapjoin
