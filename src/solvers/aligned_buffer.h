// Memory for millions of doubles that are written before they are read.
#pragma once

#include <cstdint>
#include <memory>

namespace mapjoin {

/// Uninitialised doubles on a 64-byte boundary (a cache line, the widest vector). Grows, never
/// shrinks.
///
/// The first write to fresh memory costs more than a small factorization: the system hands it out
/// in pages of 4 kB, about a microsecond each. Large buffers therefore ask for pages of 2 MB where
/// the system has them.
class AlignedBuffer {
 public:
  /// Room for `size` doubles. What was there is lost if the buffer has to grow.
  double* require(std::int64_t size);
  /// Gives the memory of the doubles begin .. end - 1 back to the system, as far as it is whole
  /// pages: what was there is lost, the room stays.
  void give_back(std::int64_t begin, std::int64_t end);
  double* data() const { return data_.get(); }
  std::int64_t size() const { return size_; }

 private:
  struct Free {
    void operator()(double* p) const noexcept;
  };
  std::unique_ptr<double[], Free> data_;
  std::int64_t size_ = 0;
};

}  // namespace mapjoin
