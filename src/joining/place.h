#pragma once

#include <vector>

#include "mapjoin/graph/piece.h"

namespace mapjoin {

/// Pieces that belong together: in the order they were placed, each with the motion that lays it on
/// those before it.
template <int D>
struct PlacedGroup {
  std::vector<int> members;
  std::vector<Rigid<D>> motions;
};

/// One round of place() that says what it does instead of uniting: the pieces are moved, and
/// grouped.
template <int D>
std::vector<PlacedGroup<D>> place_groups(const VariableSet<D>& all, std::vector<Piece<D>>& pieces,
                                         Places& places);

/// Which value a variable gets that several of the united pieces hold.
enum class SharedValue {
  kFirst,  ///< that of the first member that holds it
  kMean,  ///< the mean of all: where pieces do not quite meet, no measurement bears all of the gap;
          ///< the first where headings differ by more than half a radian
};

/// One piece out of placed ones.
template <int D>
Piece<D> unite(const VariableSet<D>& all, std::vector<Piece<D>>& pieces,
               const std::vector<int>& members, SharedValue shared = SharedValue::kFirst);

/// Lays pieces on one another: the first step of a join, before its linear solve.
///
/// Best first: from the largest piece on, always next the one that shares most variables with what
/// is placed, by the closed-form best rigid fit over all of them (frames/align.h). That leaves all
/// of a loop's error where it is closed last. So pieces that are large beside what they share, for
/// which that costs next to nothing, are laid again a few times, each on all of its neighbours. A
/// variable that several pieces hold gets the mean of their values. Pieces that share too little
/// with the rest stay pieces of their own, side by side; nothing is linked that no variable links.
/// Cost: O(n log n) for n variables that all the pieces have together.
template <int D>
std::vector<Piece<D>> place(const VariableSet<D>& all, std::vector<Piece<D>> pieces,
                            Places& places);

}  // namespace mapjoin
