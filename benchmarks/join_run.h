#pragma once

#include "benchmarks/measure.h"
#include "benchmarks/problem.h"
#include "mapjoin/joining/options.h"

namespace mapjoin::benchmarks {

/// Phases of a run of join_all, in the order of JoinRun::measured.
inline constexpr const char* kJoinPhases[] = {"plan", "joins", "root", "refine", "result"};

/// One run to the optimum, without any initial value.
///
/// The seconds of its phases follow from when the progress callback is called: *plan* is ordering
/// and analysis and what comes before, *joins* the tree up to its last level, *root* that level and
/// the solves of the whole, *refine* the further solves, *result* writing it as maps. Where no tree
/// is walked, all before the refinement counts as plan.
template <int D>
struct JoinRun {
  JoinResult<D> result;
  Measured measured;
};

/// Runs join_all in optimal mode, with threads that are there before it begins
/// (JoinOptions::workers). Without `information` the result is values alone, which is what the
/// other solvers give.
template <int D>
JoinRun<D> run_join(const Problem<D>& problem, int threads, bool information);

/// chi2 of a result, evaluated measurement by measurement, apart from the solver.
template <int D>
double chi2_of(const JoinResult<D>& result);

/// What a result is held against where no reference is known.
struct Minimum {
  double chi2 = 0.0;  ///< not a number where refinement did not get there
  const char* from = "";
};

/// Of a simulated world the minimum next to the truth: joining has not seen it and may have ended
/// in another. Of any other what as many more solves as change anything make of the result.
template <int D>
Minimum minimum_of(const Problem<D>& problem, const JoinResult<D>& result);

}  // namespace mapjoin::benchmarks
