#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "mapjoin/graph/piece.h"

/// \file
/// Absolute measurements that are no local maps.
///
/// A surveyed pose places whatever is known relative to it: it is a measurement like any other. A
/// satellite position is not. It says nothing of the pose's orientation, so nothing can be laid out
/// from it, and a star of such measurements around the world is no map. What is relative is joined
/// first, and then laid on all of them at once, in closed form.

namespace mapjoin {

/// Observations of poses from the world that cannot place a pose: no information on its rotation
/// (less than 1/rad^2: an orientation known to a radian is none) or on some direction of its
/// position. Ascending numbers. O(measurements).
template <int D>
std::vector<std::int64_t> partial_world_measurements(const MeasurementGraph<D>& graph);

/// Lays joined pieces into the frame of the world by such measurements, together with what they
/// share with the piece that holds the world, if one does: the best rigid fit (frames/align.h).
/// Those that are placed become one piece with the world in it, and with their partial
/// measurements. Pieces that too few of them speak of stay apart, without; `notes` gets a sentence
/// for each.
template <int D>
std::vector<Piece<D>> place_in_world(const MeasurementGraph<D>& graph,
                                     const std::vector<std::int64_t>& partial,
                                     std::vector<Piece<D>> pieces, std::vector<std::string>& notes);

}  // namespace mapjoin
