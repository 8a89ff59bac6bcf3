#pragma once

#include <vector>

#include "mapjoin/graph/piece.h"
#include "mapjoin/joining/unite.h"

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

/// Lays pieces on one another: the first step of a join, before its linear solve.
///
/// Best first: from the largest piece on, always next the one that shares most variables with what
/// is placed, by the closed-form best rigid fit over all of them (frames/align.h). That leaves all
/// of a loop's error where it is closed last. So pieces that are large beside what they share, for
/// which that costs next to nothing, are laid again a few times, each on all of its neighbours. A
/// variable that several pieces hold gets the mean of their values. Pieces that share too little
/// with the rest stay pieces of their own, side by side; nothing is linked that no variable links.
/// `loop` may have other threads help; the result is the same. Cost: linear in the variables that
/// the pieces hold, O(p log p) for p pieces.
template <int D>
std::vector<Piece<D>> place(const VariableSet<D>& all, std::vector<Piece<D>> pieces, Places& places,
                            LoopRunner loop = {});

}  // namespace mapjoin
