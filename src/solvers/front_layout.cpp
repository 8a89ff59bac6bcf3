#include "mapjoin/solvers/front_layout.h"

#include <algorithm>
#include <array>
#include <numeric>

namespace mapjoin {
namespace {

using Index = std::int32_t;

constexpr double kTaskShare =
    1.0 / 32;  // a task is at most this share of the work, if it is a subtree

Index whole_groups(Index rows) { return (rows + kRowGroup - 1) / kRowGroup * kRowGroup; }
Index row_group_of(Index rows) { return rows / kRowGroup * kRowGroup; }

// Whole row groups; an odd number of them once columns are long, so that neighbouring columns fall
// on all cache sets.
Index column_stride(Index rows) {
  const Index groups = whole_groups(rows) / kRowGroup;
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

// Gives update matrices their places. Of a subtree those outside the stacks lie in one stretch of
// memory, [begin of the subtree, end_ when its root was placed); when its root is eliminated, only
// its children's matrices are still needed there.
class UpdatePlanner {
 public:
  explicit UpdatePlanner(FrontalStructure& structure)
      : structure_(structure),
        subtree_begin_(structure.fronts.size()),
        odd_depth_(structure.fronts.size(), 0) {
    const auto& fronts = structure.fronts;
    for (std::size_t f = fronts.size(); f-- > 0;) {
      if (fronts[f].parent >= 0) {
        odd_depth_[f] = static_cast<char>(1 - odd_depth_[fronts[f].parent]);
      }
      lead_ = std::max<std::int64_t>(lead_, whole_groups(fronts[f].pivot_dim));
    }
  }

  // Returns the doubles of the workspace.
  std::int64_t run() {
    std::int64_t& stack = structure_.update_stack;
    stack = 0;
    for (const FrontTask& task : structure_.tasks) {
      if (task.waits_for == 0) stack = std::max(stack, place_on_stacks(task));
    }
    end_ = stack + lead_;
    for (const FrontTask& task : structure_.tasks) {
      if (task.waits_for == 0) {
        place_roots(task);
      } else {
        for (Index f = task.begin; f < task.end; ++f) place_in_gap(f);
      }
    }
    return end_ - stack;
  }

 private:
  // Used by another task than the one it comes from.
  bool leaves(const Front& front, const FrontTask& task) const { return front.parent >= task.end; }

  // Within a task, fronts come one by one: two stacks, for fronts of even and of odd depth. When a
  // front is eliminated, its children's matrices are on top of the other stack than its own.
  // Returns the room it takes.
  std::int64_t place_on_stacks(const FrontTask& task) {
    std::array<std::int64_t, 2> top = {0, 0};
    std::array<std::int64_t, 2> peak = {0, 0};
    for (Index f = task.begin; f < task.end; ++f) {
      Front& front = structure_.fronts[f];
      const int stack = odd_depth_[f];
      front.update = top[stack];
      if (!leaves(front, task)) top[stack] += update_size(front);
      peak[stack] = std::max(peak[stack], top[stack]);
      const auto children = structure_.children_of(f);
      if (!children.empty()) top[1 - stack] = structure_.fronts[children.front()].update;
      if (front.parent < 0) top = {0, 0};  // a tree is done
    }
    for (Index f = task.begin; f < task.end; ++f)
      structure_.fronts[f].update += lead_ + (odd_depth_[f] ? peak[0] : 0);
    return lead_ + peak[0] + peak[1];
  }

  // One after the other, above the stacks.
  void place_roots(const FrontTask& task) {
    const std::int64_t begin = end_;
    for (Index f = task.begin; f < task.end; ++f) {
      Front& front = structure_.fronts[f];
      subtree_begin_[f] = begin;
      if (!leaves(front, task)) continue;
      front.update = end_;
      end_ += update_size(front);
    }
  }

  // Above, several subtrees may be under way at a time, but nothing else works on memory of this
  // one: the first gap between the children's matrices that is large enough, or the end.
  void place_in_gap(Index f) {
    const auto children = structure_.children_of(f);
    std::vector<Index> by_place(children.begin(), children.end());
    std::sort(by_place.begin(), by_place.end(), [&](Index a, Index b) {
      return structure_.fronts[a].update < structure_.fronts[b].update;
    });
    std::int64_t gap = end_;
    for (const Index child : children) gap = std::min(gap, subtree_begin_[child]);
    subtree_begin_[f] = gap;
    const std::int64_t size = update_size(structure_.fronts[f]);
    for (const Index child : by_place) {
      const Front& front = structure_.fronts[child];
      if (front.update - gap >= size) break;
      gap = std::max(gap, front.update + update_size(front));
    }
    structure_.fronts[f].update = gap;
    end_ = std::max(end_, gap + size);
  }

  FrontalStructure& structure_;
  std::vector<std::int64_t> subtree_begin_;
  std::vector<char> odd_depth_;
  // A view counts rows from the front's first, so its columns start before S; yet never before the
  // memory it is in.
  std::int64_t lead_ = 0;
  std::int64_t end_ = 0;
};

}  // namespace

std::int64_t update_size(const Front& front) {
  if (front.update_dim == 0) return 0;
  return std::int64_t{front.update_stride} * front.update_dim +
         whole_groups(front.update_dim + kRowGroup - 1);
}

void plan_tasks(FrontalStructure& structure, const FrontCostModel& cost) {
  structure.tasks.clear();
  TaskPlanner(structure, cost).run();
}

std::vector<FrontTask> tasks_of_subtree(const FrontalStructure& structure, Index first,
                                        Index root) {
  const auto& all = structure.tasks;
  const auto begin = std::lower_bound(all.begin(), all.end(), first,
                                      [](const FrontTask& t, Index f) { return t.begin < f; });
  if (begin == all.end() || begin->begin != first || begin->end > root + 1)
    return {{.begin = first, .end = root + 1}};
  auto end = begin;
  while (end != all.end() && end->begin <= root) ++end;
  std::vector<FrontTask> out(begin, end);
  out.back().end = root + 1;
  out.back().parent = -1;
  out.back().waits_for = 0;  // fewer than before: some may hang above `root`
  for (std::size_t t = 0; t + 1 < out.size(); ++t) {
    out[t].parent -= static_cast<Index>(begin - all.begin());
    if (out[t].parent + 1 == static_cast<Index>(out.size())) ++out.back().waits_for;
  }
  return out;
}

void plan_memory(FrontalStructure& structure) {
  auto& fronts = structure.fronts;
  FactorStatistics& statistics = structure.statistics;
  std::int64_t factor_end = 0;
  for (Front& front : fronts) {
    front.panel_stride = column_stride(front.rows() + 1);
    front.update_stride = column_stride(front.rows() + 1 - row_group_of(front.pivot_dim));
    front.panel = factor_end;
    factor_end += std::int64_t{front.panel_stride} * front.pivot_dim;
    const std::int64_t p = front.pivot_dim;
    statistics.factor_nonzeros += p * (p + 1) / 2 + p * front.update_dim;
    statistics.flops += front_flops(front.pivot_dim, front.update_dim);
    statistics.largest_front = std::max(statistics.largest_front, front.rows());
  }
  std::int64_t live = 0;
  for (std::size_t f = 0; f < fronts.size(); ++f) {
    live += update_size(fronts[f]);
    statistics.live_update_bytes = std::max(statistics.live_update_bytes, live);
    for (const Index child : structure.children_of(static_cast<Index>(f)))
      live -= update_size(fronts[child]);
  }
  statistics.live_update_bytes *= static_cast<std::int64_t>(sizeof(double));
  const std::int64_t workspace = UpdatePlanner(structure).run();
  statistics.fronts = static_cast<std::int64_t>(fronts.size());
  statistics.scalars = structure.scalar_at.back();
  statistics.factor_bytes = factor_end * static_cast<std::int64_t>(sizeof(double));
  statistics.workspace_bytes = workspace * static_cast<std::int64_t>(sizeof(double));
  statistics.stack_bytes = structure.update_stack * static_cast<std::int64_t>(sizeof(double));
}

}  // namespace mapjoin
