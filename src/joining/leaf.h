#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mapjoin/graph/piece.h"

namespace mapjoin {

/// The local maps of a leaf, as pieces to be joined: every pose's measurements are a star around
/// it, and stars that share a pose are laid on one another along the shortest chain of
/// measurements. Submaps in frames of features, and poses that share no more than features with the
/// rest, are pieces of their own.
///
/// No value from outside is used. Cost: O(observations of the leaf).
template <int D>
std::vector<Piece<D>> leaf_pieces(const MeasurementGraph<D>& graph,
                                  std::span<const std::int64_t> observations, Places& places);

}  // namespace mapjoin
