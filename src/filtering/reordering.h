#pragma once

#include <cstdint>
#include <vector>

#include "mapjoin/filtering/filter_state.h"
#include "mapjoin/solvers/bottom_cholesky.h"

/// \file
/// Orders of a filter's state (SLSJF, section III-F). Both are of whole variables and
/// deterministic.

namespace mapjoin {

/// All variables in a minimum degree order, the first to be eliminated first: least fill.
std::vector<std::int32_t> minimum_degree_order(const InformationSum& sum);

/// The combined order: what is within d0 of the focus stands at the bottom, nearest lowest; the
/// rest above it in a minimum degree order.
///
/// With d0 = 0 the nearest variables go to the bottom until half of n0 is filled. A robot sees
/// nothing but the bottom until it has gone some way, so the next local maps find the order as they
/// need it. The focus, a pose, is the lowest of all. Variables without position stay above.
struct BottomOrder {
  std::vector<std::int32_t> top;
  std::vector<std::int32_t> bottom;
};
template <int D>
BottomOrder combined_order(const FilterState<D>& state, const InformationSum& sum, int focus,
                           int n0, double d0);

}  // namespace mapjoin
