#include "mapjoin/solvers/frontal_cholesky.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include "mapjoin/solvers/front_layout.h"

namespace mapjoin {
namespace {

using Index = std::int32_t;

constexpr Index kNoFailure = std::numeric_limits<Index>::max();
constexpr int kSmallFront = 64;            // rows; up to here whole fronts are cleared at a time
constexpr double kSharedFrontFlops = 1e6;  // below, asking others to help costs more than it brings

void clear_small(const Front& front, const FrontView& view) {
  std::fill_n(view.panel(), std::int64_t{front.pivot_dim} * front.panel_stride, 0.0);
  if (front.update_dim == 0) return;
  double* const update = view.column(front.pivot_dim) + front.pivot_dim / kRowGroup * kRowGroup;
  std::fill_n(update, std::int64_t{front.update_dim} * front.update_stride, 0.0);
}

// What lies on or below the diagonal, to whole row groups; the kernels may read one tile above it.
void clear_columns(const FrontView& front, int begin, int end) {
  const int row_end = (front.rows() + kRowGroup) / kRowGroup * kRowGroup;
  for (int j = begin; j < end; ++j) {
    const int top = j < front.pivot_dim() ? 0 : front.pivot_dim() / kRowGroup * kRowGroup;
    const int row = std::max(top, (j - kRowGroup + 1) / kRowGroup * kRowGroup);
    std::fill(front.column(j) + row, front.column(j) + row_end, 0.0);
  }
}

/// Of a front's diagonal of H, bounds of its pivots, and what assembling a right-hand side takes.
std::int64_t scratch_size(const FrontalStructure& structure) {
  return 3 * ((structure.statistics.largest_front + 2 * kRowGroup) / kRowGroup * kRowGroup);
}

}  // namespace

void FrontalCholesky::require_memory(const FrontalStructure& structure, std::int64_t first_panel,
                                     std::int64_t end_panel, int threads) {
  structure_ = &structure;
  first_panel_ = first_panel;
  factor_.require(end_panel - first_panel);
  require_rooms(threads);
  squared_y_.resize(structure.fronts.size());
  other_y_.clear();
  first_failure_ = kNoFailure;
}

void FrontalCholesky::require_rooms(int threads) {
  const auto count = static_cast<std::size_t>(threads);
  if (rooms_.size() < count) rooms_.resize(count);
  for (std::size_t t = 0; t < count; ++t) {
    rooms_[t].scratch.require(scratch_size(*structure_));
    rooms_[t].stack.require(structure_->update_stack);
  }
}

/// For the update matrices of all fronts.
void FrontalCholesky::require_workspace(const FrontalStructure& structure) {
  first_update_ = structure.update_stack;
  workspace_.require(structure.statistics.workspace_bytes /
                     static_cast<std::int64_t>(sizeof(double)));
}

/// For those of a subtree, which lie anywhere in the workspace of all: only the stretch they take.
/// So many subtrees, one after the other, use the same memory, which stays in the cache.
void FrontalCholesky::require_workspace(const FrontalStructure& structure, Index first,
                                        Index root) {
  std::int64_t begin = std::numeric_limits<std::int64_t>::max();
  std::int64_t end = 0;
  for (Index f = first; f <= root; ++f) {
    const Front& front = structure.fronts[f];
    if (structure.is_on_stack(front)) continue;
    begin = std::min(begin, front.update - front.pivot_dim / kRowGroup * kRowGroup);
    end = std::max(end, front.update + update_size(front));
  }
  if (begin > end) return;
  first_update_ = begin / kRowGroup * kRowGroup;
  workspace_.require(end - first_update_ + kRowGroup);  // a root has a place, if no matrix there
}

void FrontalCholesky::reserve(const FrontalStructure& structure) {
  if (options_.residence.bytes >= 0) return;
  factor_.require(structure.statistics.factor_bytes / static_cast<std::int64_t>(sizeof(double)));
  require_workspace(structure);
}

/// One after another; what is finished may leave memory, some MB at a time.
void FrontalCholesky::factor_fronts(Index begin, Index end, Assembler assemble,
                                    const ThreadRoom& room, LoopRunner loop) {
  if (begin >= end) return;
  std::int64_t unsettled = structure_->fronts[begin].panel - first_panel_;
  for (Index f = begin; f < end; ++f) {
    factor_front(f, assemble, room, loop);
    if (options_.residence.bytes >= 0) give_back_updates(f);
    const std::int64_t done = end_of_panel(structure_->fronts[f]) - first_panel_;
    if (done - unsettled < kPanelPortion && f + 1 < end) continue;
    factor_.settle(unsettled, done);
    unsettled = done;
  }
}

void FrontalCholesky::give_back_update(const Front& front) {
  if (structure_->is_on_stack(front)) return;  // is used at once again
  const std::int64_t begin = front.update - first_update_;
  workspace_.give_back(begin, begin + std::int64_t{front.update_stride} * front.update_dim);
}

/// The update matrices below a front are added to it: their memory is free until the next time.
void FrontalCholesky::give_back_updates(Index front) {
  for (const Index child : structure_->children_of(front)) {
    give_back_update(structure_->fronts[child]);
  }
}

FactorStatus FrontalCholesky::factorize_subtree(const FrontalStructure& structure, Index first,
                                                Index root, Assembler assemble, WorkerPool& pool,
                                                LoopRunner loop) {
  require_memory(structure, structure.fronts[first].panel, end_of_panel(structure.fronts[root]),
                 pool.threads());
  require_workspace(structure, first, root);
  std::vector<FrontTask> tasks;
  if (pool.threads() > 1) tasks = tasks_of_subtree(structure, first, root);
  if (tasks.size() <= 1) {  // on the caller's stack, where the root's update matrix is looked for
    factor_fronts(first, root + 1, assemble, rooms_[0], loop);
    return status();
  }
  for_each_task(tasks, pool, [&](int thread, const FrontTask& task, LoopRunner inner) {
    factor_fronts(task.begin, task.end, assemble, rooms_[static_cast<std::size_t>(thread)], inner);
  });
  return status();
}

/// Calls work(thread, task, loop) for all tasks, children before parents.
template <class Work>
void FrontalCholesky::for_each_task(std::span<const FrontTask> tasks, WorkerPool& pool,
                                    Work&& work) {
  if (pool.threads() == 1) {
    for (const FrontTask& task : tasks) work(0, task, LoopRunner());
    return;
  }
  scheduler_.reset(tasks, pool.threads());
  pool.run([&](int thread) {
    scheduler_.work(thread, [&](int task, LoopRunner loop) {
      work(thread, tasks[static_cast<std::size_t>(task)], loop);
    });
  });
}

bool FrontalCholesky::eliminate(RhsAssembler assemble, WorkerPool& pool, double most) {
  require_rooms(pool.threads());
  other_y_.resize(static_cast<std::size_t>(structure_->scalar_at.back()));
  // The order in which threads add up may change the last digits, but not the answer.
  const double far_more = 1.001 * most;
  std::atomic<double> sum = 0.0;
  for_each_task(structure_->tasks, pool, [&](int thread, const FrontTask& task, LoopRunner) {
    if (sum.load(std::memory_order_relaxed) > far_more) return;
    forward_substitute_fronts(task.begin, task.end, assemble,
                              rooms_[static_cast<std::size_t>(thread)]);
    const auto y = std::span(squared_y_).subspan(static_cast<std::size_t>(task.begin));
    sum += std::accumulate(y.begin(), y.begin() + (task.end - task.begin), 0.0);
  });
  return sum.load() <= far_more && squared_norm_of_y() <= most;
}

FactorStatus FrontalCholesky::factorize(const FrontalStructure& structure, Assembler assemble,
                                        WorkerPool& pool) {
  require_memory(structure, 0,
                 structure.statistics.factor_bytes / static_cast<std::int64_t>(sizeof(double)),
                 pool.threads());
  require_workspace(structure);
  for_each_task(structure.tasks, pool, [&](int thread, const FrontTask& task, LoopRunner loop) {
    factor_fronts(task.begin, task.end, assemble, rooms_[static_cast<std::size_t>(thread)], loop);
  });
  return status();
}

FactorStatus FrontalCholesky::status() const {
  if (first_failure_ == kNoFailure) return {};
  const auto& starts = structure_->scalar_at;
  const auto after = std::upper_bound(starts.begin(), starts.end(), first_failure_.load());
  return {.failed_variable = structure_->order[after - starts.begin() - 1]};
}

void FrontalCholesky::factor_front(Index f, Assembler assemble, const ThreadRoom& room,
                                   LoopRunner loop) {
  const Front& front = structure_->fronts[f];
  // Later fronts cannot change what failed first; earlier ones can, and are never skipped.
  if (front.first_scalar > first_failure_.load(std::memory_order_relaxed)) return;
  const FrontView view(front, panel(front), update_place(front, room));
  const auto children = structure_->children_of(f);
  if (loop.run != nullptr && front_flops(front.pivot_dim, front.update_dim) < kSharedFrontFlops)
    loop = {};

  if (view.rows() <= kSmallFront) {
    clear_small(front, view);
  } else {
    for_each_column_range(view.rows(), loop,
                          [&](int begin, int end) { clear_columns(view, begin, end); });
  }
  assemble.call(assemble.object, f, view);
  double* const diagonal = room.scratch.data();
  for (int j = 0; j < view.rows(); ++j) diagonal[j] = view.column(j)[j];
  for_each_column_range(view.rows(), loop, [&](int begin, int end) {
    for (const Index child : children) {
      extend_add(view, update_of(structure_->fronts[child], room), structure_->runs_of(child),
                 begin, end);
    }
  });
  for (const Index child : children) {
    extend_add_diagonal(diagonal, update_of(structure_->fronts[child], room),
                        structure_->runs_of(child));
  }
  std::copy(diagonal + front.pivot_dim, diagonal + view.rows(), update_of(front, room).diagonal());

  double* const smallest = diagonal + view.rows();
  for (int j = 0; j < front.pivot_dim; ++j)
    smallest[j] = std::max(0.0, options_.smallest_pivot * diagonal[j]);
  const int failed = eliminate_pivots(view, smallest, loop);
  if (failed < 0) {
    double sum = 0.0;
    for (int j = 0; j < front.pivot_dim; ++j) sum += view.rhs(j) * view.rhs(j);
    squared_y_[static_cast<std::size_t>(f)] = sum;
    return;
  }
  Index known = first_failure_.load();
  while (front.first_scalar + failed < known &&
         !first_failure_.compare_exchange_weak(known, front.first_scalar + failed)) {
  }
}

}  // namespace mapjoin
