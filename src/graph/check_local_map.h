#pragma once

#include "mapjoin/graph/map.h"

namespace mapjoin {

/// \throws InputError when a key is not of the type of its value.
template <int D>
void check_type(const VariableKind<D>& kind, const Key& key);

/// Do the parts of a local map belong together: keys, kinds, values, information and anchor?
/// \throws InputError that says what does not.
template <int D>
void check_local_map(const LocalMap<D>& map);

}  // namespace mapjoin
