// How often tests repeat an experiment whose outcome is a statistic.
#pragma once

#include <cstdlib>

namespace mapjoin::test {

/// As many runs as show a mistake; or as many as the record wants, minutes longer, where the
/// environment sets MAPJOIN_ALL_RUNS, as scripts/results.py does.
inline int runs(int some, int all) {
  return std::getenv("MAPJOIN_ALL_RUNS") != nullptr ? all : some;
}

}  // namespace mapjoin::test
