#include "mapjoin/solvers/factor_memory.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <mutex>
#include <string>
#include <utility>

#include "mapjoin/graph/error.h"

namespace mapjoin {

namespace {

std::int64_t page_size() {
  static const auto size = static_cast<std::int64_t>(sysconf(_SC_PAGESIZE));
  return size;
}

}  // namespace

/// An open file without a name, all of it mapped.
struct FactorMemory::File {
  struct Range {
    std::int64_t begin, end;  // bytes
  };

  File(const std::filesystem::path& directory, std::int64_t size, std::int64_t most_resident)
      : bytes(size), limit(most_resident), where(directory.string()) {
    std::string name = (directory / "mapjoin_factor_XXXXXX").string();
    descriptor = mkstemp(name.data());
    if (descriptor < 0) fail("cannot make a file for the factor");
    unlink(name.c_str());
    // Reserved now: a disk that turns out to be full later would end the program.
    const int reserved = posix_fallocate(descriptor, 0, bytes);
    if (reserved != 0) {
      errno = reserved;
      close(descriptor);
      fail(fmt::format("cannot reserve {} MiB for the factor", bytes >> 20));
    }
    address = mmap(nullptr, static_cast<std::size_t>(bytes), PROT_READ | PROT_WRITE, MAP_SHARED,
                   descriptor, 0);
    if (address == MAP_FAILED) {
      close(descriptor);
      fail("cannot map the factor's file");
    }
  }
  ~File() {
    munmap(address, static_cast<std::size_t>(bytes));
    close(descriptor);
  }
  File(const File&) = delete;
  File& operator=(const File&) = delete;

  [[noreturn]] void fail(const std::string& what) const {
    throw Error(fmt::format("{} in {}: {}; free some space there or name another folder", what,
                            where, std::strerror(errno)));
  }

  /// Writes the range out and gives its pages back. The data stay: this is a shared mapping.
  void evict(Range range) const {
    range.begin = range.begin / page_size() * page_size();
    range.end = std::min(bytes, (range.end + page_size() - 1) / page_size() * page_size());
    auto* const first = static_cast<char*>(address) + range.begin;
    const auto length = static_cast<std::size_t>(range.end - range.begin);
    msync(first, length, MS_SYNC);
    madvise(first, length, MADV_DONTNEED);
    posix_fadvise(descriptor, range.begin, range.end - range.begin, POSIX_FADV_DONTNEED);
  }

  void settle(Range range) {
    const std::lock_guard lock(mutex);
    settled.push_back(range);
    resident += range.end - range.begin;
    while (resident > limit && !settled.empty()) {
      evict(settled.front());
      resident -= settled.front().end - settled.front().begin;
      settled.pop_front();
    }
  }

  std::int64_t bytes;
  std::int64_t limit;
  std::string where;
  int descriptor = -1;
  void* address = nullptr;
  std::mutex mutex;
  std::deque<Range> settled;  // resident, oldest first
  std::int64_t resident = 0;
};

FactorMemory::FactorMemory(FactorResidence residence) : residence_(std::move(residence)) {}
FactorMemory::~FactorMemory() = default;
FactorMemory::FactorMemory(FactorMemory&&) noexcept = default;
FactorMemory& FactorMemory::operator=(FactorMemory&&) noexcept = default;

double* FactorMemory::require(std::int64_t size) {
  const std::int64_t bytes = size * static_cast<std::int64_t>(sizeof(double));
  if (residence_.bytes < 0 || bytes <= residence_.bytes) {
    file_ = nullptr;
    return data_ = memory_.require(size);
  }
  memory_ = AlignedBuffer();
  file_ = nullptr;  // a new file: nobody wants to read the old factor back before it is overwritten
  std::filesystem::path directory = residence_.directory;
  if (directory.empty()) directory = std::filesystem::temp_directory_path();
  file_ = std::make_unique<File>(directory, bytes, residence_.bytes);
  return data_ = static_cast<double*>(file_->address);
}

void FactorMemory::settle(std::int64_t begin, std::int64_t end) {
  constexpr auto kSize = static_cast<std::int64_t>(sizeof(double));
  if (file_ != nullptr && begin < end) file_->settle({begin * kSize, end * kSize});
}

void FactorMemory::leave(std::int64_t begin, std::int64_t end) const {
  constexpr auto kSize = static_cast<std::int64_t>(sizeof(double));
  if (file_ != nullptr && begin < end) file_->evict({begin * kSize, end * kSize});
}

}  // namespace mapjoin
