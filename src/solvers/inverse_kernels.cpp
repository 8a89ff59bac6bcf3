#include "mapjoin/solvers/inverse_kernels.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include "mapjoin/solvers/front_merging.h"
#include "mapjoin/solvers/lanes.h"

namespace mapjoin {
namespace {

// As in front_kernels.cpp: accumulators and one column of operands fill the vector registers.
constexpr int kVectors = 3;
constexpr int kStrip = kVectors * kLanes;
constexpr int kDepth = 256;  // a strip of A of this depth stays in the cache while B goes by
constexpr int kPivotBlock = 8;
static_assert(kRowGroup % kLanes == 0);

// C (+)= alpha A B for M vectors of rows and N columns.
template <int M, int N>
void product_tile(int depth, double alpha, const double* a, std::int64_t lda, const StridedView& B,
                  double* c, std::int64_t ldc, bool add) {
  UnalignedLanes sum[M][N] = {};
  const double* b = B.data;
  for (int l = 0; l < depth; ++l, a += lda, b += B.row) {
    UnalignedLanes row[M];
#pragma GCC unroll 8
    for (int m = 0; m < M; ++m) std::memcpy(&row[m], a + m * kLanes, sizeof row[m]);
#pragma GCC unroll 8
    for (int n = 0; n < N; ++n) {
      const double factor = b[n * B.column];
#pragma GCC unroll 8
      for (int m = 0; m < M; ++m) sum[m][n] += row[m] * factor;
    }
  }
#pragma GCC unroll 8
  for (int n = 0; n < N; ++n) {
#pragma GCC unroll 8
    for (int m = 0; m < M; ++m) {
      UnalignedLanes value;
      double* const to = c + n * ldc + m * kLanes;
      std::memcpy(&value, to, sizeof value);
      value = add ? value + alpha * sum[m][n] : alpha * sum[m][n];
      std::memcpy(to, &value, sizeof value);
    }
  }
}

using ProductTile = void (*)(int, double, const double*, std::int64_t, const StridedView&, double*,
                             std::int64_t, bool);
// By (vectors of rows - 1) * kLanes + (columns - 1).
template <std::size_t... I>
constexpr std::array<ProductTile, sizeof...(I)> product_tiles(std::index_sequence<I...>) {
  return {product_tile<I / kLanes + 1, I % kLanes + 1>...};
}
constexpr auto kProductTiles = product_tiles(std::make_index_sequence<kVectors * kLanes>{});

// The same for a block of pivots: U = L^-T, row by row from the diagonal.
void invert_transposed_block(int n, const double* L, std::int64_t ldl, double* U,
                             std::int64_t ldu) {
  for (int j = 0; j < n; ++j) {
    double* const u = U + j * ldu;
    u[j] = 1.0 / L[j + j * ldl];
    for (int i = j - 1; i >= 0; --i) {
      double sum = 0.0;
      for (int k = i + 1; k <= j; ++k) sum += L[k + i * ldl] * u[k];
      u[i] = -sum / L[i + i * ldl];
    }
  }
}

}  // namespace

void multiply(int rows, int columns, int depth, double alpha, const double* A, std::int64_t lda,
              const StridedView& B, double* C, std::int64_t ldc, bool add) {
  const int row_end = (rows + kLanes - 1) / kLanes * kLanes;
  int begin = 0;
  do {
    const int part = std::min(kDepth, depth - begin);
    for (int r = 0; r < row_end; r += kStrip) {
      const int height = std::min(kStrip, row_end - r) / kLanes;
      for (int c = 0; c < columns; c += kLanes) {
        const int width = std::min(kLanes, columns - c);
        const auto shape = static_cast<std::size_t>((height - 1) * kLanes + width - 1);
        kProductTiles[shape](part, alpha, A + r + begin * lda, lda,
                             {B.data + begin * B.row + c * B.column, B.row, B.column},
                             C + r + c * ldc, ldc, add || begin > 0);
      }
    }
    begin += part;
  } while (begin < depth);
}

void invert_transposed(int n, const double* L, std::int64_t ldl, double* U, std::int64_t ldu) {
  std::fill_n(U, n * ldu, 0.0);
  for (int j = 0; j < n; j += kPivotBlock) {
    const int width = std::min(kPivotBlock, n - j);
    double* const column = U + j * ldu;
    // -U L' above the diagonal block; U is upper triangular, so a strip starts at its own column.
    for (int r = 0; r < j; r += kStrip) {
      multiply(std::min(kStrip, j - r), width, j - r, -1.0, U + r + r * ldu, ldu,
               {L + j + r * ldl, ldl, 1}, column + r, ldu, false);
    }
    double* const block = column + j;
    invert_transposed_block(width, L + j + j * ldl, ldl, block, ldu);
    for (int c = width - 1; c >= 0; --c) {  // times the block's own inverse, from the right
      double* const to = column + c * ldu;
      const double own = block[c + c * ldu];
      for (int i = 0; i < j; ++i) to[i] *= own;
      for (int k = 0; k < c; ++k) {
        const double factor = block[k + c * ldu];
        const double* const from = column + k * ldu;
        for (int i = 0; i < j; ++i) to[i] += factor * from[i];
      }
    }
  }
}

}  // namespace mapjoin
