#pragma once

#include <memory>
#include <span>

#include "mapjoin/joining/options.h"

namespace mapjoin {

/// Solves a measurement graph by joining: every pose's measurements are a local map, and the local
/// maps are joined.
///
/// No initial guess is used or wanted. Disconnected data give one map for each piece, each in the
/// frame of its lowest pose, ordered by that pose; nothing is ever linked that no measurement
/// links. A piece without poses (feature-only maps) is in the frame of points that lie far apart
/// (frames/points_anchor.h), and the report notes which. \throws SingularError that names a
/// variable the measurements do not determine; CancelledError; InputError. Thread-safe for
/// different calls; `graph` is only read.
template <int D>
JoinResult<D> join_all(const MeasurementGraph<D>& graph, const JoinOptions& options = {});

/// The same without a copy: a single piece's map keeps `graph` itself as its observations.
template <int D>
JoinResult<D> join_all(std::shared_ptr<const MeasurementGraph<D>> graph,
                       const JoinOptions& options = {});

/// Joins a set of local maps, in their given order where the mode or the tree asks for one.
template <int D>
JoinResult<D> join_all(std::span<const LocalMap<D>> local_maps, const JoinOptions& options = {});

/// Joins finished maps, and measurements between their variables (`links`, may be empty).
///
/// In observe and optimal mode, maps that carry their observations are joined by those; a map
/// without them counts as one observation, exact in the frame it was solved in. In summary mode
/// only values and information are used.
template <int D>
JoinResult<D> join_all(std::span<const Map<D>> maps, const MeasurementGraph<D>& links,
                       const JoinOptions& options = {});

}  // namespace mapjoin
