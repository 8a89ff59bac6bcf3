#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "mapjoin/graph/piece.h"
#include "mapjoin/joining/options.h"

namespace mapjoin {

/// What identifies a run: measurements, variables, and the options that its subtrees depend on.
/// O(measurements).
template <int D>
std::uint64_t fingerprint(const MeasurementGraph<D>& graph, const JoinOptions& options);

/// The finished subtrees of a run, as files of a folder: subtree_N.mapjoin holds the pieces that
/// node N of the join tree has become.
///
/// A file is written whole or not at all (under another name, then renamed), and carries the run's
/// fingerprint and a checksum, so that a run killed at any moment can be taken up again, and only
/// by the same run. What is inside depends on the machine's byte order; it is not for keeping.
template <int D>
class Checkpoint {
 public:
  /// Makes the folder. \throws Error when that fails, InputError when the folder holds files of
  /// another run.
  Checkpoint(std::filesystem::path folder, std::uint64_t fingerprint);

  /// The nodes that have been saved, ascending.
  const std::vector<int>& saved() const { return saved_; }
  /// \throws InputError when the file is damaged: delete it, and the run goes on without it.
  std::vector<Piece<D>> load(int node) const;
  /// From several threads at a time for different nodes. \throws Error when the disk is full.
  void save(int node, const std::vector<Piece<D>>& pieces) const;
  /// For nodes that one above has made superfluous.
  void remove(int node) const;

 private:
  std::filesystem::path file_of(int node) const;

  std::filesystem::path folder_;
  std::uint64_t fingerprint_;
  std::vector<int> saved_;
};

/// Deletes the files that a run has left in its checkpoint folder, and the folder if it is empty
/// then.
void remove_checkpoint(const std::filesystem::path& folder);

}  // namespace mapjoin
