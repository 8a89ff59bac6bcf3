#pragma once

#include "mapjoin/graph/map.h"

namespace mapjoin {

/// \throws InputError when a key is not of the type of its value.
template <int D>
void check_type(const VariableKind<D>& kind, const Key& key);

/// \throws InputError when an anchor has no kind, another number of keys than its kind asks for,
/// keys of other types, or a key twice.
template <int D>
void check_anchor(const Anchor<D>& anchor);

/// Do the parts of a local map belong together: keys, kinds, values, information and anchor?
/// Are the values written in the anchor's frame, where that is not a pose's? \throws InputError
/// that says what does not or is not; DegenerateFrameError when the anchor fixes no frame.
template <int D>
void check_local_map(const LocalMap<D>& map);

}  // namespace mapjoin
