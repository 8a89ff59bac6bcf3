// Triangular solves with the factor: the tree from the leaves up (forward) and from the roots down
// (backward).

#include <Eigen/Dense>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <vector>

#include "mapjoin/solvers/extend_add.h"
#include "mapjoin/solvers/front_layout.h"
#include "mapjoin/solvers/frontal_cholesky.h"
#include "mapjoin/solvers/patience.h"
#include "mapjoin/solvers/pool_loop.h"
#include "mapjoin/solvers/tree_scheduler.h"

namespace mapjoin {
namespace {

using Index = std::int32_t;

/// Has memory fetch a stretch of the factor, no more of it than fits beside what is at work.
void fetch(const double* begin, const double* end) {
  constexpr std::ptrdiff_t kMost = 256, kLine = 8;  // doubles
  for (const double* p = std::max(begin, end - kMost); p < end; p += kLine) __builtin_prefetch(p);
}

}  // namespace

/// What the children leave of b comes the way the diagonal of H came when the factor was made: in
/// the last column of their update matrices.
void FrontalCholesky::forward_substitute(Index f, RhsAssembler assemble, const ThreadRoom& room) {
  double* const local = room.scratch.data();
  const Front& front = structure_->fronts[f];
  const Index rows = front.rows();
  const int row_end = (rows + kRowGroup - 1) / kRowGroup * kRowGroup;
  std::fill_n(local, row_end + 2 * rows, 0.0);
  assemble.call(assemble.object, f, local, local + row_end);
  for (const Index child : structure_->children_of(f)) {
    extend_add_diagonal(local, update_of(structure_->fronts[child], room),
                        structure_->runs_of(child));
  }
  solve_pivots_forward(panel(front), front.panel_stride, front.pivot_dim, row_end, local);
  double sum = 0.0;
  for (int j = 0; j < front.pivot_dim; ++j) sum += local[j] * local[j];
  std::copy_n(local, front.pivot_dim, other_y_.data() + front.first_scalar);
  squared_y_[static_cast<std::size_t>(f)] = sum;
  std::copy(local + front.pivot_dim, local + rows, update_of(front, room).diagonal());
}

/// From the first to the last; where the factor is on disk, what has been read leaves memory again.
void FrontalCholesky::forward_substitute_fronts(Index begin, Index end, RhsAssembler assemble,
                                                const ThreadRoom& room) {
  if (begin >= end) return;
  std::int64_t used = structure_->fronts[begin].panel - first_panel_;
  for (Index f = begin; f < end; ++f) {
    forward_substitute(f, assemble, room);
    if (options_.residence.bytes >= 0) give_back_updates(f);
    const std::int64_t done = end_of_panel(structure_->fronts[f]) - first_panel_;
    if (!factor_.on_disk() || (done - used < kPanelPortion && f + 1 < end)) continue;
    factor_.leave(used, done);
    used = done;
  }
}

void FrontalCholesky::back_substitute(Index f, double* x, double* local) const {
  const Front& front = structure_->fronts[f];
  const auto& scalar_at = structure_->scalar_at;
  double* to = local + front.pivot_dim;
  for (const Index position : structure_->updates_of(f)) {
    for (Index i = scalar_at[position]; i < scalar_at[position + 1]; ++i) *to++ = x[i];
  }
  if (other_y_.empty()) {
    std::fill_n(local, front.pivot_dim, 0.0);
    *to++ = -1;
  } else {
    std::copy_n(other_y_.data() + front.first_scalar, front.pivot_dim, local);
    *to++ = 0;
  }
  const int row_end = (front.rows() + kRowGroup) / kRowGroup * kRowGroup;
  std::fill(to, local + row_end, 0.0);
  solve_pivots_backward(panel(front), front.panel_stride, front.pivot_dim, row_end, local);
  std::copy(local, local + front.pivot_dim, x + front.first_scalar);
}

/// From the last to the first; where the factor is on disk, what has been read leaves memory again.
void FrontalCholesky::substitute_fronts(Index begin, Index end, double* x, double* local) const {
  const auto panel_begin = [&](Index f) { return structure_->fronts[f].panel - first_panel_; };
  if (begin >= end) return;
  std::int64_t used = end_of_panel(structure_->fronts[end - 1]) - first_panel_;
  for (Index f = end; f-- > begin;) {
    const double* const columns = panel(structure_->fronts[f]);
    if (f > begin) fetch(panel(structure_->fronts[f - 1]), columns);  // is next, and lies before
    back_substitute(f, x, local);
    if (!factor_.on_disk() || (used - panel_begin(f) < kPanelPortion && f > begin)) continue;
    factor_.leave(panel_begin(f), used);
    used = panel_begin(f);
  }
}

/// Parents before children.
void FrontalCholesky::substitute_tasks(std::span<const FrontTask> tasks, double* by_position,
                                       WorkerPool& pool) const {
  const auto rows = static_cast<std::size_t>(structure_->statistics.largest_front + 2 * kRowGroup);
  // Tasks are taken in one order, each thread's own before those of others. A task waits for its
  // parent; of the tasks that are not done the first one waits for nobody, and its owner or whoever
  // took it comes to it next: so nobody waits forever.
  std::vector<Index> owner;
  share_tasks(tasks, pool.threads(), owner);
  const std::vector<Index> order = downwards(tasks, pool.threads());
  std::vector<std::atomic<bool>> taken(tasks.size()), done(tasks.size());
  pool.run([&](int thread) {
    std::vector<double> local(rows);
    for (const bool own : {true, false}) {
      for (const Index next : order) {
        const auto t = static_cast<std::size_t>(next);
        if ((owner[t] == thread) != own || taken[t].exchange(true, std::memory_order_relaxed))
          continue;
        const FrontTask& task = tasks[t];
        for (Patience patience;
             task.parent >= 0 &&
             !done[static_cast<std::size_t>(task.parent)].load(std::memory_order_acquire);)
          patience.wait();
        substitute_fronts(task.begin, task.end, by_position, local.data());
        done[t].store(true, std::memory_order_release);
      }
    }
  });
}

void FrontalCholesky::solve(Eigen::Ref<Eigen::VectorXd> x, WorkerPool& pool) const {
  const FrontalStructure& s = *structure_;
  std::vector<double> by_position(static_cast<std::size_t>(s.scalar_at.back()));
  substitute_tasks(s.tasks, by_position.data(), pool);
  constexpr int kChunk = 4096;  // variables
  const auto variables = static_cast<int>(s.order.size());
  run_chunks(variables, kChunk, loop_on(pool), [&](int first, int last) {
    for (int k = first; k < last; ++k) {
      const Index length = s.scalar_at[k + 1] - s.scalar_at[k];
      std::copy_n(by_position.data() + s.scalar_at[k], length, x.data() + s.scalar_of[s.order[k]]);
    }
  });
}

void FrontalCholesky::solve(Eigen::Ref<Eigen::VectorXd> x) const {
  WorkerPool caller_only;
  solve(x, caller_only);
}

FrontConditional FrontalCholesky::conditional(Index f) const {
  const Front& front = structure_->fronts[f];
  const double* const columns = panel(front);
  const Eigen::OuterStride<> stride(front.panel_stride);
  return {.l11 = {columns, front.pivot_dim, front.pivot_dim, stride},
          .l21 = {columns + front.pivot_dim, front.update_dim, front.pivot_dim, stride},
          .y = {columns + front.rows(), front.pivot_dim, Eigen::InnerStride<>(front.panel_stride)}};
}

void FrontalCholesky::solve_in_place(Eigen::Ref<Eigen::MatrixXd> b) const {
  const FrontalStructure& s = *structure_;
  const Eigen::Index columns = b.cols();
  Eigen::MatrixXd x(b.rows(), columns);
  const auto for_each_block = [&](auto&& body) {
    for (std::size_t k = 0; k < s.order.size(); ++k) {
      body(s.scalar_at[k], s.scalar_of[s.order[k]], s.scalar_at[k + 1] - s.scalar_at[k]);
    }
  };
  for_each_block(
      [&](Index at, Index of, Index dim) { x.middleRows(at, dim) = b.middleRows(of, dim); });

  Eigen::MatrixXd local(s.statistics.largest_front, columns);
  const auto for_each_update = [&](Index f, auto&& body) {
    Index row = 0;
    for (const Index k : s.updates_of(f)) {
      const Index dim = s.scalar_at[k + 1] - s.scalar_at[k];
      body(s.scalar_at[k], row, dim);
      row += dim;
    }
  };
  for (Index f = 0; f < static_cast<Index>(s.fronts.size()); ++f) {
    const FrontConditional front = conditional(f);
    auto pivots = x.middleRows(s.fronts[f].first_scalar, s.fronts[f].pivot_dim);
    auto updates = local.topRows(s.fronts[f].update_dim);
    front.l11.triangularView<Eigen::Lower>().solveInPlace(pivots);
    updates.noalias() = front.l21 * pivots;
    for_each_update(f, [&](Index at, Index row, Index dim) {
      x.middleRows(at, dim) -= updates.middleRows(row, dim);
    });
  }
  for (Index f = static_cast<Index>(s.fronts.size()); f-- > 0;) {
    const FrontConditional front = conditional(f);
    auto pivots = x.middleRows(s.fronts[f].first_scalar, s.fronts[f].pivot_dim);
    auto updates = local.topRows(s.fronts[f].update_dim);
    for_each_update(f, [&](Index at, Index row, Index dim) {
      updates.middleRows(row, dim) = x.middleRows(at, dim);
    });
    pivots.noalias() -= front.l21.transpose() * updates;
    front.l11.transpose().triangularView<Eigen::Upper>().solveInPlace(pivots);
  }
  for_each_block(
      [&](Index at, Index of, Index dim) { b.middleRows(of, dim) = x.middleRows(at, dim); });
}

double FrontalCholesky::log_determinant() const {
  double sum = 0;
  for (Index f = 0; f < static_cast<Index>(structure_->fronts.size()); ++f) {
    const auto l11 = conditional(f).l11;
    for (Index j = 0; j < l11.cols(); ++j) sum += 2 * std::log(l11(j, j));
  }
  return sum;
}

double FrontalCholesky::squared_norm_of_y() const {
  double sum = 0;
  for (std::size_t f = 0; f < structure_->fronts.size(); ++f) sum += squared_y_[f];
  return sum;
}

}  // namespace mapjoin
