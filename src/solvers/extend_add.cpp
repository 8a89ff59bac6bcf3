#include "mapjoin/solvers/extend_add.h"

#include <cstring>

#if defined(__AVX512VL__)
#include <immintrin.h>
#endif

namespace mapjoin {
namespace {

#if defined(__AVX512VL__)

// Runs are often one or two blocks long. Masks add them without a branch on the length.
inline void add_run(double* to, const double* from, int n) {
  for (; n > 8; n -= 8, to += 8, from += 8) {
    _mm512_storeu_pd(to, _mm512_add_pd(_mm512_loadu_pd(to), _mm512_loadu_pd(from)));
  }
  const auto mask = static_cast<__mmask8>((1u << n) - 1);
  const __m512d sum =
      _mm512_add_pd(_mm512_maskz_loadu_pd(mask, to), _mm512_maskz_loadu_pd(mask, from));
  _mm512_mask_storeu_pd(to, mask, sum);
}

#else

// A typedef inside a template: an alias would silently lose an attribute that depends on a
// parameter.
template <int N>
struct VectorOf {
  typedef double type __attribute__((vector_size(N * sizeof(double))));
};

template <int N>
inline void add_fixed(double* to, const double* from) {
  using Vector = typename VectorOf<N>::type;
  Vector a;
  Vector b;
  std::memcpy(&a, to, sizeof a);
  std::memcpy(&b, from, sizeof b);
  a += b;
  std::memcpy(to, &a, sizeof a);
}

// Runs are often one or two blocks long: no loop set-up for those.
inline void add_run(double* to, const double* from, int n) {
  for (; n >= 4; n -= 4, to += 4, from += 4) add_fixed<4>(to, from);
  if (n & 2) {
    add_fixed<2>(to, from);
    to += 2;
    from += 2;
  }
  if (n & 1) *to += *from;
}

#endif

}  // namespace

void extend_add(const FrontView& front, const UpdateMatrix& child, std::span<const RowRun> runs,
                int begin, int end) {
  for (std::size_t r = 0; r < runs.size(); ++r) {
    const RowRun& run = runs[r];
    const int shift = run.to - run.from;
    const int stop = std::min({run.to + run.length, child.size() + shift, end});
    for (int j = std::max(run.to, begin); j < stop; ++j) {
      double* const to = front.column(j);
      const double* const from = child.column(j - shift);
      add_run(to + j, from + (j - shift), run.to + run.length - j);
      for (const RowRun& below : runs.subspan(r + 1))
        add_run(to + below.to, from + below.from, below.length);
    }
    if (run.to + run.length >= end) return;
  }
}

void extend_add_diagonal(double* diagonal, const UpdateMatrix& child,
                         std::span<const RowRun> runs) {
  for (const RowRun& run : runs) {
    add_run(diagonal + run.to, child.diagonal() + run.from,
            std::min(run.length, child.size() - run.from));
  }
}

}  // namespace mapjoin
