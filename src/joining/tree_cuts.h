#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mapjoin/solvers/fronts.h"

namespace mapjoin {

/// A cut of an elimination tree: the fronts first .. root are a subtree, and what they eliminate is
/// a submap.
struct Cut {
  std::int32_t first = 0;
  std::int32_t root = 0;
  std::int32_t parent = -1;            ///< the cut that joins this one with others
  std::int64_t variables = 0;          ///< of the whole subtree
  std::vector<std::int32_t> children;  ///< cuts below
  std::vector<std::vector<std::int64_t>>
      groups;  ///< observations of the fronts between, in connected handfuls
};

/// Cuts a tree where subtrees first reach one of the given sizes (variables, ascending, the first
/// that of a leaf), and at its roots: children before parents. The first `observations` cliques of
/// the structure are observations; each is in one group of one cut. O(fronts + cliques).
std::vector<Cut> cut_tree(const FrontalStructure& structure, std::int64_t observations,
                          std::span<const std::int64_t> sizes);

/// What one thread does at a time: a cut, after its children; or before it some of its groups.
struct CutTask {
  std::int32_t cut = 0;
  int leaf = -1;                   ///< number among the cut's leaf tasks; -1: the cut itself
  std::size_t first = 0, end = 0;  ///< groups; for the cut itself those that no leaf task has
};

/// The cuts as work for walk_forest.
struct CutPlan {
  std::vector<CutTask> tasks;
  std::vector<FrontTask> forest;  ///< the same tasks, as a tree
  std::vector<char> together;     ///< per task: large enough to be done by all threads
  std::vector<int> leaves;        ///< per cut: its leaf tasks
};

/// Plans the walk for so many threads. Where a cut has many groups they are tasks of their own: the
/// last cut, alone on its level, may have most of a graph that is nearly a line. Large cuts, of
/// which there are few, are done by all threads together. O(cuts + groups).
CutPlan plan_cuts(const FrontalStructure& structure, const std::vector<Cut>& cuts, int threads);

}  // namespace mapjoin
