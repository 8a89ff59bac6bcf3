#include "mapjoin/solvers/front_kernels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "mapjoin/solvers/lanes.h"

namespace mapjoin {
namespace {

using ColumnStride = std::int64_t;

// The widest tile whose accumulators, with one column of operands, fit the vector registers: 24 x 8
// in the 32 registers of AVX-512, else 12 x 4.
constexpr int kTileColumns = kLanes;
constexpr int kTileVectors = 3;
constexpr int kTileRows = kTileVectors * kLanes;
constexpr int kBlockColumns = 64;  // pivots eliminated before the rest of the front is updated
static_assert(kRowGroup % kLanes == 0 && kBlockColumns % kTileColumns == 0);

inline Lanes* lanes(double* p) { return reinterpret_cast<Lanes*>(p); }
inline const Lanes* lanes(const double* p) { return reinterpret_cast<const Lanes*>(p); }

template <int M, int N>
struct Tile {
  Lanes v[M][N];  // M vectors of rows, N columns

  void load(const double* c, ColumnStride ld) {
#pragma GCC unroll 8
    for (int n = 0; n < N; ++n) {
#pragma GCC unroll 8
      for (int m = 0; m < M; ++m) v[m][n] = lanes(c + n * ld)[m];
    }
  }

  void store(double* c, ColumnStride ld) const {
#pragma GCC unroll 8
    for (int n = 0; n < N; ++n) {
#pragma GCC unroll 8
      for (int m = 0; m < M; ++m) lanes(c + n * ld)[m] = v[m][n];
    }
  }

  // Subtracts A B', A of M vectors of rows and B of N rows, both with `depth` columns.
  void subtract_product(const double* a, const double* b, ColumnStride ld, int depth) {
    for (int l = 0; l < depth; ++l, a += ld, b += ld) {
      Lanes row[M];
#pragma GCC unroll 8
      for (int m = 0; m < M; ++m) row[m] = lanes(a)[m];
#pragma GCC unroll 8
      for (int n = 0; n < N; ++n) {
        const double factor = b[n];
#pragma GCC unroll 8
        for (int m = 0; m < M; ++m) v[m][n] -= row[m] * factor;
      }
    }
  }

  // Column j, times `inverse` of its pivot, is final; takes its share off the later columns.
  // `pivot_row(n)` is L(n, j).
  template <class PivotRow>
  void finish_column(int j, double inverse, PivotRow pivot_row) {
#pragma GCC unroll 8
    for (int m = 0; m < M; ++m) v[m][j] *= inverse;
#pragma GCC unroll 8
    for (int n = j + 1; n < N; ++n) {
      const double factor = pivot_row(n);
#pragma GCC unroll 8
      for (int m = 0; m < M; ++m) v[m][n] -= v[m][j] * factor;
    }
  }
};

// C -= A B'.
template <int M, int N>
void update_tile(double* c, ColumnStride c_stride, const double* a, const double* b,
                 ColumnStride ld, int depth) {
  Tile<M, N> tile;
  tile.load(c, c_stride);
  tile.subtract_product(a, b, ld, depth);
  tile.store(c, c_stride);
}

// Rows below the pivots: C = (C - A B') L^-T. `diagonal` points to the pivots' own tile, `b` to its
// rows of earlier columns.
template <int M, int N>
void solve_tile(double* c, const double* a, const double* b, ColumnStride ld, int depth,
                const double* diagonal, const double* inverse) {
  Tile<M, N> tile;
  tile.load(c, ld);
  tile.subtract_product(a, b, ld, depth);
#pragma GCC unroll 8
  for (int j = 0; j < N; ++j) {
    tile.finish_column(j, inverse[j], [&](int n) { return diagonal[j * ld + n]; });
  }
  tile.store(c, ld);
}

// The pivots' own rows (the first ones of the tile) and rows just below. Returns the first pivot
// that is too small, or -1.
template <int M, int N>
int pivot_tile(double* c, const double* a, ColumnStride ld, int depth, const double* smallest,
               double* inverse) {
  Tile<M, N> tile;
  tile.load(c, ld);
  tile.subtract_product(a, a, ld, depth);
  int failed = -1;
#pragma GCC unroll 8
  for (int j = 0; j < N; ++j) {
    double pivot = tile.v[0][j][j];
    if (!(pivot > smallest[j])) [[unlikely]] {
      if (failed < 0) failed = j;
      pivot = 1;
      tile.v[0][j][j] = 1;
    }
    inverse[j] = 1 / std::sqrt(pivot);
    tile.finish_column(j, inverse[j], [&](int n) { return tile.v[0][j][n]; });
  }
  tile.store(c, ld);
  return failed;
}

using UpdateTile = void (*)(double*, ColumnStride, const double*, const double*, ColumnStride, int);
using SolveTile = void (*)(double*, const double*, const double*, ColumnStride, int, const double*,
                           const double*);
using PivotTile = int (*)(double*, const double*, ColumnStride, int, const double*, double*);

// Kernels by (vectors of rows - 1) * kTileColumns + (columns - 1).
template <std::size_t... I>
constexpr std::array<UpdateTile, sizeof...(I)> update_tiles(std::index_sequence<I...>) {
  return {update_tile<I / kTileColumns + 1, I % kTileColumns + 1>...};
}
template <std::size_t... I>
constexpr std::array<SolveTile, sizeof...(I)> solve_tiles(std::index_sequence<I...>) {
  return {solve_tile<I / kTileColumns + 1, I % kTileColumns + 1>...};
}
template <std::size_t... I>
constexpr std::array<PivotTile, sizeof...(I)> pivot_tiles(std::index_sequence<I...>) {
  return {pivot_tile<I / kTileColumns + 1, I % kTileColumns + 1>...};
}
using TileShapes = std::make_index_sequence<kTileVectors * kTileColumns>;
constexpr auto kUpdateTiles = update_tiles(TileShapes{});
constexpr auto kSolveTiles = solve_tiles(TileShapes{});
constexpr auto kPivotTiles = pivot_tiles(TileShapes{});

int tile_shape(int rows, int columns) { return (rows / kLanes - 1) * kTileColumns + columns - 1; }
int whole_vectors(int rows) { return (rows + kLanes - 1) / kLanes * kLanes; }
int vector_of(int rows) { return rows / kLanes * kLanes; }

// One front under elimination: the state shared by the steps below.
struct Elimination {
  const FrontView& front;
  int row_end;    // rows with the right-hand side, in whole vectors
  int first = 0;  // the current block of pivots: columns first .. last - 1
  int last = 0;
  int below = 0;  // first row not finished together with the pivots
  alignas(64)
      std::array<double, kBlockColumns> inverse = {};  // of the block's pivots on the diagonal of L

  double* at(int row, int column) const {
    return front.panel() + column * ColumnStride{front.stride()} + row;
  }

  // Rows first .. below - 1 of the block's columns, with the pivots themselves.
  int factor_pivots(const double* smallest) {
    const int columns = last - first;
    below = std::min(row_end, columns <= kTileColumns ? first + kTileRows : whole_vectors(last));
    int failed = -1;
    for (int c = first; c < last; c += kTileColumns) {
      const int width = std::min(kTileColumns, last - c);
      const int height = std::min(kTileRows, below - c);
      const int bad =
          kPivotTiles[tile_shape(height, width)](at(c, c), at(c, first), front.stride(), c - first,
                                                 smallest + c, inverse.data() + (c - first));
      if (bad >= 0 && failed < 0) failed = c + bad;
      for (int r = c + height; r < below; r += kTileRows)
        solve(r, std::min(kTileRows, below - r), c, width);
    }
    return failed;
  }

  void solve(int row, int height, int column, int width) const {
    kSolveTiles[tile_shape(height, width)](at(row, column), at(row, first), at(column, first),
                                           front.stride(), column - first, at(column, column),
                                           inverse.data() + (column - first));
  }

  int strips_below() const { return (row_end - below + kTileRows - 1) / kTileRows; }

  // Finishes one strip of rows below the pivots in all columns of the block.
  void solve_strip(int strip) const {
    const int row = below + strip * kTileRows;
    const int height = std::min(kTileRows, row_end - row);
    for (int c = first; c < last; c += kTileColumns)
      solve(row, height, c, std::min(kTileColumns, last - c));
  }

  int strips_right() const { return (row_end - vector_of(last) + kTileRows - 1) / kTileRows; }

  // Takes the block's share off one strip of rows in all columns right of it. Long strips come
  // first, for balance.
  void update_strip(int strip) const {
    const int row = vector_of(last) + (strips_right() - 1 - strip) * kTileRows;
    const int row_stop = std::min(row + kTileRows, row_end);
    update_columns(row, row_stop, last, std::min(front.pivot_dim(), row_stop), front.stride());
    update_columns(row, row_stop, front.pivot_dim(), std::min(front.rows(), row_stop),
                   front.update_stride());
  }

  void update_columns(int row, int row_stop, int begin, int end, ColumnStride c_stride) const {
    double* to = begin < end ? front.column(begin) : nullptr;
    for (int c = begin; c < end; c += kTileColumns, to += kTileColumns * c_stride) {
      const int top = std::max(row, vector_of(c));
      kUpdateTiles[tile_shape(row_stop - top, std::min(kTileColumns, end - c))](
          to + top, c_stride, at(top, first), at(c, first), front.stride(), last - first);
    }
  }

  template <void (Elimination::*Step)(int) const>
  void for_each_strip(int count, const LoopRunner& loop) {
    if (loop.run == nullptr || count < 2) {
      for (int i = 0; i < count; ++i) (this->*Step)(i);
    } else {
      loop.run(loop.runner, count, this,
               [](void* self, int i) { (static_cast<Elimination*>(self)->*Step)(i); });
    }
  }
};

}  // namespace

int eliminate_pivots(const FrontView& front, const double* smallest, LoopRunner loop) {
  Elimination step{.front = front, .row_end = whole_vectors(front.rows() + 1)};
  int failed = -1;
  for (step.first = 0; step.first < front.pivot_dim(); step.first = step.last) {
    step.last = std::min(step.first + kBlockColumns, front.pivot_dim());
    const int bad = step.factor_pivots(smallest);
    if (failed < 0) failed = bad;
    step.for_each_strip<&Elimination::solve_strip>(step.strips_below(), loop);
    step.for_each_strip<&Elimination::update_strip>(step.strips_right(), loop);
  }
  return failed;
}

}  // namespace mapjoin
