// The plan of a block multifrontal Cholesky factorization: every index list and every memory
// offset, before any number.
//
// H = sum over cliques, a symmetric positive definite matrix of small blocks. Elimination runs over
// a tree of *fronts*. A front is a dense symmetric matrix over its `pivot_dim` pivots (eliminated
// here) followed by `update_dim` scalars of ancestors:
//
//        p       q
//   p [ L11           ]    panel: p columns of p + q + 1 rows, kept: it becomes the factor
//   q [ L21     S     ]    update matrix S: added to the parent's front, then forgotten
//   1 [ y'      s'    ]    last row: the right-hand side, eliminated along the way (forward
//   substitution is free)
//
// Each clique is *owned* by the front where its earliest variable is a pivot; all its variables are
// in that front. So a clique is added exactly once, as dense blocks at known offsets.
//
// The plan depends only on the dimensions, the cliques and the order: make it once, factorize many
// times.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mapjoin/solvers/block_ordering.h"
#include "mapjoin/solvers/front_merging.h"
#include "mapjoin/solvers/worker_pool.h"

namespace mapjoin {

struct Front {
  std::int32_t parent = -1;         ///< a later front, or -1
  std::int32_t first_position = 0;  ///< pivots: order[first_position] .. order[end_position - 1]
  std::int32_t end_position = 0;
  std::int32_t first_scalar = 0;  ///< of the first pivot, in elimination order
  std::int32_t pivot_dim = 0;     ///< p
  std::int32_t update_dim = 0;    ///< q
  std::int32_t panel_stride = 0;  ///< leading dimension of the panel
  std::int32_t update_stride = 0;
  std::int64_t panel = 0;  ///< offset of the panel in the factor
  /// Place of S (see FrontalStructure::update_stack); its columns start at row p rounded down to a
  /// whole kRowGroup.
  std::int64_t update = 0;

  /// Without the right-hand side row, which is row rows().
  std::int32_t rows() const { return pivot_dim + update_dim; }
};

/// `length` consecutive rows of S, from row `from`, are rows `to`, `to` + 1, ... of the parent's
/// front. The last row of all is the right-hand side row.
struct RowRun {
  std::int32_t from = 0;
  std::int32_t to = 0;
  std::int32_t length = 0;
};

struct RunRange {
  std::int64_t begin = 0;
  std::int64_t end = 0;
};

/// A run of consecutive fronts that one thread works through. It waits for the tasks that hold
/// children of its fronts.
struct FrontTask {
  std::int32_t begin = 0;
  std::int32_t end = 0;
  std::int32_t parent = -1;  ///< the task that waits for this one
  std::int32_t waits_for = 0;
  double path_cost = 0;  ///< work from the start of this task to the end of all: the longest first
};

struct FactorStatistics {
  std::int64_t fronts = 0;
  std::int64_t scalars = 0;
  std::int64_t factor_nonzeros = 0;  ///< of L, with the zeros that merging fronts made explicit
  double flops = 0;                  ///< of one numeric factorization
  std::int32_t largest_front = 0;    ///< rows
  std::int64_t factor_bytes = 0;     ///< kept
  /// For update matrices of all tasks, and of each thread; kept for the next factorization.
  std::int64_t workspace_bytes = 0, stack_bytes = 0;
  std::int64_t live_update_bytes = 0;  ///< of those that wait for their parent, at most, one thread
};

struct FrontalStructure {
  std::vector<std::int32_t> dims;       ///< per variable
  std::vector<std::int32_t> order;      ///< final elimination order: order[position] = variable
  std::vector<std::int32_t> position;   ///< its inverse
  std::vector<std::int32_t> scalar_of;  ///< per variable: its first scalar (sums of dims)
  std::vector<std::int32_t> scalar_at;  ///< positions + 1: the same in elimination order

  std::vector<Front> fronts;  ///< children before parents
  std::vector<std::int32_t> child_start, children;
  std::vector<std::int64_t> update_start;  ///< fronts + 1
  std::vector<std::int32_t> updates;      ///< positions of each front's update variables, ascending
  std::vector<RunRange> run_range;        ///< per front, into runs
  std::vector<RowRun> runs;               ///< grouped by the parent, where they are used
  std::vector<std::int64_t> owned_start;  ///< fronts + 1
  std::vector<std::int64_t> owned;        ///< cliques of each front, ascending
  std::vector<std::int64_t> clique_start;  ///< a copy of Cliques::start
  std::vector<std::int32_t> clique_row;    ///< per entry of Cliques::vars: row in the owner's front

  std::vector<FrontTask> tasks;  ///< children before parents
  /// Doubles. Update matrices with places below lie on a stack that each thread has for itself:
  /// they are used by the task they come from. Those above lie in a workspace of all threads.
  std::int64_t update_stack = 0;
  bool is_on_stack(const Front& front) const { return front.update < update_stack; }
  FactorStatistics statistics;

  std::span<const std::int32_t> children_of(std::int32_t front) const {
    return std::span(children).subspan(child_start[front],
                                       child_start[front + 1] - child_start[front]);
  }
  std::span<const std::int32_t> updates_of(std::int32_t front) const {
    return std::span(updates).subspan(update_start[front],
                                      update_start[front + 1] - update_start[front]);
  }
  std::span<const RowRun> runs_of(std::int32_t front) const {
    return std::span(runs).subspan(run_range[front].begin,
                                   run_range[front].end - run_range[front].begin);
  }
  std::span<const std::int64_t> owned_by(std::int32_t front) const {
    return std::span(owned).subspan(owned_start[front],
                                    owned_start[front + 1] - owned_start[front]);
  }
  /// For each variable of the clique, in the clique's order: its first row in the front that owns
  /// the clique.
  std::span<const std::int32_t> clique_rows(std::int64_t clique) const {
    return std::span(clique_row)
        .subspan(clique_start[clique], clique_start[clique + 1] - clique_start[clique]);
  }
};

/// Cost: O(blocks of L per front + sum of clique sizes). `order` comes from order_blocks or from
/// anywhere else; the result's order is equivalent (same fill but for merging) but not the same.
/// Throws InputError if `order` is not a permutation, a dimension is below 1, or there are more
/// than 2^31 scalars.
///
/// With `eliminated` >= 0 only that many variables, the first ones of `order`, are to be eliminated
/// (FrontalCholesky::factorize_subtree). No clique may lie among the others alone: they are not
/// analysed, and each is a front by itself that nothing hangs below. The update set of a root is
/// then what stays of its tree's surroundings.
FrontalStructure analyze(std::span<const std::int32_t> dims, Cliques cliques,
                         std::span<const std::int32_t> order, const MergingOptions& options = {},
                         std::int32_t eliminated = -1);

/// The same where the cliques' block graph is at hand. Steps that do not need one another run side
/// by side on the threads of `pool`, if there is one; the result is the same.
FrontalStructure analyze(std::span<const std::int32_t> dims, Cliques cliques,
                         const BlockGraph& graph, std::span<const std::int32_t> order,
                         WorkerPool* pool = nullptr);

}  // namespace mapjoin
