#pragma once

#include "mapjoin/graph/map.h"

namespace mapjoin {

/// A finished map as one integrated observation (SLSJF section II-A): its values in the frame it
/// was solved in, with the information over what that frame leaves free. O(n + blocks). \throws
/// InputError when its anchor pins mixtures of scalars.
template <int D>
LocalMap<D> as_local_map(const Map<D>& map);

}  // namespace mapjoin
