// Adds a child's update matrix to its parent's front.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <type_traits>

#include "mapjoin/solvers/front_kernels.h"
#include "mapjoin/solvers/fronts.h"

namespace mapjoin {

/// S of a front at its place in memory: element (i, j), i >= j, is column(j)[i]; row size() is the
/// right-hand side. A last column holds the diagonal of H, as assembled so far, for these rows:
/// pivots are judged by it.
class UpdateMatrix {
 public:
  UpdateMatrix(const Front& front, double* place)
      : begin_(place + front.pivot_dim % kRowGroup),
        stride_(front.update_stride),
        size_(front.update_dim) {}

  int size() const { return size_; }
  double* column(int j) const { return begin_ + j * stride_; }
  double* diagonal() const { return begin_ + size_ * stride_; }

 private:
  double* begin_;
  std::int64_t stride_;
  int size_;
};

/// Adds those columns of the child that fall on the front's columns begin .. end - 1. `runs` says
/// where its rows go.
void extend_add(const FrontView& front, const UpdateMatrix& child, std::span<const RowRun> runs,
                int begin, int end);

/// The same for the diagonal of H, all of it, into an array over the front's rows.
void extend_add_diagonal(double* diagonal, const UpdateMatrix& child, std::span<const RowRun> runs);

/// Calls body(begin, end) for ranges that make up 0 .. columns - 1: one range, or several to be
/// shared by `loop`.
template <class Body>
void for_each_column_range(int columns, LoopRunner loop, Body&& body) {
  if (loop.run == nullptr) {
    body(0, columns);
    return;
  }
  constexpr int kColumns = 32;
  struct Context {
    std::remove_reference_t<Body>* body;
    int columns;
  } context{&body, columns};
  loop.run(loop.runner, (columns + kColumns - 1) / kColumns, &context, [](void* object, int i) {
    const auto& c = *static_cast<Context*>(object);
    (*c.body)(i * kColumns, std::min((i + 1) * kColumns, c.columns));
  });
}

}  // namespace mapjoin
