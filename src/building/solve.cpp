#include "mapjoin/building/solve.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "mapjoin/evaluation/evaluate.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/graph/piece.h"
#include "mapjoin/joining/refine.h"
#include "mapjoin/joining/report.h"
#include "mapjoin/solvers/worker_pool.h"

namespace mapjoin {

namespace {

/// Observations of the graph between variables of a map, by the pose that takes them.
template <int D>
std::vector<std::int64_t> observations_of(const MeasurementGraph<D>& graph, const Map<D>& map) {
  const std::vector<int> place = numbers_in(graph.variables, map.variables());
  std::vector<std::int64_t> out;
  std::int64_t number = 0;
  for (const auto& column : graph.relative) {
    for (std::size_t k = 0; k < column.size(); ++k, ++number) {
      if (place[static_cast<std::size_t>(column.from[k])] < 0) continue;
      if (place[static_cast<std::size_t>(column.to[k])] < 0) {
        throw InputError(fmt::format("{} is measured but not in the joined map of {}",
                                     to_string(graph.variables.key(column.to[k])),
                                     to_string(graph.variables.key(column.from[k]))));
      }
      out.push_back(number);
    }
  }
  return out;
}

}  // namespace

template <int D>
void refine_over(const std::shared_ptr<const MeasurementGraph<D>>& graph, JoinResult<D>& result,
                 const JoinOptions& options) {
  const auto start = Clock::now();
  JoinReport& report = result.report;
  report.chi2 = report.chi2_linear = 0.0;
  report.observations = static_cast<std::int64_t>(graph->size());
  const std::shared_ptr<WorkerPool> workers = workers_of(options);
  WorkerPool& pool = *workers;
  FrontalCholesky cholesky;
  Places places(graph->variables.size());
  for (Map<D>& map : result.maps) {
    const Anchor<D> anchor = map.anchor;
    Piece<D> piece = to_piece(graph->variables, map.values);
    piece.observations = observations_of(*graph, map);
    ObservationSystem<D> system(*graph, piece, std::span<const std::int32_t>(), places);
    const RefineResult refined =
        refine(*graph, piece, system, cholesky, pool, options.max_refine_solves,
               options.refine_tolerance, options.progress);
    report.chi2_linear += refined.chi2_before;
    report.chi2 += refined.chi2;
    report.refine_solves = std::max(report.refine_solves, refined.solves);
    report.redone_joins += refined.shortened;
    report.minimum = report.minimum && refined.minimum;
    map.values = to_values(graph->variables, piece);
    map.information = system.information(piece);
    map = change_frame(std::move(map), anchor);
    map.solved_in = anchor;
    map.observations = result.maps.size() == 1
                           ? graph
                           : std::make_shared<const MeasurementGraph<D>>(subgraph(
                                 *graph, std::span<const std::int64_t>(piece.observations)));
  }
  report.seconds_refine = seconds_since(start);
}

template <int D>
SolvedLog<D> solve_by_local_maps(const RawLog<D>& log, const Segmentation& segmentation,
                                 const BuildOptions& building, const JoinOptions& joining) {
  SolvedLog<D> out;
  BuiltMaps<D> built = build_local_maps(log, segmentation, building);
  out.local_maps = built.maps.size();
  out.refused = built.refused.size();
  out.seconds_build = built.seconds;
  const bool robust = building.loss.shape != RobustLoss::Shape::kNone;
  auto graph = std::make_shared<MeasurementGraph<D>>();
  const bool raw = as_graph(log, *graph) && building.keep == Keep::kAll && !robust;

  const auto start = Clock::now();
  JoinOptions options = joining;
  if (raw && joining.mode == Mode::kOptimal) options.mode = Mode::kObserve;
  constexpr int kRootSolves = 3;
  if (joining.mode == Mode::kObserve && joining.root_solves == 0) options.root_solves = kRootSolves;
  out.result = join_all(std::span<const Map<D>>(built.maps), {}, options);
  std::erase_if(out.result.report.notes, [](const std::string& note) {
    return note.find("carry no observations") != std::string::npos;  // none is meant to
  });
  out.seconds_join = seconds_since(start);
  if (raw && joining.mode == Mode::kOptimal) {
    refine_over<D>(graph, out.result, joining);
  } else if (raw) {
    double sum = 0.0;
    for (const Map<D>& map : out.result.maps) {
      const std::vector<std::int64_t> own = observations_of(*graph, map);
      sum += chi2(map.values, subgraph(*graph, std::span<const std::int64_t>(own)));
    }
    out.result.report.chi2 = out.result.report.chi2_linear = sum;
  }
  out.result.report.seconds = out.seconds_build + seconds_since(start);
  return out;
}

#define MAPJOIN_INSTANTIATE(D)                                                                    \
  template void refine_over<D>(const std::shared_ptr<const MeasurementGraph<D>>&, JoinResult<D>&, \
                               const JoinOptions&);                                               \
  template SolvedLog<D> solve_by_local_maps<D>(const RawLog<D>&, const Segmentation&,             \
                                               const BuildOptions&, const JoinOptions&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
