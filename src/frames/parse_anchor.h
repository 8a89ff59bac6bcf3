#pragma once

#include <cstdint>
#include <string_view>

#include "mapjoin/graph/anchor.h"

namespace mapjoin {

/// Inverse of to_string for the anchors that come with mapjoin: a pose, "pose:12" or "1/pose:12",
/// or points, "points:84,85" in the plane and "points:84,85,86" in space, where "points:1/84,1/85"
/// are those of session 1. Ids without a session are of `session`. Whether there are such variables
/// is not looked at. \throws InputError that says what an anchor looks like, or how many points are
/// wanted, or which is named twice.
template <int D>
Anchor<D> parse_anchor(std::string_view text, std::uint32_t session = 0);

}  // namespace mapjoin
