#pragma once

#include "mapjoin/filtering/information_filter.h"
#include "mapjoin/graph/map.h"

/// \file
/// A local map as an observation of a filter's state (SLSJF section II-A and III-E): its values are
/// what its variables look like from its anchor, with the local map's own covariance as noise.

namespace mapjoin {

/// A local map ready to be fused.
template <int D>
struct ObservedMap {
  MeasurementGraph<D> graph;  ///< what it observes
  Values<D> values;           ///< every variable of it, its anchor too, in the anchor's frame
  Anchor<D> anchor;
};

/// Cost: O(n + blocks) of the local map. \throws InputError that says what is wrong with the local
/// map; DisconnectedError when its information leaves a part of it unconnected.
template <int D>
ObservedMap<D> observed(const LocalMap<D>& local_map);

/// Where the local map lies in the frame of the filter: at its start pose, where the filter knows
/// it (as published), else by the best rigid fit over all common variables. \throws
/// DisconnectedError that says what is missing.
template <int D>
Rigid<D> placement(const InformationFilter<D>& filter, const Anchor<D>& anchor,
                   const Values<D>& values);

/// Initialises variables that the filter does not know yet (III-D): features first, poses last.
template <int D>
void add_new_variables(InformationFilter<D>& filter, const Values<D>& placed);

/// Adds the local map's information (8), linearised at the filter's estimates. All of its variables
/// have to be there. Cost: O(n^2).
template <int D>
void add_observed(InformationFilter<D>& filter, const MeasurementGraph<D>& graph);

/// The number in the state of the pose where the local map ends: of its poses the last one, its
/// anchor where there is no other; -1 where it has none.
template <int D>
int end_pose(const InformationFilter<D>& filter, const ObservedMap<D>& map);

}  // namespace mapjoin
