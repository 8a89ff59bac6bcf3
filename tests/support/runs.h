// How often tests repeat an experiment whose outcome is a statistic.
#pragma once

#include <cstdlib>

namespace mapjoin::test {

/// Where the environment sets MAPJOIN_ALL_RUNS, as scripts/results.py does: minutes longer.
inline bool all_runs() { return std::getenv("MAPJOIN_ALL_RUNS") != nullptr; }

/// As many runs as show a mistake, or as many as the record wants.
inline int runs(int some, int all) { return all_runs() ? all : some; }

}  // namespace mapjoin::test
