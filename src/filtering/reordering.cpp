#include "mapjoin/filtering/reordering.h"

#include <algorithm>
#include <utility>

#include "mapjoin/graph/index.h"
#include "mapjoin/solvers/block_ordering.h"

namespace mapjoin {

namespace {

/// Features with their distance from the focus, the nearest first; of equals the later arrival.
template <int D>
std::vector<std::pair<double, std::int32_t>> by_distance(const FilterState<D>& state, int focus) {
  std::vector<std::pair<double, std::int32_t>> out;
  const auto here = state.position(focus);
  for (std::int32_t i = 0; i < state.size(); ++i) {
    if (i == focus || state.key(i).type == Tag("pose")) continue;
    const auto there = state.position(i);
    if (here && there) out.emplace_back((*there - *here).norm(), i);
  }
  std::sort(out.begin(), out.end(), [](const auto& a, const auto& b) {
    return a.first != b.first ? a.first < b.first : a.second > b.second;
  });
  return out;
}

}  // namespace

std::vector<std::int32_t> minimum_degree_order(const InformationSum& sum) {
  OrderingOptions options;
  options.method = OrderingMethod::kMinimumDegree;
  return order_blocks(sum.dims, {sum.clique_start, sum.variables}, options);
}

template <int D>
BottomOrder combined_order(const FilterState<D>& state, const InformationSum& sum, int focus,
                           int n0, double d0) {
  BottomOrder out;
  std::vector<char> low(at(state.size()), 0);
  low[at(focus)] = 1;
  out.bottom.push_back(focus);
  int scalars = state.dim(focus);
  for (const auto& [distance, i] : by_distance(state, focus)) {
    if (d0 > 0.0 ? distance > d0 : 2 * (scalars + state.dim(i)) > n0) break;
    low[at(i)] = 1;
    out.bottom.push_back(i);
    scalars += state.dim(i);
  }
  std::reverse(out.bottom.begin(), out.bottom.end());
  if (out.bottom.size() == at(state.size())) return out;
  for (const std::int32_t i : order_blocks_in_two(low, {sum.clique_start, sum.variables})) {
    if (low[at(i)] == 0) out.top.push_back(i);
  }
  return out;
}

template BottomOrder combined_order<2>(const FilterState<2>&, const InformationSum&, int, int,
                                       double);
template BottomOrder combined_order<3>(const FilterState<3>&, const InformationSum&, int, int,
                                       double);

}  // namespace mapjoin
