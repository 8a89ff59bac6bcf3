// A subtree on its own: what it says of the variables it shares with the rest.

#include <algorithm>

#include "mapjoin/solvers/extend_add.h"
#include "mapjoin/solvers/front_layout.h"
#include "mapjoin/solvers/frontal_cholesky.h"

namespace mapjoin {
namespace {

using Index = std::int32_t;

constexpr double kSmallestHeldPivot = 1e-13;

}  // namespace

Eigen::Map<const Eigen::MatrixXd, 0, Eigen::OuterStride<>> FrontalCholesky::update_matrix(
    Index root) const {
  const Front& front = structure_->fronts[root];
  const UpdateMatrix S = update_of(front, rooms_[0]);
  return {S.column(0), S.size(), S.size(), Eigen::OuterStride<>(front.update_stride)};
}

bool FrontalCholesky::close_subtree(Index first, Index root, std::span<const Index> held,
                                    std::span<double> by_position, double& decrease,
                                    WorkerPool& pool) {
  const FrontalStructure& s = *structure_;
  const Index q = s.fronts[root].update_dim;
  const Index row_end = (q + kRowGroup) / kRowGroup * kRowGroup;  // with the right-hand side row
  decrease = 0;
  for (Index f = first; f <= root; ++f) decrease += squared_y_[static_cast<std::size_t>(f)];
  if (q > 0) {
    // A front of its own, all pivots.
    Front front;
    front.pivot_dim = q;
    front.panel_stride = row_end;
    const std::int64_t size = std::int64_t{row_end} * (q + 3);
    double* const memory = closing_.require(size);
    const FrontView view(front, memory, memory);
    const UpdateMatrix S = update_of(s.fronts[root], rooms_[0]);
    for (Index j = 0; j < q; ++j) {
      double* const to = view.column(j);
      std::fill(to, to + row_end, 0.0);
      std::copy(S.column(j) + j, S.column(j) + q + 1, to + j);
    }
    if (options_.residence.bytes >= 0) give_back_update(s.fronts[root]);
    for (const Index row : held) view.column(row)[row] += std::max(S.diagonal()[row], 1e-300);
    double* const smallest = memory + std::int64_t{row_end} * q;
    for (Index j = 0; j < q; ++j) smallest[j] = kSmallestHeldPivot * S.diagonal()[j];
    if (eliminate_pivots(view, smallest) >= 0) return false;
    for (Index j = 0; j < q; ++j) decrease += view.rhs(j) * view.rhs(j);
    double* const x = smallest + row_end;
    std::fill_n(x, q, 0.0);
    x[q] = -1;
    std::fill(x + q + 1, x + row_end, 0.0);
    solve_pivots_backward(view.panel(), front.panel_stride, q, row_end, x);
    const double* from = x;
    for (const Index position : s.updates_of(root)) {
      for (Index i = s.scalar_at[position]; i < s.scalar_at[position + 1]; ++i)
        by_position[i] = *from++;
    }
    if (options_.residence.bytes >= 0) closing_.give_back(0, size);
  }
  if (pool.threads() == 1) {
    substitute_fronts(first, root + 1, by_position.data(), rooms_[0].scratch.data());
  } else {
    substitute_tasks(tasks_of_subtree(s, first, root), by_position.data(), pool);
  }
  return true;
}

}  // namespace mapjoin
