#include "mapjoin/solvers/aligned_buffer.h"

#include <cstdlib>
#include <new>

#if defined(__linux__)
#include <sys/mman.h>
#include <unistd.h>
#endif

namespace mapjoin {
namespace {

constexpr std::size_t kCacheLine = 64;
constexpr std::size_t kHugePage = std::size_t{1} << 21;

#if defined(__linux__)
std::uintptr_t page_size() {
  static const auto size = static_cast<std::uintptr_t>(sysconf(_SC_PAGESIZE));
  return size;
}
#endif

#if defined(__linux__) && defined(MADV_POPULATE_WRITE)
// All pages at once: a fault each costs several times as much.
void populate(void* memory, std::size_t bytes) {
  constexpr std::size_t kWorthACall = std::size_t{1} << 16;
  if (bytes < kWorthACall) return;
  const std::uintptr_t page = page_size();
  const auto first = reinterpret_cast<std::uintptr_t>(memory) / page * page;
  const auto last = (reinterpret_cast<std::uintptr_t>(memory) + bytes) / page * page;
  static_cast<void>(madvise(reinterpret_cast<void*>(first), last - first, MADV_POPULATE_WRITE));
}
#else
void populate(void*, std::size_t) {}
#endif

std::size_t whole_units(std::size_t bytes, std::size_t unit) {
  return (bytes + unit - 1) / unit * unit;
}

}  // namespace

void AlignedBuffer::Free::operator()(double* p) const noexcept { std::free(p); }

double* AlignedBuffer::require(std::int64_t size) {
  if (size <= size_) return data();
  data_.reset();
  size_ = 0;
  const std::size_t bytes = static_cast<std::size_t>(size) * sizeof(double);
  const bool huge = bytes >= kHugePage;
  const std::size_t unit = huge ? kHugePage : kCacheLine;
  void* const memory = std::aligned_alloc(unit, whole_units(bytes, unit));
  if (memory == nullptr) throw std::bad_alloc();
#if defined(__linux__)
  // Advice only: where it is refused, small pages do.
  if (huge) {
    static_cast<void>(madvise(memory, whole_units(bytes, unit), MADV_HUGEPAGE));
  } else {
    populate(memory, bytes);
  }
#endif
  data_.reset(static_cast<double*>(memory));
  size_ = size;
  return data();
}

void AlignedBuffer::give_back(std::int64_t begin, std::int64_t end) {
#if defined(__linux__)
  const std::uintptr_t page = page_size();
  const auto first = (reinterpret_cast<std::uintptr_t>(data() + begin) + page - 1) / page * page;
  const auto last = reinterpret_cast<std::uintptr_t>(data() + end) / page * page;
  if (first < last)
    static_cast<void>(madvise(reinterpret_cast<void*>(first), last - first, MADV_DONTNEED));
#else
  static_cast<void>(begin);
  static_cast<void>(end);
#endif
}

}  // namespace mapjoin
