// Dense kernels of the fronts: a partial Cholesky factorization of one front, in tiles held in
// vector registers.
//
// Storage follows one rule that makes the kernels free of remainder loops and masks: rows lie in
// groups of kRowGroup, columns start on a 64-byte boundary, and only what lies on or below the
// diagonal is meaningful. Tiles may therefore write whole row groups: above the diagonal and below
// the last row they leave values nobody reads.
//
// Each tile is computed by the same operations in the same order whoever computes it, so a front
// split among threads gives the same bits as one computed alone.
#pragma once

#include <cstdint>

#include "mapjoin/solvers/fronts.h"

namespace mapjoin {

/// A front in memory. Element (i, j), i >= j, lies at column(j)[i]; row `rows` holds the right-hand
/// side.
class FrontView {
 public:
  /// `update`: where the front's update matrix has its place.
  FrontView(const Front& front, double* panel, double* update)
      : panel_(panel),
        /// Row p of S is aligned as row p of the panel: its columns start with the row group that
        /// holds row p.
        update_(update - front.pivot_dim / kRowGroup * kRowGroup),
        pivot_dim_(front.pivot_dim),
        rows_(front.rows()),
        panel_stride_(front.panel_stride),
        update_stride_(front.update_stride) {}

  int pivot_dim() const { return pivot_dim_; }
  int rows() const { return rows_; }
  int stride() const { return panel_stride_; }
  int update_stride() const { return update_stride_; }

  double* panel() const { return panel_; }
  double* column(int j) const {
    return j < pivot_dim_ ? panel_ + static_cast<std::int64_t>(j) * panel_stride_
                          : update_ + static_cast<std::int64_t>(j - pivot_dim_) * update_stride_;
  }
  double& rhs(int j) const { return column(j)[rows_]; }

  /// Adds a block of H whose first element is (row, col). Off the diagonal it may lie on either
  /// side: what belongs above is added transposed. On the diagonal (row == col) give all of it, or
  /// its lower triangle.
  template <class Block>
  void add(int row, int col, const Block& block) const {
    if (row >= col) {
      for (int j = 0; j < block.cols(); ++j) {
        double* const to = column(col + j) + row;
        for (int i = row == col ? j : 0; i < block.rows(); ++i) to[i] += block(i, j);
      }
    } else {
      for (int i = 0; i < block.rows(); ++i) {
        double* const to = column(row + i) + col;
        for (int j = 0; j < block.cols(); ++j) to[j] += block(i, j);
      }
    }
  }
  template <class Vector>
  void add_rhs(int row, const Vector& b) const {
    for (int i = 0; i < b.size(); ++i) rhs(row + i) += b(i);
  }

 private:
  double* panel_;
  double* update_;
  int pivot_dim_;
  int rows_;
  std::int64_t panel_stride_;
  std::int64_t update_stride_;
};

/// Runs body(context, i) for i = 0 .. count - 1, in any order, perhaps on several threads; returns
/// when all are done.
struct LoopRunner {
  using Body = void (*)(void* context, int i);
  void (*run)(void* runner, int count, void* context, Body body) = nullptr;  ///< null: a plain loop
  void* runner = nullptr;
};

/// Runs body(i) for i = 0 .. count - 1, spread by `loop`.
template <class Body>
void run_loop(int count, LoopRunner loop, const Body& body) {
  if (loop.run == nullptr || count < 2) {
    for (int i = 0; i < count; ++i) body(i);
    return;
  }
  Body copy = body;
  loop.run(loop.runner, count, &copy,
           [](void* object, int i) { (*static_cast<Body*>(object))(i); });
}

/// Eliminates the pivots: L11, L21 and y in the panel, S minus its share in the update matrix.
/// `smallest[j]` is the least value that pivot j may have. Returns -1, or the first pivot that is
/// below (or NaN); the elimination goes on with 1 in its place, so that what follows is finite, if
/// meaningless.
int eliminate_pivots(const FrontView& front, const double* smallest, LoopRunner loop = {});

/// Forward substitution in one front: y = L11^-1 b in place of the pivots of `b`, b - L21 y below,
/// in rows up to a whole row group (row_end).
void solve_pivots_forward(const double* panel, std::int64_t stride, int pivots, int row_end,
                          double* b);

/// Backward substitution in one front. `x` holds, by row: y at the pivots, the update variables'
/// solution, 0 for the right-hand side row, zeros up to a whole row group (row_end). Or, where the
/// panel's own right-hand side row is y: zeros at the pivots, and -1 for that row. The pivots'
/// solution takes the place of the former.
void solve_pivots_backward(const double* panel, std::int64_t stride, int pivots, int row_end,
                           double* x);

}  // namespace mapjoin
