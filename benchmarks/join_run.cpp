#include "benchmarks/join_run.h"

#include <limits>
#include <memory>

#include "mapjoin/evaluation/evaluate.h"
#include "mapjoin/joining/join_all.h"
#include "mapjoin/joining/refine.h"

namespace mapjoin::benchmarks {

namespace {

/// For a result to keep without a copy; the problem outlives it.
template <int D>
std::shared_ptr<const MeasurementGraph<D>> lend(const MeasurementGraph<D>& graph) {
  return {std::shared_ptr<const void>(), &graph};
}

}  // namespace

template <int D>
JoinRun<D> run_join(const Problem<D>& problem, int threads, bool information) {
  JoinOptions options;
  options.workers = std::make_shared<WorkerPool>(threads);
  options.workers->run([](int) {});  // all are there, as those of BLAS are
  const Laps watch;
  double planned = -1.0, last_level = -1.0, refining = -1.0;

  options.mode = Mode::kOptimal;
  options.information = information;
  options.progress = [&](const Progress& progress) {
    if (progress.phase == "join") {
      last_level = watch.now();
      if (planned < 0.0) planned = last_level;
    } else if (refining < 0.0) {
      refining = watch.now();
    }
    return true;
  };
  JoinRun<D> run;
  run.result = problem.local_maps.empty()
                   ? join_all(lend(problem.graph), options)
                   : join_all(std::span<const LocalMap<D>>(problem.local_maps), options);
  const double end = watch.now();
  run.measured.cpu = watch.cpu_now();
  if (planned < 0.0) planned = last_level = refining;
  const double refine = run.result.report.seconds_refine;
  run.measured.phases = {planned, last_level - planned, refining - last_level, refine,
                         end - refining - refine};
  return run;
}

template <int D>
double chi2_of(const JoinResult<D>& result) {
  double sum = 0.0;
  for (const Map<D>& map : result.maps) sum += chi2(map.values, *map.observations);
  return sum;
}

template <int D>
Minimum minimum_of(const Problem<D>& problem, const JoinResult<D>& result) {
  if (problem.truth) {
    const RefineResult next = refine_from(problem.graph, *problem.truth, 100, 1e-10);
    return {next.minimum ? next.chi2 : std::numeric_limits<double>::quiet_NaN(),
            "refinement from the truth"};
  }
  Minimum out{0.0, "tightest refinement"};
  for (const Map<D>& map : result.maps)
    out.chi2 += refine_from(*map.observations, map.values, 20, 0.0).chi2;
  return out;
}

#define MAPJOIN_INSTANTIATE(D)                                   \
  template JoinRun<D> run_join<D>(const Problem<D>&, int, bool); \
  template double chi2_of<D>(const JoinResult<D>&);              \
  template Minimum minimum_of<D>(const Problem<D>&, const JoinResult<D>&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin::benchmarks
