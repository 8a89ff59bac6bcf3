// What solving a whole ObservationSystem and solving a subtree of it have in common.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "mapjoin/graph/variable_kind.h"
#include "mapjoin/solvers/front_kernels.h"

namespace mapjoin {

/// A front as the place where measurements add their normal equations.
inline DenseTarget target_of(const FrontView& view) {
  return {view.panel(),         view.stride(), view.pivot_dim(), view.column(view.pivot_dim()),
          view.update_stride(), view.rows()};
}

/// r^T I r of a batch, summed chunk by chunk, the same whoever computes them; `loop` spreads the
/// chunks. `parts` is scratch.
template <int D>
double chi2_in_chunks(const VariableKind<D>& kind, const RelativeBatch<D>& batch,
                      std::vector<double>& parts, LoopRunner loop) {
  constexpr std::int64_t kChunk = 1024;  // measurements: fixed, so that sums are
  const auto size = static_cast<std::int64_t>(batch.size);
  parts.assign(static_cast<std::size_t>((size + kChunk - 1) / kChunk), 0.0);
  run_loop(static_cast<int>(parts.size()), loop, [&](int c) {
    const std::int64_t first = c * kChunk;
    RelativeBatch<D> part = batch;
    part.size = static_cast<std::size_t>(std::min(kChunk, size - first));
    part.following += batch.size - static_cast<std::size_t>(first) - part.size;
    part.id += first;
    part.slots += 2 * first;
    parts[static_cast<std::size_t>(c)] = kind.chi2_relative(part);
  });
  double sum = 0.0;
  for (const double p : parts) sum += p;
  return sum;
}

}  // namespace mapjoin
