#pragma once

#include <vector>

#include "mapjoin/graph/piece.h"
#include "mapjoin/solvers/front_kernels.h"

namespace mapjoin {

/// Which value a variable gets that several of the united pieces hold.
enum class SharedValue {
  kFirst,  ///< that of the first member that holds it
  kMean,  ///< the mean of all: where pieces do not quite meet, no measurement bears all of the gap;
          ///< the first where headings differ by more than half a radian
};

/// One piece out of those of `pieces` that are `members`, which lie where they should. `loop` may
/// have other threads help; the result is the same. Cost: linear in the variables they hold.
template <int D>
Piece<D> unite(const VariableSet<D>& all, std::vector<Piece<D>>& pieces,
               const std::vector<int>& members, SharedValue shared = SharedValue::kFirst,
               LoopRunner loop = {});

}  // namespace mapjoin
