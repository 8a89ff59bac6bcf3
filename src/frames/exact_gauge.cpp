#include "mapjoin/frames/exact_gauge.h"

#include <fmt/format.h>

#include <utility>

#include "mapjoin/frames/change_frame.h"
#include "mapjoin/frames/gauge.h"

namespace mapjoin {

template <int D>
void require_information(const Map<D>& map) {
  if (map.information.size() == map.variables().size()) return;
  throw InputError(
      fmt::format("the map has {} variables but information on {}; join with "
                  "JoinOptions::information, or read a native map",
                  map.variables().size(), map.information.size()));
}

template <int D>
bool is_gauge_free(const Map<D>& map) {
  constexpr double kRounding = 1e-12;
  const Eigen::MatrixXd g = map.values.gauge();
  SymmetricBlockMatrix magnitude = map.information;
  for (double& v : magnitude.values()) v = std::abs(v);
  const Eigen::MatrixXd left = map.information.times(g);
  const Eigen::MatrixXd terms = magnitude.times(g.cwiseAbs());
  return (left.array().abs() <= kRounding * terms.array()).all();
}

template <int D>
Map<D> completed_where_solved(Map<D> map) {
  const Anchor<D> home = map.solved_in.kind != nullptr ? map.solved_in : map.anchor;
  const Anchor<D> anchor = map.anchor;
  if (home.kind == nullptr) return map;
  Values<D> values = map.values;
  map = change_frame(std::move(map), home);
  const AnchorRows rows = anchor_rows(home, map.values);
  if (rows.pinned.empty())
    throw InputError("the map was solved in " + to_string(home) +
                     ", which pins mixtures of coordinates: no row of the information stands for "
                     "them; solve it in the frame of a pose");
  leave_out(map.information, rows.pinned);
  map.information = complete_gauge(map.values, home, map.information);
  if (anchor.kind != nullptr) map = change_frame(std::move(map), anchor);
  map.values = std::move(values);
  map.anchor = map.solved_in = anchor;
  return map;
}

template <int D>
Map<D> exactly_gauge_free(Map<D> map) {
  if (map.solved_in.kind == nullptr || map.solved_in == map.anchor || is_gauge_free(map)) {
    return map;
  }
  return completed_where_solved(std::move(map));
}

#define MAPJOIN_INSTANTIATE(D)                         \
  template void require_information<D>(const Map<D>&); \
  template bool is_gauge_free<D>(const Map<D>&);       \
  template Map<D> exactly_gauge_free<D>(Map<D>);       \
  template Map<D> completed_where_solved<D>(Map<D>);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
