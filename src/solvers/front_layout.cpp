#include "mapjoin/solvers/front_layout.h"

#include <algorithm>
#include <array>
#include <numeric>

namespace mapjoin {
namespace {

using Index = std::int32_t;

constexpr double kTaskShare =
    1.0 / 32;  // a task is at most this share of the work, if it is a subtree

Index round_up(Index rows) { return (rows + kRowGroup - 1) / kRowGroup * kRowGroup; }
Index round_down(Index rows) { return rows / kRowGroup * kRowGroup; }

// Whole row groups; an odd number of them once columns are long, so that neighbouring columns fall
// on all cache sets.
Index stride(Index rows) {
  const Index groups = round_up(rows) / kRowGroup;
  return kRowGroup * (groups >= 16 && groups % 2 == 0 ? groups + 1 : groups);
}

class TaskPlanner {
 public:
  TaskPlanner(FrontalStructure& structure, const FrontCostModel& cost) : structure_(structure) {
    const auto& fronts = structure.fronts;
    own_cost_.reserve(fronts.size());
    for (const Front& front : fronts) own_cost_.push_back(cost(front.pivot_dim, front.update_dim));
    subtree_cost_ = own_cost_;
    subtree_size_.assign(fronts.size(), 1);
    for (std::size_t f = 0; f < fronts.size(); ++f) {
      if (fronts[f].parent < 0) continue;
      subtree_cost_[fronts[f].parent] += subtree_cost_[f];
      subtree_size_[fronts[f].parent] += subtree_size_[f];
    }
    limit_ = kTaskShare * std::accumulate(own_cost_.begin(), own_cost_.end(), 0.0);
  }

  void run() {
    const auto& fronts = structure_.fronts;
    for (Index f = 0; f < static_cast<Index>(fronts.size()); ++f) {
      if (is_top(f)) {
        add(f, f + 1, own_cost_[f], continues_path(f));
      } else if (fronts[f].parent < 0 || is_top(fronts[f].parent)) {
        const Index begin = f + 1 - subtree_size_[f];
        add(begin, f + 1, subtree_cost_[f], continues_group(begin, f));
      }
    }
    link_tasks();
  }

 private:
  bool is_top(Index f) const { return subtree_cost_[f] > limit_; }

  // A front above exactly one large subtree, whose root is the front just before it.
  bool continues_path(Index f) const {
    if (f == 0 || !is_top(f - 1) || cost_.back() + own_cost_[f] > limit_) return false;
    const auto children = structure_.children_of(f);
    return children.back() == f - 1 && std::none_of(children.begin(), children.end() - 1,
                                                    [&](Index child) { return is_top(child); });
  }

  bool continues_group(Index begin, Index f) const {
    if (structure_.tasks.empty()) return false;
    const Index last = structure_.tasks.back().end - 1;
    return last + 1 == begin && !is_top(last) &&
           structure_.fronts[last].parent == structure_.fronts[f].parent &&
           cost_.back() + subtree_cost_[f] <= limit_;
  }

  void add(Index begin, Index end, double cost, bool extend_last) {
    if (extend_last) {
      structure_.tasks.back().end = end;
      cost_.back() += cost;
    } else {
      structure_.tasks.push_back({.begin = begin, .end = end});
      cost_.push_back(cost);
    }
  }

  void link_tasks() {
    auto& tasks = structure_.tasks;
    std::vector<Index> task_of(structure_.fronts.size());
    for (std::size_t t = 0; t < tasks.size(); ++t) {
      std::fill(task_of.begin() + tasks[t].begin, task_of.begin() + tasks[t].end,
                static_cast<Index>(t));
    }
    for (std::size_t t = tasks.size(); t-- > 0;) {
      FrontTask& task = tasks[t];
      const Index above = structure_.fronts[task.end - 1].parent;
      task.parent = above < 0 ? -1 : task_of[above];
      task.path_cost = cost_[t] + (above < 0 ? 0.0 : tasks[task.parent].path_cost);
      if (above >= 0) ++tasks[task.parent].waits_for;
    }
  }

  FrontalStructure& structure_;
  std::vector<double> own_cost_;
  std::vector<double> subtree_cost_;
  std::vector<Index> subtree_size_;
  std::vector<double> cost_;  // of each task
  double limit_ = 0;
};

// Update matrix with whole columns from the row group that holds row p, then a column for the
// diagonal of H.
std::int64_t update_size(const Front& front) {
  if (front.update_dim == 0) return 0;
  return std::int64_t{front.update_stride} * front.update_dim +
         round_up(front.update_dim + kRowGroup - 1);
}

// Places the update matrices of one task from `base` on; returns the end.
std::int64_t place_updates(FrontalStructure& structure, const FrontTask& task,
                           std::span<const char> odd_depth, std::int64_t base) {
  std::array<std::int64_t, 2> top = {0, 0};
  std::array<std::int64_t, 2> peak = {0, 0};
  for (Index f = task.begin; f < task.end; ++f) {
    Front& front = structure.fronts[f];
    const int stack = odd_depth[f];
    front.update = top[stack];
    top[stack] += update_size(front);
    peak[stack] = std::max(peak[stack], top[stack]);
    const auto children = structure.children_of(f);
    const auto own =
        std::find_if(children.begin(), children.end(), [&](Index c) { return c >= task.begin; });
    if (own != children.end()) top[1 - stack] = structure.fronts[*own].update;
  }
  for (Index f = task.begin; f < task.end; ++f)
    structure.fronts[f].update += base + (odd_depth[f] ? peak[0] : 0);
  return base + peak[0] + peak[1];
}

}  // namespace

void plan_tasks(FrontalStructure& structure, const FrontCostModel& cost) {
  structure.tasks.clear();
  TaskPlanner(structure, cost).run();
}

void plan_memory(FrontalStructure& structure) {
  auto& fronts = structure.fronts;
  FactorStatistics& statistics = structure.statistics;
  std::vector<char> odd_depth(fronts.size(), 0);
  for (std::size_t f = fronts.size(); f-- > 0;) {
    if (fronts[f].parent >= 0) odd_depth[f] = static_cast<char>(1 - odd_depth[fronts[f].parent]);
  }
  std::int64_t factor_end = 0;
  for (Front& front : fronts) {
    front.panel_stride = stride(front.rows() + 1);
    front.update_stride = stride(front.rows() + 1 - round_down(front.pivot_dim));
    front.panel = factor_end;
    factor_end += std::int64_t{front.panel_stride} * front.pivot_dim;
    const std::int64_t p = front.pivot_dim;
    statistics.factor_nonzeros += p * (p + 1) / 2 + p * front.update_dim;
    statistics.flops += front_flops(front.pivot_dim, front.update_dim);
    statistics.largest_front = std::max(statistics.largest_front, front.rows());
  }
  std::int64_t workspace_end = 0;
  for (const FrontTask& task : structure.tasks) {
    workspace_end = place_updates(structure, task, odd_depth, workspace_end);
  }
  statistics.fronts = static_cast<std::int64_t>(fronts.size());
  statistics.scalars = structure.scalar_at.back();
  statistics.factor_bytes = factor_end * static_cast<std::int64_t>(sizeof(double));
  statistics.workspace_bytes = workspace_end * static_cast<std::int64_t>(sizeof(double));
}

}  // namespace mapjoin
