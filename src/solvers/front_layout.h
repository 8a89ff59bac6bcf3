// Where the fronts' numbers live, and which thread may work on what: the last step of the analysis.
#pragma once

#include <cstdint>
#include <vector>

#include "mapjoin/solvers/fronts.h"

namespace mapjoin {

/// One past the last double of a front's panel. Panels follow one another in the order of the
/// fronts.
inline std::int64_t end_of_panel(const Front& front) {
  return front.panel + std::int64_t{front.panel_stride} * front.pivot_dim;
}

/// Doubles of a front's update matrix: whole columns from the row group that holds the first row
/// below the pivots, then a column for the diagonal of H.
std::int64_t update_size(const Front& front);

/// Panels leave memory in portions of about this many doubles.
inline constexpr std::int64_t kPanelPortion = std::int64_t{1} << 20;

/// Splits the fronts into tasks: subtrees small enough to balance, grouped when tiny, and above
/// them single fronts or short paths. The split depends on the structure alone, never on the number
/// of threads. Fills structure.tasks.
void plan_tasks(FrontalStructure& structure, const FrontCostModel& cost);

/// The tasks of a subtree, the fronts first .. root, as a tree of their own: those of the whole,
/// the last one cut off at `root`. One task where the subtree is but a part of one.
std::vector<FrontTask> tasks_of_subtree(const FrontalStructure& structure, std::int32_t first,
                                        std::int32_t root);

/// Gives every panel and every update matrix a fixed place; needs the tasks. Fills strides, offsets
/// and the sizes in structure.statistics.
//
/// A task that waits for nobody needs most of its update matrices itself. They lie on two stacks
/// side by side: fronts of even and of odd depth. A front's children are all on the other stack
/// than its own update matrix, on top of it, when they are added and dropped; so nothing is ever
/// moved. What other tasks need has a place of its own in the workspace.
void plan_memory(FrontalStructure& structure);

}  // namespace mapjoin
