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

/// chi2 after as many more solves as change anything: what a result is held against where no
/// reference is known.
template <int D>
double tightest_chi2(const JoinResult<D>& result);

}  // namespace mapjoin::benchmarks
