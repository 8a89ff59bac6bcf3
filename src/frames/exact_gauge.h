#pragma once

#include "mapjoin/graph/map.h"

namespace mapjoin {

/// \throws InputError when the map comes without its information, as joins leave it out on request
/// and g2o files have none.
template <int D>
void require_information(const Map<D>& map);

/// Does moving the whole map cost nothing, up to rounding? Every row of information * gauge within
/// 1e-12 of the terms it sums. True for maps that were imported, re-framed or solved from their
/// measurements; not for summary joins of maps that disagreed. O(blocks).
template <int D>
bool is_gauge_free(const Map<D>& map);

/// The same map with information that is gauge-free to rounding: completed at the anchor it was
/// solved in, where it is exact, and solved_in set to its anchor. Returned as it is when nothing is
/// missing or when it is in the frame it was solved in. O(n + blocks), and a row of blocks more.
/// \throws InputError when `solved_in` pins mixtures of coordinates.
template <int D>
Map<D> exactly_gauge_free(Map<D> map);

/// The completion itself, whatever the frame: leaves out what `solved_in` pins and fills it in from
/// the rest. For a map that is about to lose the variables it was solved in.
template <int D>
Map<D> completed_where_solved(Map<D> map);

}  // namespace mapjoin
