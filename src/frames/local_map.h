#pragma once

#include "mapjoin/graph/map.h"

namespace mapjoin {

/// A finished map as one integrated observation (SLSJF section II-A): its values in the frame it
/// was solved in, with the information over what that frame leaves free.
///
/// An anchor that pins mixtures of scalars leaves none of them out: then it is the gauge-free
/// information of all, which is the same observation, as what is pinned has no residual. O(n +
/// blocks).
template <int D>
LocalMap<D> as_local_map(const Map<D>& map);

}  // namespace mapjoin
