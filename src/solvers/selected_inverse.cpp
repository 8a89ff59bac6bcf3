#include "mapjoin/solvers/selected_inverse.h"

#include <algorithm>
#include <vector>

#include "mapjoin/solvers/inverse_kernels.h"

namespace mapjoin {
namespace {

using Index = std::int32_t;

int row_groups(int rows) { return (rows + kRowGroup - 1) / kRowGroup * kRowGroup; }

/// Z of one front: its update variables first, then its pivots; both triangles.
class DenseInverse {
 public:
  void resize(int pivots, int updates) {
    p_ = pivots;
    q_ = updates;
    ld_ = row_groups(q_ + row_groups(p_));
    z_.resize(std::max(z_.size(), static_cast<std::size_t>(ld_ * (p_ + q_))));
    u_.resize(std::max(u_.size(), static_cast<std::size_t>(row_groups(p_) * p_)));
    l21_.resize(std::max(l21_.size(), static_cast<std::size_t>(row_groups(q_) * p_)));
    w_.resize(std::max(w_.size(), l21_.size()));
  }

  double* column(int j) { return z_.data() + j * ld_; }
  /// Row (and column) of the front's row: pivots come first there.
  int row_of(int front_row) const { return front_row < p_ ? q_ + front_row : front_row - p_; }

  /// The rest of Z, from Z22 in the first columns.
  void complete(const FrontConditional& front) {
    const std::int64_t ldu = row_groups(p_);
    invert_transposed(p_, front.l11.data(), front.l11.outerStride(), u_.data(), ldu);
    if (q_ > 0) couple(front);
    double* const z11 = column(q_) + q_;
    for (int c = 0; c < p_; c += kRowGroup) {
      const int width = std::min(kRowGroup, p_ - c);
      double* const to = z11 + c + c * ld_;
      const double* const u = u_.data() + c + c * ldu;
      multiply(p_ - c, width, p_ - c, 1.0, u, ldu, {u, ldu, 1}, to, ld_, false);
      if (q_ > 0) {
        const std::int64_t ldw = row_groups(q_);
        multiply(p_ - c, width, q_, 1.0, column(0) + q_ + c, ld_, {w_.data() + c * ldw, 1, ldw}, to,
                 ld_, true);
      }
    }
    for (int j = 0; j < p_; ++j) {
      for (int i = 0; i < j; ++i) z11[i + j * ld_] = z11[j + i * ld_];
    }
  }

 private:
  /// -W, Z21 and its transpose.
  void couple(const FrontConditional& front) {
    const std::int64_t ldu = row_groups(p_), ldw = row_groups(q_);
    for (int j = 0; j < p_; ++j)
      std::copy_n(front.l21.data() + j * front.l21.outerStride(), q_, l21_.data() + j * ldw);
    for (int c = 0; c < p_; c += kRowGroup) {
      const int width = std::min(kRowGroup, p_ - c);
      multiply(q_, width, p_ - c, -1.0, l21_.data() + c * ldw, ldw,
               {u_.data() + c + c * ldu, ldu, 1}, w_.data() + c * ldw, ldw, false);
    }
    multiply(q_, p_, q_, 1.0, column(0), ld_, {w_.data(), 1, ldw}, column(q_), ld_, false);
    for (int j = 0; j < p_; ++j) {
      const double* const from = column(q_ + j);
      double* const to = column(0) + q_ + j;
      for (int i = 0; i < q_; ++i) to[i * ld_] = from[i];
    }
  }

  int p_ = 0, q_ = 0;
  std::int64_t ld_ = 0;
  std::vector<double> z_, u_, l21_, w_;
};

/// Which fronts hold a wanted variable, or lie above one that does.
std::vector<char> wanted_fronts(const FrontalStructure& s, std::span<const std::int64_t> place) {
  std::vector<char> wanted(s.fronts.size(), 0);
  for (std::size_t f = 0; f < s.fronts.size(); ++f) {
    for (Index k = s.fronts[f].first_position; k < s.fronts[f].end_position; ++k)
      wanted[f] |= place[static_cast<std::size_t>(s.order[k])] >= 0;
    if (wanted[f] && s.fronts[f].parent >= 0) wanted[s.fronts[f].parent] = 1;
  }
  return wanted;
}

}  // namespace

void selected_inverse(const FrontalCholesky& factor, std::span<const std::int64_t> place,
                      double* out) {
  const FrontalStructure& s = factor.structure();
  const std::vector<char> wanted = wanted_fronts(s, place);
  DenseInverse Z;
  std::vector<double> waiting;  // Z22 of fronts to come, the next one last
  std::vector<Index> row;
  // Children are handed their Z22 in ascending order and come up in descending order, each with its
  // whole subtree: so what waits is a stack.
  for (Index f = static_cast<Index>(s.fronts.size()); f-- > 0;) {
    if (!wanted[f]) continue;
    const Front& front = s.fronts[f];
    const int p = front.pivot_dim, q = front.update_dim;
    Z.resize(p, q);
    const std::size_t top =
        waiting.size() - static_cast<std::size_t>(q) * static_cast<std::size_t>(q);
    const double* from = waiting.data() + top;
    for (int j = 0; j < q; ++j, from += q) std::copy_n(from, q, Z.column(j));
    waiting.resize(top);
    Z.complete(factor.conditional(f));

    for (Index k = front.first_position; k < front.end_position; ++k) {
      const Index v = s.order[k];
      const std::int64_t at = place[static_cast<std::size_t>(v)];
      if (at < 0) continue;
      const int dim = s.dims[v], first = q + s.scalar_at[k] - front.first_scalar;
      for (int j = 0; j < dim; ++j)
        std::copy_n(Z.column(first + j) + first, dim, out + at + j * dim);
    }
    for (const Index child : s.children_of(f)) {
      if (!wanted[child]) continue;
      const int size = s.fronts[child].update_dim;
      row.resize(static_cast<std::size_t>(size));
      for (const RowRun& run : s.runs_of(child)) {
        for (int i = run.from; i < std::min(run.from + run.length, size); ++i)
          row[i] = Z.row_of(run.to + i - run.from);
      }
      std::size_t at = waiting.size();
      waiting.resize(at + static_cast<std::size_t>(size) * static_cast<std::size_t>(size));
      for (int j = 0; j < size; ++j) {
        const double* const column = Z.column(row[j]);
        for (int i = 0; i < size; ++i) waiting[at++] = column[row[i]];
      }
    }
  }
}

}  // namespace mapjoin
