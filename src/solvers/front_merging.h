// From columns to fronts: which consecutive eliminations are done together, as one dense problem.
//
// A *front* eliminates p scalars (its pivots) out of a dense symmetric matrix of p + q; the q
// others are its update set. Columns with the same pattern go together for free (supernodes).
// Beyond that, merging a child into its parent stores and computes some zeros but saves a front:
// its bookkeeping, its update matrix, and short inner loops. A child is merged whenever a model of
// the time says so.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mapjoin/solvers/symbolic_elimination.h"

namespace mapjoin {

/// Rows of a front are stored and computed in groups of this many: no remainder loops.
inline constexpr std::int32_t kRowGroup = 8;

/// Time of a front in units of one floating-point operation at full speed; fitted to measurements,
/// only the ratios matter.
struct FrontCostModel {
  double per_front = 1500;   ///< calls, index lists, first touches
  double per_pivot = 250;    ///< square root, division, and their latency
  double per_pivot_row = 6;  ///< entries of the factor: cleared, scaled, written
  double per_update_entry =
      12;  ///< entries of the update matrix: cleared, computed, added to the parent

  double operator()(double pivots, double updates) const;
};

/// Multiply-adds and multiplications to eliminate `pivots` scalars from a front that keeps
/// `updates`, right-hand side included, each counted as one operation for a product and one for a
/// sum.
double front_flops(double pivots, double updates);

struct MergingOptions {
  bool merge_fronts = true;  ///< false: only columns of equal pattern go together
  FrontCostModel cost;
};

/// Fronts as sets of positions, in an order where children come before parents and subtrees are
/// contiguous.
struct FrontPartition {
  std::vector<std::int32_t> front_of;   ///< per position
  std::vector<std::int32_t> parent;     ///< per front; -1 at a root
  std::vector<std::int32_t> pivot_dim;  ///< per front
  std::vector<std::int32_t> supernode;  ///< per front: the one whose update set it has

  std::int32_t fronts() const { return static_cast<std::int32_t>(parent.size()); }
};

/// Cost: O(positions). Deterministic. The child with the largest subtree comes last among its
/// siblings: what it leaves is then still in cache, and a path is a run of indices.
FrontPartition partition_into_fronts(const SupernodeTree& supernodes,
                                     const MergingOptions& options);

}  // namespace mapjoin
