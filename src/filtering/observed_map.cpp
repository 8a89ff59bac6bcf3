#include "mapjoin/filtering/observed_map.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <string>

#include "mapjoin/frames/align.h"
#include "mapjoin/frames/anchors.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/graph/index.h"
#include "mapjoin/graph/whole_piece.h"
#include "mapjoin/joining/leaf.h"
#include "mapjoin/solvers/observation_list.h"

namespace mapjoin {

namespace {

/// What the filter and a local map have in common: positions and orientations, as align wants them.
template <int D>
Values<D> known(const InformationFilter<D>& filter, const VariableSet<D>& variables) {
  ValuesBuilder<D> builder;
  for (int i = 0; i < variables.size(); ++i) {
    if (const auto number = filter.state().find(variables.key(i)))
      builder.add(variables.kind(i), variables.key(i), filter.state().estimate(*number));
  }
  return std::move(builder).build();
}

}  // namespace

template <int D>
ObservedMap<D> observed(const LocalMap<D>& local_map) {
  if (local_map.keys.empty()) throw InputError("the local map is empty: there is nothing in it");
  MeasurementGraphBuilder<D> builder;
  builder.add(local_map);
  ObservedMap<D> out;
  out.graph = std::move(builder).build();
  out.anchor = local_map.anchor;
  std::vector<std::int64_t> all(out.graph.size());
  std::iota(all.begin(), all.end(), 0);
  Places places(out.graph.variables.size());
  const std::vector<Piece<D>> pieces = leaf_pieces<D>(out.graph, all, places);
  if (pieces.size() != 1)
    throw DisconnectedError(fmt::format(
        "the local map of {} falls apart: its information leaves parts of it unconnected",
        to_string(local_map.anchor)));
  out.values = to_values(out.graph.variables, pieces[0]);
  out.values.transform(motion_into(out.anchor, out.values));
  std::vector<double*> pinned;
  for (const int i : anchor_variables(out.anchor, out.values.variables()))
    pinned.push_back(out.values.value(i));
  out.anchor.kind->pin(pinned.data());
  return out;
}

template <int D>
Rigid<D> placement(const InformationFilter<D>& filter, const Anchor<D>& anchor,
                   const Values<D>& values) {
  if (is_pose_anchor(anchor)) {
    if (const auto start = filter.state().find(anchor.keys[0]))
      return *reinterpret_cast<const Rigid<D>*>(filter.state().estimate(*start));
  }
  const Values<D> common = known(filter, values.variables());
  if (const auto T = align(common, values)) return *T;
  throw DisconnectedError(fmt::format(
      "the local map of {} shares {} variable{} with those before it, which do not say where it "
      "lies; it needs the pose it starts from, or {} common points",
      to_string(anchor), common.size(), common.size() == 1 ? "" : "s", D == 2 ? "two" : "three"));
}

template <int D>
void add_new_variables(InformationFilter<D>& filter, const Values<D>& placed) {
  const VariableSet<D>& variables = placed.variables();
  for (const bool poses : {false, true}) {
    for (int i = 0; i < variables.size(); ++i) {
      const bool pose = variables.key(i).type == Tag("pose");
      if (pose == poses && !filter.state().find(variables.key(i)))
        filter.add_variable(variables.kind(i), variables.key(i), placed.value(i));
    }
  }
}

template <int D>
void add_observed(InformationFilter<D>& filter, const MeasurementGraph<D>& graph) {
  const Piece<D> piece = whole_piece(graph, known(filter, graph.variables));
  Places places(graph.variables.size());
  const ObservationList<D> list(graph, piece, places);
  const std::vector<int> offsets = graph.variables.offsets();
  const int n = offsets.back();
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(n + 1, n);
  const DenseTarget target{H.data(), H.rows(), n, nullptr, 0, n};
  SubmapScratch scratch;
  std::vector<std::int32_t> rows;
  for (std::int64_t k = 0; k < static_cast<std::int64_t>(list.size()); ++k) {
    rows.clear();
    for (const std::int32_t place : list.clique(k)) rows.push_back(offsets[at(place)]);
    list.evaluate(k, piece, rows, &target, scratch);
  }
  std::vector<std::int32_t> numbers;
  for (int i = 0; i < graph.variables.size(); ++i)
    numbers.push_back(filter.state().require(graph.variables.key(i), "fusing a local map"));
  filter.add_information(numbers, H.topRows(n), H.row(n).transpose());
}

template <int D>
int end_pose(const InformationFilter<D>& filter, const ObservedMap<D>& map) {
  const VariableSet<D>& variables = map.values.variables();
  const int c = variables.find_column(Tag("pose"));
  if (c < 0) return -1;
  const auto& keys = variables.column(c).keys;
  const bool start_last = is_pose_anchor(map.anchor) && keys.back() == map.anchor.keys[0];
  const Key& last = start_last && keys.size() > 1 ? keys[keys.size() - 2] : keys.back();
  return filter.state().find(last).value_or(-1);
}

#define MAPJOIN_INSTANTIATE(D)                                                                     \
  template ObservedMap<D> observed<D>(const LocalMap<D>&);                                         \
  template Rigid<D> placement<D>(const InformationFilter<D>&, const Anchor<D>&, const Values<D>&); \
  template void add_new_variables<D>(InformationFilter<D>&, const Values<D>&);                     \
  template void add_observed<D>(InformationFilter<D>&, const MeasurementGraph<D>&);                \
  template int end_pose<D>(const InformationFilter<D>&, const ObservedMap<D>&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
