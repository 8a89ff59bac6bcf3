#pragma once

#include "mapjoin/joining/options.h"
#include "mapjoin/solvers/factor_memory.h"
#include "mapjoin/solvers/fronts.h"

namespace mapjoin {

/// How much of a factor each of `holders` threads may keep in memory, so that the process stays
/// within options.memory_limit. What cannot go to a file (measurements, values, the dense matrices
/// at hand) is counted first; when that alone is more than the limit, a small share is granted all
/// the same.
FactorResidence factor_residence(const JoinOptions& options, const FactorStatistics& statistics,
                                 int holders);

/// Says in the report when the process has taken more than options.memory_limit.
void note_excess(const JoinOptions& options, JoinReport& report);

}  // namespace mapjoin
