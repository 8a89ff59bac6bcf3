#include "mapjoin/joining/memory_limit.h"

#include <fmt/format.h>

#include <algorithm>

#include "mapjoin/joining/process_memory.h"

namespace mapjoin {

namespace {

constexpr std::int64_t kMiB = std::int64_t{1} << 20;
constexpr std::int64_t kSmallest = 16 * kMiB;  // portions that are being written
/// Besides the factor a solve takes increments, the values before the step and scratch: doubles a
/// scalar.
constexpr std::int64_t kDoublesPerScalar = 8;

}  // namespace

FactorResidence factor_residence(const JoinOptions& options, const FactorStatistics& statistics,
                                 int holders) {
  if (options.memory_limit <= 0) return {};
  const std::int64_t largest = statistics.largest_front;
  // A thread has a stack for subtrees of its own, which it keeps, and one for the root's factor.
  const std::int64_t each =
      statistics.live_update_bytes + statistics.stack_bytes + largest * largest * 8 + kSmallest;
  const std::int64_t needed =
      resident_memory() + statistics.scalars * kDoublesPerScalar * 8 + each * threads_of(options);
  // A twentieth is for what allocators keep.
  const std::int64_t room = options.memory_limit - options.memory_limit / 20 - needed;
  return {.bytes = std::max(room / holders, kSmallest), .directory = options.scratch};
}

void note_excess(const JoinOptions& options, JoinReport& report) {
  if (options.memory_limit <= 0) return;
  const std::int64_t peak = peak_memory();
  if (peak <= options.memory_limit) return;
  report.notes.push_back(
      fmt::format("the memory limit of {} MiB was too small, {} MiB were in use: measurements, "
                  "values and the dense matrices at hand have to be in memory",
                  options.memory_limit / kMiB, (peak + kMiB - 1) / kMiB));
}

}  // namespace mapjoin
