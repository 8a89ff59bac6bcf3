#pragma once

#include <span>

#include "mapjoin/joining/options.h"

namespace mapjoin {

/// Joins by summaries, in paper or summary mode: every map on the way is (values, information) and
/// nothing else.
///
/// Local maps are the stars around the poses and the submaps of the graph, in the order of `order`
/// (first keys of their anchors; empty: ascending), or in summary mode with the graph tree its
/// leaves, each solved from its measurements.
template <int D>
JoinResult<D> join_by_summaries(const MeasurementGraph<D>& graph, std::span<const Key> order,
                                const JoinOptions& options);

/// The same for finished maps, in the given order, and the links between them.
///
/// Paper mode joins maps at a pose they share. Maps without poses are joined in the frame of common
/// points (Linear SLAM section 7), those that common_points() chooses; so are, at the root, maps
/// that have poses but share none.
template <int D>
JoinResult<D> join_by_summaries(std::span<const Map<D>> maps, const MeasurementGraph<D>& links,
                                const JoinOptions& options);

}  // namespace mapjoin
