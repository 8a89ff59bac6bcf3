#include "mapjoin/joining/join_all.h"

#include <fmt/format.h>

#include <algorithm>

#include "mapjoin/frames/anchors.h"
#include "mapjoin/frames/local_map.h"
#include "mapjoin/joining/elimination_join.h"
#include "mapjoin/joining/memory_limit.h"
#include "mapjoin/joining/observing_join.h"
#include "mapjoin/joining/place_world.h"
#include "mapjoin/joining/refine.h"
#include "mapjoin/joining/report.h"
#include "mapjoin/joining/summary_tree.h"
#include "mapjoin/joining/uncoil.h"

namespace mapjoin {

namespace {

void check(const JoinOptions& options) {
  if (options.threads < 1) throw InputError("threads must be at least 1");
  if (options.leaf_variables < 0) throw InputError("leaf_variables must be at least 1, or 0");
  if (options.arity != 0 && options.arity < 2) throw InputError("arity must be at least 2, or 0");
  if (options.memory_limit < 0) throw InputError("memory_limit must not be negative");
  const bool observing = options.mode == Mode::kObserve || options.mode == Mode::kOptimal;
  if (options.memory_limit > 0 && !observing)
    throw InputError("a memory limit is for observe and optimal mode; leave it out");
  if (!options.checkpoint.empty() && !(observing && options.tree == TreeShape::kGraph &&
                                       options.strategy == Strategy::kDivideAndConquer)) {
    throw InputError(
        "checkpoints are for divide and conquer on the graph tree, in observe and optimal mode; "
        "leave them out");
  }
  if (options.max_refine_solves < 1) throw InputError("max_refine_solves must be at least 1");
  if (!(options.refine_tolerance >= 0.0) || options.refine_tolerance > kMostRefineTolerance) {
    throw InputError(
        fmt::format("refine_tolerance must be at least 0 and at most {:g}: what is left is "
                    "estimated by what holds near the minimum",
                    kMostRefineTolerance));
  }
}

template <int D>
JoinTree make_tree(const MeasurementGraph<D>& graph, std::span<const Key> order,
                   const JoinOptions& options) {
  if (options.strategy == Strategy::kSequential)
    return sequential_tree(local_maps_of(graph, order));
  if (options.tree == TreeShape::kOrder)
    return divide_and_conquer_tree(local_maps_of(graph, order));
  return graph_tree(graph, leaf_of(options), arity_of(options));
}

/// Writes a piece in the frame of its lowest pose. \returns that anchor; none where there is no
/// pose.
template <int D>
Anchor<D> into_lowest_pose(const VariableSet<D>& all, Piece<D>& piece) {
  const Anchor<D> anchor = lowest_pose_anchor(all, piece);
  if (anchor.keys.empty()) return anchor;
  auto* const pose = reinterpret_cast<Rigid<D>*>(
      piece.data[static_cast<std::size_t>(all.find_column(Tag("pose")))].data());
  move(all, piece, motion_into(*pose));
  *pose = Rigid<D>::identity();
  return anchor;
}

/// What a map keeps: all of the graph where it is the only one.
template <int D>
std::shared_ptr<const MeasurementGraph<D>> kept_observations(
    const MeasurementGraph<D>& graph, const Piece<D>& piece, bool all,
    const std::shared_ptr<const MeasurementGraph<D>>& shared) {
  if (all && shared != nullptr) return shared;
  if (all) return std::make_shared<const MeasurementGraph<D>>(graph);
  return std::make_shared<const MeasurementGraph<D>>(
      subgraph(graph, std::span<const std::int64_t>(piece.observations)));
}

template <int D>
std::unique_ptr<FrontalCholesky> cholesky_for(const ObservationSystem<D>& system,
                                              const JoinOptions& options) {
  return std::make_unique<FrontalCholesky>(
      FactorOptions{.residence = factor_residence(options, system.statistics(), 1)});
}

template <int D>
JoinedPieces<D> join_pieces(const MeasurementGraph<D>& graph, std::span<const Key> order,
                            const JoinOptions& options, WorkerPool& pool, JoinReport& report) {
  if (options.tree == TreeShape::kGraph && options.strategy == Strategy::kDivideAndConquer) {
    return elimination_join(graph, options, pool, report);
  }
  const JoinTree tree = make_tree(graph, order, options);
  report.joins = tree.joins();
  JoinedPieces<D> out;
  out.pieces = observing_join(graph, tree, options, pool, report);
  return out;
}

/// The same with measurements from the world that cannot place a pose: the others are joined, then
/// laid on them, and solved with them.
template <int D>
JoinedPieces<D> join_pieces_in_world(const MeasurementGraph<D>& graph,
                                     const std::vector<std::int64_t>& partial,
                                     std::span<const Key> order, const JoinOptions& options,
                                     WorkerPool& pool, JoinReport& report) {
  std::vector<std::int64_t> rest;
  for (std::int64_t o = 0; o < static_cast<std::int64_t>(graph.size()); ++o) {
    if (!std::binary_search(partial.begin(), partial.end(), o)) rest.push_back(o);
  }
  if (rest.empty()) {
    throw InputError(
        "there are only measurements from the world that do not say where a pose is and how it is "
        "turned: nothing to join");
  }
  const MeasurementGraph<D> relative = subgraph(graph, std::span<const std::int64_t>(rest));
  std::vector<Piece<D>> pieces;
  for (Piece<D>& piece : join_pieces(relative, order, options, pool, report).pieces) {
    pieces.push_back(to_piece(graph.variables, to_values(relative.variables, piece)));
    for (const std::int64_t o : piece.observations)
      pieces.back().observations.push_back(rest[static_cast<std::size_t>(o)]);
  }
  JoinedPieces<D> out;
  out.pieces = place_in_world(graph, partial, std::move(pieces), report.notes);
  Places places(graph.variables.size());
  for (Piece<D>& piece : out.pieces) {
    std::sort(piece.observations.begin(), piece.observations.end());
    auto system = std::make_unique<ObservationSystem<D>>(
        graph, piece, std::span<const std::int32_t>(), places, &pool);
    if (out.cholesky == nullptr) out.cholesky = cholesky_for(*system, options);
    for (int k = 0; k < report.root_solves; ++k)
      linear_step(graph, piece, *system, *out.cholesky, pool);
    if (out.pieces.size() == 1) out.system = std::move(system);  // planned once, for refining too
  }
  return out;
}

/// Refines; and where chains of poses are wound up (uncoil.h), before or after, lays them anew and
/// refines again as long as that makes chi2 smaller.
template <int D>
RefineResult refine_uncoiled(const MeasurementGraph<D>& graph, Piece<D>& piece,
                             ObservationSystem<D>& system, FrontalCholesky& cholesky,
                             WorkerPool& pool, Places& places, const JoinOptions& options,
                             LastSolve last_solve, JoinReport& report) {
  constexpr int kRounds = 8;
  const auto refine_from = [&](LastSolve last) {
    return refine(graph, piece, system, cholesky, pool, options.max_refine_solves,
                  options.refine_tolerance, options.progress, std::move(last));
  };
  std::size_t laid = 0;
  std::vector<int> coiled = coiled_poses(graph, piece, places, pool);
  const double linear = coiled.empty() ? 0.0 : system.chi2(piece, pool);
  if (!coiled.empty()) {
    lay_anew(graph, piece, places, coiled);
    laid += coiled.size();
  }
  RefineResult result = refine_from(coiled.empty() ? std::move(last_solve) : LastSolve());
  if (!coiled.empty()) result.chi2_before = linear;
  for (int round = 0; round < kRounds; ++round) {
    coiled = coiled_poses(graph, piece, places, pool);
    if (coiled.empty()) break;
    const std::vector<std::vector<double>> before = piece.data;
    lay_anew(graph, piece, places, coiled);
    RefineResult again = refine_from({});
    result.solves += again.solves;
    result.shortened += again.shortened;
    if (again.chi2 >= result.chi2) {
      piece.data = before;
      break;
    }
    laid += coiled.size();
    result.chi2 = again.chi2;
    result.minimum = again.minimum;
  }
  if (laid > 0)
    report.notes.push_back(
        fmt::format("{} poses of chains that were wound up were laid anew", laid));
  return result;
}

/// Joins a graph whose local maps come in a given order (first keys of their anchors; empty:
/// ascending). `shared` holds the graph, where it is for the result to keep.
template <int D>
JoinResult<D> join_ordered(const MeasurementGraph<D>& graph, std::span<const Key> order,
                           const JoinOptions& options,
                           std::shared_ptr<const MeasurementGraph<D>> shared = nullptr) {
  check(options);
  if (graph.size() == 0) throw InputError("there are no measurements: nothing to join");
  const std::vector<std::int64_t> partial = partial_world_measurements(graph);
  if (options.mode == Mode::kPaper || options.mode == Mode::kSummary) {
    if (partial.empty()) return join_by_summaries(graph, order, options);
    throw InputError(
        fmt::format("{} measurements from the world say only part of where a pose is, such as its "
                    "position: that is no map, so it has no summary; use mode observe or optimal",
                    partial.size()));
  }

  const auto start = Clock::now();
  JoinResult<D> result;
  JoinReport& report = result.report;
  count_variables(graph, report);
  report.root_solves = options.root_solves > 0 ? options.root_solves : 2;
  const std::shared_ptr<WorkerPool> workers = workers_of(options);
  WorkerPool& pool = *workers;
  JoinedPieces<D> joined = partial.empty()
                               ? join_pieces(graph, order, options, pool, report)
                               : join_pieces_in_world(graph, partial, order, options, pool, report);
  std::vector<Piece<D>>& pieces = joined.pieces;
  report.components = static_cast<int>(pieces.size());

  Places places(graph.variables.size());
  for (Piece<D>& piece : pieces) {
    std::unique_ptr<ObservationSystem<D>> planned = std::move(joined.system);
    if (planned == nullptr)
      planned = std::make_unique<ObservationSystem<D>>(
          graph, piece, std::span<const std::int32_t>(), places, &pool);
    ObservationSystem<D>& system = *planned;
    if (options.mode == Mode::kOptimal) {
      const auto refine_start = Clock::now();
      if (joined.cholesky == nullptr) joined.cholesky = cholesky_for(system, options);
      const RefineResult refined =
          refine_uncoiled(graph, piece, system, *joined.cholesky, pool, places, options,
                          std::move(joined.last_solve), report);
      report.chi2_linear += refined.chi2_before;
      report.chi2 += refined.chi2;
      report.refine_solves = std::max(report.refine_solves, refined.solves);
      report.redone_joins += refined.shortened;
      report.minimum = report.minimum && refined.minimum;
      report.seconds_refine += seconds_since(refine_start);
    } else {
      const double linear = system.chi2(piece, pool);
      report.chi2_linear += linear;
      report.chi2 += linear;
    }
    Map<D> map;
    map.anchor = into_lowest_pose(graph.variables, piece);
    map.solved_in = map.anchor;
    map.values = to_values(graph.variables, piece);
    if (options.information) map.information = system.information(piece);
    if (!std::is_sorted(piece.observations.begin(), piece.observations.end()))
      std::sort(piece.observations.begin(), piece.observations.end());
    map.observations = kept_observations(graph, piece, pieces.size() == 1, shared);
    if (map.anchor.keys.empty()) {
      map = into_points(std::move(map), report);
      map.solved_in = map.anchor;  // the system has no gauge: any frame is as good
    }
    result.maps.push_back(std::move(map));
  }
  std::sort(result.maps.begin(), result.maps.end(), lower_map_first<D>);
  if (!report.minimum) {
    report.notes.push_back(
        fmt::format("the refinement stopped after {} solves before it reached a minimum",
                    report.refine_solves));
  }
  note_excess(options, report);
  report.seconds = seconds_since(start);
  return result;
}

/// A graph that is nobody else's.
template <int D>
JoinResult<D> join_ordered(MeasurementGraphBuilder<D> builder, std::span<const Key> order,
                           const JoinOptions& options) {
  const auto graph = std::make_shared<const MeasurementGraph<D>>(std::move(builder).build());
  return join_ordered(*graph, order, options, graph);
}

}  // namespace

template <int D>
JoinResult<D> join_all(const MeasurementGraph<D>& graph, const JoinOptions& options) {
  return join_ordered(graph, {}, options);
}

template <int D>
JoinResult<D> join_all(std::shared_ptr<const MeasurementGraph<D>> graph,
                       const JoinOptions& options) {
  return join_ordered(*graph, {}, options, graph);
}

template <int D>
JoinResult<D> join_all(std::span<const LocalMap<D>> local_maps, const JoinOptions& options) {
  if (local_maps.empty()) throw InputError("there are no local maps: nothing to join");
  MeasurementGraphBuilder<D> builder;
  std::vector<Key> order;
  for (const LocalMap<D>& map : local_maps) {
    builder.add(map);
    order.push_back(map.anchor.keys.at(0));
  }
  return join_ordered(std::move(builder), order, options);
}

template <int D>
JoinResult<D> join_all(std::span<const Map<D>> maps, const MeasurementGraph<D>& links,
                       const JoinOptions& options) {
  check(options);
  if (maps.empty()) throw InputError("there are no maps: nothing to join");
  if (options.mode == Mode::kPaper || options.mode == Mode::kSummary)
    return join_by_summaries(maps, links, options);
  MeasurementGraphBuilder<D> builder;
  int summaries = 0;
  for (const Map<D>& map : maps) {
    if (map.observations != nullptr) {
      builder.add(*map.observations);
    } else {
      builder.add(as_local_map(map));
      ++summaries;
    }
  }
  builder.add(links);
  JoinResult<D> result = join_ordered(std::move(builder), {}, options);
  if (summaries > 0) {
    result.report.notes.push_back(
        fmt::format("{} of {} maps carry no observations and count as one observation each",
                    summaries, maps.size()));
  }
  return result;
}

#define MAPJOIN_INSTANTIATE(D)                                                            \
  template JoinResult<D> join_all<D>(const MeasurementGraph<D>&, const JoinOptions&);     \
  template JoinResult<D> join_all<D>(std::shared_ptr<const MeasurementGraph<D>>,          \
                                     const JoinOptions&);                                 \
  template JoinResult<D> join_all<D>(std::span<const LocalMap<D>>, const JoinOptions&);   \
  template JoinResult<D> join_all<D>(std::span<const Map<D>>, const MeasurementGraph<D>&, \
                                     const JoinOptions&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
