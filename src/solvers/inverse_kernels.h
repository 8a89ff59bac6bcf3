// Dense kernels of selected inversion: products of column-major matrices, in tiles held in vector
// registers.
//
// As in the fronts, tiles write whole groups of kRowGroup rows, so there are no remainder loops:
// room for them must be there, and what lies below the last row afterwards means nothing.
#pragma once

#include <cstdint>

namespace mapjoin {

/// A matrix in memory, element (i, j) at data[i * row + j * column].
struct StridedView {
  const double* data = nullptr;
  std::int64_t row = 1;
  std::int64_t column = 0;
};

/// C = alpha A B, or C += alpha A B when `add`. A is rows x depth and C rows x columns, both
/// column-major with leading dimensions `lda` and `ldc`; B is depth x columns with any strides.
/// Rows of A and C are touched up to the next multiple of kRowGroup. C must not overlap A or B.
void multiply(int rows, int columns, int depth, double alpha, const double* A, std::int64_t lda,
              const StridedView& B, double* C, std::int64_t ldc, bool add);

/// U = L^-T for a lower triangular L (n x n, leading dimension ldl): upper triangular, zeros below.
/// `ldu` is n rounded up to whole row groups.
void invert_transposed(int n, const double* L, std::int64_t ldl, double* U, std::int64_t ldu);

}  // namespace mapjoin
