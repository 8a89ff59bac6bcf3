// The fewest vertices that part a graph in two.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mapjoin/solvers/block_graph.h"

namespace mapjoin {

/// Where a variable is when a graph is parted.
enum class Side : char { kLeft, kRight, kCut };

/// Makes cuts minimal. One object for many cuts keeps its memory.
class VertexCut {
 public:
  /// Of the variables at kCut, all but as few as can be are put on a side, so that still no edge
  /// joins left and right; of the smallest cuts the one nearest to the left or the one nearest to
  /// the right, whichever is more even. By Menger's theorem a smallest cut has as many variables
  /// as there are paths from left to right without a common one.
  /// These are found one after the other, each rerouting those before where that helps (maximum
  /// flow, every variable letting one path through), and each trying first what is nearer to the
  /// right. Deterministic. Cost: O(edges at the cut x paths) at worst, in thin bands a few times
  /// O(edges).
  void shrink(const BlockGraph& graph, std::span<Side> side);

 private:
  void begin(const BlockGraph& graph, std::span<const Side> side);
  void find_neighbours(const BlockGraph& graph);
  bool find_path(std::int32_t source);
  std::int32_t next_state(std::int32_t state);
  void reroute();
  void cut_near_left(std::span<Side> side) const;
  void cut_near_right(std::span<Side> side);

  std::vector<std::int32_t> band_;                  ///< variables at the cut
  std::vector<std::int32_t> place_;                 ///< per variable: in band_; -1 elsewhere
  std::vector<char> touches_left_, touches_right_;  ///< per place
  BlockGraph inside_;                    ///< of places; of each, those nearer to the right first
  std::vector<std::int32_t> from_, to_;  ///< the path through a place

  // A search visits a place twice at most: where a path enters (2 i) and where it leaves (2 i + 1).
  std::vector<char> visited_;        ///< per state
  std::vector<std::int32_t> tried_;  ///< continuations of each state
  std::vector<std::int32_t> path_;   ///< states
  std::vector<Side> right_;          ///< the cut nearest to the right
};

}  // namespace mapjoin
