// Substitution in one front, a row group of pivots at a time: what lies below a block then begins
// with a row group, and x is loaded in the same vectors in which it was stored.

#include <algorithm>
#include <array>
#include <utility>

#include "mapjoin/solvers/front_kernels.h"
#include "mapjoin/solvers/lanes.h"

namespace mapjoin {
namespace {

static_assert(kRowGroup % kLanes == 0);

inline const UnalignedLanes& lanes(const double* p) {
  return *reinterpret_cast<const UnalignedLanes*>(p);
}
inline UnalignedLanes& lanes(double* p) { return *reinterpret_cast<UnalignedLanes*>(p); }

inline double sum_of(const UnalignedLanes& v) {
  double sum = (v[0] + v[2]) + (v[1] + v[3]);
  if constexpr (kLanes == 8) sum += (v[4] + v[6]) + (v[5] + v[7]);
  return sum;
}

// `panel` and `x` from the first row of the block on; row_end likewise.
template <int Columns>
void backward_block(const double* panel, std::int64_t stride, int row_end, double* x) {
  // Enough sums to hide how long each addition takes, no more than there are registers for.
  constexpr int kSums = Columns <= 4 ? kRowGroup / kLanes : 1;
  UnalignedLanes part[Columns][kSums] = {};
  double inverse[Columns];  // while the sums are formed: a division takes as long
  for (int n = 0; n < Columns; ++n) inverse[n] = 1.0 / panel[n * stride + n];
  for (int i = kRowGroup; i < row_end; i += kSums * kLanes) {
#pragma GCC unroll 2
    for (int k = 0; k < kSums; ++k) {
      const UnalignedLanes here = lanes(x + i + k * kLanes);
#pragma GCC unroll 8
      for (int n = 0; n < Columns; ++n)
        part[n][k] += lanes(panel + n * stride + i + k * kLanes) * here;
    }
  }
  double here[kRowGroup];
  std::copy_n(x, kRowGroup, here);
#pragma GCC unroll 8
  for (int n = Columns - 1; n >= 0; --n) {
    double sum = sum_of(part[n][0]) - here[n];
    if constexpr (kSums == 2) sum += sum_of(part[n][1]);
#pragma GCC unroll 8
    for (int i = kRowGroup - 1; i > n; --i) sum += panel[n * stride + i] * here[i];
    here[n] = -sum * inverse[n];
  }
  std::copy_n(here, kRowGroup, x);
}

template <int Columns>
void forward_block(const double* panel, std::int64_t stride, int row_end, double* b) {
  double inverse[Columns];
  for (int n = 0; n < Columns; ++n) inverse[n] = 1.0 / panel[n * stride + n];
  double here[kRowGroup];
  std::copy_n(b, kRowGroup, here);
#pragma GCC unroll 8
  for (int n = 0; n < Columns; ++n) {
    here[n] *= inverse[n];
#pragma GCC unroll 8
    for (int i = n + 1; i < kRowGroup; ++i) here[i] -= panel[n * stride + i] * here[n];
  }
  std::copy_n(here, kRowGroup, b);
  for (int i = kRowGroup; i < row_end; i += kLanes) {
    UnalignedLanes rest = lanes(b + i);
#pragma GCC unroll 8
    for (int n = 0; n < Columns; ++n) rest -= lanes(panel + n * stride + i) * here[n];
    lanes(b + i) = rest;
  }
}

using Block = void (*)(const double*, std::int64_t, int, double*);

template <std::size_t... I>
constexpr std::array<Block, sizeof...(I)> backward_blocks(std::index_sequence<I...>) {
  return {backward_block<I + 1>...};
}
template <std::size_t... I>
constexpr std::array<Block, sizeof...(I)> forward_blocks(std::index_sequence<I...>) {
  return {forward_block<I + 1>...};
}
using Widths = std::make_index_sequence<kRowGroup>;
constexpr auto kBackward = backward_blocks(Widths{});
constexpr auto kForward = forward_blocks(Widths{});

}  // namespace

void solve_pivots_forward(const double* panel, std::int64_t stride, int pivots, int row_end,
                          double* b) {
  for (int c = 0; c < pivots; c += kRowGroup) {
    const int width = std::min(kRowGroup, pivots - c);
    kForward[static_cast<std::size_t>(width - 1)](panel + c * stride + c, stride, row_end - c,
                                                  b + c);
  }
}

void solve_pivots_backward(const double* panel, std::int64_t stride, int pivots, int row_end,
                           double* x) {
  for (int c = (pivots - 1) / kRowGroup * kRowGroup; c >= 0; c -= kRowGroup) {
    const int width = std::min(kRowGroup, pivots - c);
    kBackward[static_cast<std::size_t>(width - 1)](panel + c * stride + c, stride, row_end - c,
                                                   x + c);
  }
}

}  // namespace mapjoin
