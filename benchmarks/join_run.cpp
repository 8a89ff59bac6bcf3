#include "benchmarks/join_run.h"

#include <memory>
#include <numeric>

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
double tightest_chi2(const JoinResult<D>& result) {
  constexpr int kMostSolves = 20;
  WorkerPool pool;
  FrontalCholesky cholesky;
  double sum = 0.0;
  for (const Map<D>& map : result.maps) {
    const MeasurementGraph<D>& graph = *map.observations;
    Piece<D> piece = to_piece(graph.variables, map.values);
    piece.observations.resize(graph.size());
    std::iota(piece.observations.begin(), piece.observations.end(), std::int64_t{0});
    Places places(graph.variables.size());
    ObservationSystem<D> system(graph, piece, {}, places);
    sum += refine(graph, piece, system, cholesky, pool, kMostSolves, 0.0, {}).chi2;
  }
  return sum;
}

#define MAPJOIN_INSTANTIATE(D)                                   \
  template JoinRun<D> run_join<D>(const Problem<D>&, int, bool); \
  template double chi2_of<D>(const JoinResult<D>&);              \
  template double tightest_chi2<D>(const JoinResult<D>&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin::benchmarks
