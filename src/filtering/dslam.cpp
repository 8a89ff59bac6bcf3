#include "mapjoin/filtering/dslam.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "mapjoin/filtering/observed_map.h"
#include "mapjoin/filtering/relative_information.h"
#include "mapjoin/frames/best_points.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/frames/local_map.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/joining/common_points.h"
#include "mapjoin/joining/features_only.h"
#include "mapjoin/joining/join.h"
#include "mapjoin/joining/join_all.h"
#include "mapjoin/joining/report.h"
#include "mapjoin/solvers/covariance.h"
#include "mapjoin/solvers/marginalize.h"

namespace mapjoin {

namespace {

constexpr int kMostCandidates = 12;

/// f_1 and f_2 (in space f_3 too): features of both that the local map can tell apart, far from
/// each other. Nothing where there are none.
template <int D>
std::optional<Anchor<D>> common_frame(const FilterState<D>& state, const Map<D>& local) {
  std::vector<Key> keys;
  std::vector<Vec<D>> positions;
  const int c = local.variables().find_column(Tag("point"));
  if (c < 0) return std::nullopt;
  for (const Key& key : local.variables().column(c).keys) {
    if (!state.find(key)) continue;
    keys.push_back(key);
    positions.push_back(local.values.point(key));
  }
  if (keys.size() < static_cast<std::size_t>(D)) return std::nullopt;
  std::vector<Key> chosen;
  CandidatePoints<D> candidates;
  for (const int k : spread_points<D>(positions, kMostCandidates)) {
    chosen.push_back(keys[static_cast<std::size_t>(k)]);
    candidates.positions.push_back(positions[static_cast<std::size_t>(k)]);
  }
  candidates.covariance = Covariance<D>(local).of(chosen);
  const auto best = best_points<D>(chosen, std::span(&candidates, 1));
  if (!best) return std::nullopt;
  return best->anchor;
}

template <int D>
Anchor<D> required_frame(const FilterState<D>& state, const Map<D>& local) {
  if (auto frame = common_frame(state, local)) return *frame;
  throw DisconnectedError(fmt::format(
      "a local map with {} shares fewer than {} features with the map so far that it can tell "
      "apart; build larger local maps, or join it with a neighbour first",
      to_string(local.variables().key(0)), D == 2 ? "two" : "three"));
}

/// All but the poses, in the frame the map's information is exact in.
template <int D>
Map<D> without_poses(const Map<D>& map) {
  const std::vector<int> features = features_of(map.variables());
  if (features.size() == static_cast<std::size_t>(map.variables().size())) return map;
  Map<D> out = marginalize(map, std::span<const int>(features));
  out.solved_in = out.anchor;  // gauge-free to rounding: any frame is as good
  return out;
}

/// The pose of the anchor, and the features: the first local map without its end pose.
template <int D>
Map<D> without_other_poses(const Map<D>& map) {
  if (!is_pose_anchor(map.anchor))
    throw InputError(
        fmt::format("D-SLAM map joining begins with a local map in the frame of the pose it starts "
                    "from, not of "
                    "{}",
                    to_string(map.anchor)));
  std::vector<int> keep = features_of(map.variables());
  keep.push_back(map.variables().require(map.anchor.keys[0], "anchor"));
  std::sort(keep.begin(), keep.end());
  Map<D> out = marginalize(map, std::span<const int>(keep));
  out.solved_in = out.anchor;
  return out;
}

template <int D>
MeasurementGraph<D> graph_of(const LocalMap<D>& map) {
  MeasurementGraphBuilder<D> builder;
  builder.add(map);
  return std::move(builder).build();
}

bool points_alone(const VariableSet<2>& variables) {
  return variables.columns().size() == 1 && variables.column(0).kind->tag == Tag("point");
}

/// (6) with the distances and angles of (3), (4).
void add_distances_and_angles(InformationFilter<2>& filter, const RelativeInformation& relative) {
  std::vector<std::int32_t> numbers;
  Eigen::Matrix2Xd X(2, static_cast<Eigen::Index>(relative.features.size()));
  for (const Key& key : relative.features) {
    numbers.push_back(filter.state().require(key, "fusing relative information"));
    const double* const x = filter.state().estimate(numbers.back());
    X.col(static_cast<Eigen::Index>(numbers.size()) - 1) << x[0], x[1];
  }
  Eigen::MatrixXd J;
  const Eigen::VectorXd h = relative_positions(X, &J);
  const Eigen::MatrixXd JtI = J.transpose() * relative.information;
  filter.add_information(numbers, JtI * J, JtI * relative_residual(relative.z, h));
}

}  // namespace

template <int D>
Fusion DslamJoin<D>::fuse(const LocalMap<D>& local_map) {
  return fuse(to_map(local_map));
}

template <int D>
Fusion DslamJoin<D>::fuse(const Map<D>& map) {
  Fusion fusion;
  const auto start = Clock::now();
  if (filter_.empty()) {
    const Map<D> first = without_other_poses(map);
    filter_.start(first.values, first.anchor);
    add_observed(filter_, graph_of(as_local_map(first)));
  } else {
    fuse_relative(without_poses(map));
  }
  fusion.seconds_update = seconds_since(start);
  filter_.update(-1, fusion);
  ++fused_;
  return fusion;
}

template <int D>
void DslamJoin<D>::fuse_relative(const Map<D>& features) {
  const Anchor<D> frame = required_frame(filter_.state(), features);
  Map<D> local = change_frame(features, frame);
  local.solved_in = frame;
  Values<D> placed = local.values;
  placed.transform(placement(filter_, frame, local.values));
  add_new_variables(filter_, placed);
  if constexpr (D == 2) {
    if (points_alone(local.variables())) {
      add_distances_and_angles(filter_, relative_information(local, frame.keys[0], frame.keys[1]));
      return;
    }
  }
  add_observed(filter_, graph_of(as_local_map(local)));
}

template <int D>
Eigen::MatrixXd DslamJoin<D>::covariance(std::span<const Key> keys) {
  std::vector<int> numbers;
  for (const Key& key : keys) numbers.push_back(filter_.state().require(key, "covariance"));
  return filter_.covariance(numbers);
}

template <int D>
RobotLocation<D> DslamJoin<D>::locate(const LocalMap<D>& local_map) const {
  const Map<D> map = to_map(local_map);
  const Anchor<D> frame = required_frame(filter_.state(), without_poses(map));
  const Values<D> features = subset(map.values, features_of(map.variables()));
  const Rigid<D> T = placement(filter_, frame, features);
  RobotLocation<D> out{T, T};  // the local map is written in the frame of its start pose
  for (const int i : poses_of(map.variables())) {
    const Key& key = map.variables().key(i);
    if (key != map.anchor.keys[0]) out.end = T * map.values.pose(key);
  }
  return out;
}

template <int D>
std::vector<Key> gated_features(const Values<D>& global, const Values<D>& local, const Key& f1,
                                double margin) {
  const auto farther = [&](const Values<D>& values, auto&& visit) {
    const int c = values.variables().find_column(Tag("point"));
    if (c < 0) return;
    for (const Key& key : values.variables().column(c).keys)
      visit(key, (values.point(key) - values.point(f1)).norm());
  };
  double radius = 0.0;
  farther(local, [&](const Key&, double d) { radius = std::max(radius, d); });
  std::vector<Key> out;
  farther(global, [&](const Key& key, double d) {
    if (d <= radius + margin) out.push_back(key);
  });
  return out;
}

template <int D>
DslamInput<D> dslam_input(std::span<const LocalMap<D>> local_maps) {
  FeatureOnlyMaps<D> features = features_only(local_maps);
  DslamInput<D> out;
  for (std::size_t k = 0; k < features.maps.size(); ++k) out.parts.push_back(features.parts(k));
  const auto begin = local_maps.first(static_cast<std::size_t>(out.parts[0]));
  if (begin.size() == 1) {
    out.first = to_map(begin[0]);
  } else {
    JoinOptions options;
    options.mode = Mode::kObserve;
    options.tree = TreeShape::kOrder;
    out.first = change_frame(std::move(join_all(begin, options).maps.at(0)), begin[0].anchor);
    out.first.observations = nullptr;
    out.first.solved_in = out.first.anchor;
  }
  out.first = without_other_poses(out.first);
  out.first_points = features.maps[0].anchor;
  out.further.assign(std::make_move_iterator(features.maps.begin() + 1),
                     std::make_move_iterator(features.maps.end()));
  return out;
}

namespace {

template <int D>
DslamJoin<D> fuse_input(const DslamInput<D>& input, const FilterOptions& options,
                        const ProgressCallback& progress, FilterReport& report) {
  DslamJoin<D> filter(options);
  report.fusions.push_back(filter.fuse(input.first));
  for (const Map<D>& map : input.further) {
    const double done = static_cast<double>(report.fusions.size());
    if (progress && !progress({"fuse", done / static_cast<double>(input.further.size() + 1)}))
      throw CancelledError("cancelled while fusing local maps");
    report.fusions.push_back(filter.fuse(map));
  }
  report.nonzeros = filter.filter().nonzeros();
  report.factor_nonzeros = filter.filter().factor_nonzeros();
  report.scalars = filter.filter().free_scalars();
  return filter;
}

/// The same information as observations in the frames of points, the start pose a term of the
/// first: no other local map knows of it, so it takes nothing from what that says of its features.
template <int D>
std::vector<LocalMap<D>> as_observations(const DslamInput<D>& input) {
  std::vector<LocalMap<D>> out;
  Map<D> first = change_frame(input.first, input.first_points);
  first.solved_in = first.anchor;
  out.push_back(as_local_map(first));
  for (const Map<D>& map : input.further) out.push_back(as_local_map(map));
  return out;
}

}  // namespace

template <int D>
FilterResult<D> dslam(std::span<const LocalMap<D>> local_maps, const FilterOptions& options,
                      const ProgressCallback& progress) {
  const DslamInput<D> input = dslam_input(local_maps);
  FilterResult<D> out;
  const DslamJoin<D> filter = fuse_input(input, options, progress, out.report);
  out.map = filter.map();
  const std::vector<LocalMap<D>> observations = as_observations(input);
  out.report.chi2 = chi2_of(std::span<const LocalMap<D>>(observations), out.map.values);
  return out;
}

template <int D>
FilterResult<D> idslam(std::span<const LocalMap<D>> local_maps, const FilterOptions& options,
                       const ProgressCallback& progress) {
  const DslamInput<D> input = dslam_input(local_maps);
  FilterReport report;
  const DslamJoin<D> filter = fuse_input(input, options, progress, report);
  const std::vector<LocalMap<D>> observations = as_observations(input);
  FilterResult<D> out = smooth(std::span<const LocalMap<D>>(observations), filter.values(),
                               filter.filter().anchor(), progress);
  out.report = with_fusions(std::move(report), out.report);
  return out;
}

template class DslamJoin<2>;
template class DslamJoin<3>;

#define MAPJOIN_INSTANTIATE(D)                                                                \
  template std::vector<Key> gated_features<D>(const Values<D>&, const Values<D>&, const Key&, \
                                              double);                                        \
  template DslamInput<D> dslam_input<D>(std::span<const LocalMap<D>>);                        \
  template FilterResult<D> dslam<D>(std::span<const LocalMap<D>>, const FilterOptions&,       \
                                    const ProgressCallback&);                                 \
  template FilterResult<D> idslam<D>(std::span<const LocalMap<D>>, const FilterOptions&,      \
                                     const ProgressCallback&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
