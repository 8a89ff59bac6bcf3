// Where a factor lies: in memory, or when that is too little in a file that is mapped into it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "mapjoin/solvers/aligned_buffer.h"

namespace mapjoin {

/// How much of a factor may be resident at a time.
struct FactorResidence {
  std::int64_t bytes = -1;          ///< negative: all of it, no file is made
  std::filesystem::path directory;  ///< of the file; empty: the system's temporary directory
};

/// Room for the panels of a factor.
///
/// A multifrontal factor is written once, from the leaves to the root, and read once, from the root
/// to the leaves. So when not all of it may stay in memory, what was finished longest ago goes to a
/// file (deleted as soon as it is open: nothing is left behind, whatever happens) and comes back
/// when back substitution gets there. The numbers are the same; only the time differs.
class FactorMemory {
 public:
  explicit FactorMemory(FactorResidence residence = {});
  ~FactorMemory();
  FactorMemory(FactorMemory&&) noexcept;
  FactorMemory& operator=(FactorMemory&&) noexcept;

  /// Room for `size` doubles; what was there is lost. A file is used only when `size` is more than
  /// may be resident. \throws Error when the file cannot be made, or the disk is too small.
  double* require(std::int64_t size);
  double* data() const { return data_; }

  /// Bytes of `begin` .. `end` doubles that are written and will not be touched for a while. May be
  /// called by several threads for different ranges.
  void settle(std::int64_t begin, std::int64_t end);
  /// The same for what has been read and is not needed again.
  void leave(std::int64_t begin, std::int64_t end) const;
  /// False where settle() and leave() do nothing.
  bool on_disk() const { return file_ != nullptr; }

 private:
  struct File;
  FactorResidence residence_;
  AlignedBuffer memory_;
  std::unique_ptr<File> file_;
  double* data_ = nullptr;
};

}  // namespace mapjoin
