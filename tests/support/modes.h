// Every mode of joining, and options that give small graphs a tree.
#pragma once

#include "mapjoin/joining/options.h"

namespace mapjoin::test {

inline constexpr Mode kModes[] = {Mode::kPaper, Mode::kSummary, Mode::kObserve, Mode::kOptimal};

/// Small leaves and narrow joins.
inline JoinOptions small_leaves(Mode mode = Mode::kOptimal) {
  JoinOptions out;
  out.mode = mode;
  out.leaf_variables = 10;
  out.arity = 4;
  return out;
}

}  // namespace mapjoin::test
