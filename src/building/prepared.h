// Parts of a recording made ready to be solved.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mapjoin/building/local_problem.h"

namespace mapjoin {

/// A local map before it is solved: every variable has a value to start from.
template <int D>
struct Prepared {
  LocalProblem<D> problem;
  InitialValues<D> values;
};

/// Places what several measurements place together (delayed.h). \returns the problem without the
/// measurements of features that nothing places, `values` without these features.
template <int D>
LocalProblem<D> with_all_placed(LocalProblem<D> problem, InitialValues<D>& values);

/// Local problems (local_problem.h) without the measurements of features that cannot be placed
/// (delayed.h); problems that nothing is left of are dropped. `in_order` as in initial_values().
template <int D>
std::vector<Prepared<D>> prepare(const RawLog<D>& log, std::span<const std::int64_t> measurements,
                                 bool in_order);

}  // namespace mapjoin
