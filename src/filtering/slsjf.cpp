#include "mapjoin/filtering/slsjf.h"

#include <fmt/format.h>

#include <memory>
#include <utility>

#include "mapjoin/frames/anchors.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/graph/whole_piece.h"
#include "mapjoin/joining/refine.h"
#include "mapjoin/joining/report.h"

namespace mapjoin {

namespace {

constexpr int kMostSolves = 100;

}  // namespace

template <int D>
Slsjf<D>::Slsjf(const FilterOptions& options) : options_(options), filter_(options) {}

template <int D>
Fusion Slsjf<D>::fuse(const LocalMap<D>& local_map) {
  Fusion fusion;
  const auto start = Clock::now();
  ObservedMap<D> map = observed(local_map);
  if (filter_.empty()) {
    filter_.start(map.values, map.anchor);
  } else {
    map.values.transform(placement(filter_, map.anchor, map.values));
    add_new_variables(filter_, map.values);
  }
  add_observed(filter_, map.graph);
  focus_ = end_pose(filter_, map);
  if (options_.relinearise_every > 0) kept_.push_back(std::move(map.graph));
  fusion.seconds_update = seconds_since(start);
  filter_.update(focus_, fusion);
  ++fused_;
  if (options_.relinearise_every > 0 && fused_ % options_.relinearise_every == 0) {
    const Fusion again = relinearise();
    fusion.relinearised = true;
    fusion.add_seconds(again);
  }
  return fusion;
}

template <int D>
Eigen::MatrixXd Slsjf<D>::covariance(std::span<const Key> keys) {
  std::vector<int> numbers;
  for (const Key& key : keys) numbers.push_back(filter_.state().require(key, "covariance"));
  return filter_.covariance(numbers);
}

template <int D>
Fusion Slsjf<D>::relinearise() {
  if (options_.relinearise_every <= 0)
    throw InputError(
        "this filter does not keep its local maps, so it cannot linearise them anew: "
        "set relinearise_every");
  Fusion fusion;
  const auto start = Clock::now();
  filter_.relinearise([&] {
    for (const MeasurementGraph<D>& graph : kept_) add_observed(filter_, graph);
  });
  fusion.seconds_update = seconds_since(start);
  filter_.update(focus_, fusion);
  return fusion;
}

namespace {

template <int D>
MeasurementGraph<D> graph_of(std::span<const LocalMap<D>> local_maps) {
  MeasurementGraphBuilder<D> builder;
  for (const LocalMap<D>& map : local_maps) builder.add(map);
  return std::move(builder).build();
}

template <int D>
Slsjf<D> fuse_all(std::span<const LocalMap<D>> local_maps, const FilterOptions& options,
                  const ProgressCallback& progress, FilterReport& report) {
  if (local_maps.empty()) throw InputError("there are no local maps: nothing to join");
  Slsjf<D> filter(options);
  for (const LocalMap<D>& map : local_maps) {
    const double done = static_cast<double>(report.fusions.size());
    if (progress && !progress({"fuse", done / static_cast<double>(local_maps.size())}))
      throw CancelledError("cancelled while fusing local maps");
    report.fusions.push_back(filter.fuse(map));
  }
  report.nonzeros = filter.filter().nonzeros();
  report.factor_nonzeros = filter.filter().factor_nonzeros();
  report.scalars = filter.filter().free_scalars();
  return filter;
}

}  // namespace

template <int D>
FilterResult<D> slsjf(std::span<const LocalMap<D>> local_maps, const FilterOptions& options,
                      const ProgressCallback& progress) {
  FilterResult<D> out;
  const Slsjf<D> filter = fuse_all(local_maps, options, progress, out.report);
  out.map = filter.map();
  out.report.chi2 = chi2_of(local_maps, out.map.values);
  return out;
}

template <int D>
double chi2_of(std::span<const LocalMap<D>> local_maps, const Values<D>& estimate) {
  const MeasurementGraph<D> graph = graph_of(local_maps);
  const Piece<D> piece = whole_piece(graph, estimate);
  Places places(graph.variables.size());
  return ObservationList<D>(graph, piece, places).chi2(piece);
}

FilterReport with_fusions(FilterReport fusions, const FilterReport& smoothing) {
  fusions.refine_solves = smoothing.refine_solves;
  fusions.seconds_refine = smoothing.seconds_refine;
  fusions.chi2 = smoothing.chi2;
  fusions.minimum = smoothing.minimum;
  return fusions;
}

template <int D>
FilterResult<D> islsjf(std::span<const LocalMap<D>> local_maps, const FilterOptions& options,
                       const ProgressCallback& progress) {
  FilterReport report;
  const Slsjf<D> filter = fuse_all(local_maps, options, progress, report);
  FilterResult<D> out = smooth(local_maps, filter.values(), filter.filter().anchor(), progress);
  out.report = with_fusions(std::move(report), out.report);
  return out;
}

template <int D>
FilterResult<D> smooth(std::span<const LocalMap<D>> local_maps, const Values<D>& estimate,
                       const Anchor<D>& anchor, const ProgressCallback& progress) {
  const auto start = Clock::now();
  const auto graph = std::make_shared<const MeasurementGraph<D>>(graph_of(local_maps));
  Piece<D> piece = whole_piece(*graph, estimate);
  Places places(graph->variables.size());
  ObservationSystem<D> system(*graph, piece, {}, places);
  FrontalCholesky cholesky;
  WorkerPool pool;
  const RefineResult refined =
      refine(*graph, piece, system, cholesky, pool, kMostSolves, kRefineTolerance, progress);
  FilterResult<D> out;
  out.report.refine_solves = refined.solves;
  out.report.chi2 = refined.chi2;
  out.report.minimum = refined.minimum;
  out.map.values = to_values(graph->variables, piece);
  out.map.information = system.information(piece);
  out.map.observations = graph;
  out.map = change_frame(std::move(out.map), anchor);
  out.map.solved_in = anchor;
  out.report.seconds_refine = seconds_since(start);
  return out;
}

template class Slsjf<2>;
template class Slsjf<3>;

#define MAPJOIN_INSTANTIATE(D)                                                           \
  template FilterResult<D> slsjf<D>(std::span<const LocalMap<D>>, const FilterOptions&,  \
                                    const ProgressCallback&);                            \
  template FilterResult<D> islsjf<D>(std::span<const LocalMap<D>>, const FilterOptions&, \
                                     const ProgressCallback&);                           \
  template FilterResult<D> smooth<D>(std::span<const LocalMap<D>>, const Values<D>&,     \
                                     const Anchor<D>&, const ProgressCallback&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
