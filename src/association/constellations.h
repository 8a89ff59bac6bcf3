#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "mapjoin/association/association.h"
#include "mapjoin/graph/map.h"

/// \file
/// Where one map lies in another when they share nothing by key: two recordings of the same place.
/// The points of both are all there is, and what does not depend on any frame are the distances
/// between them.

namespace mapjoin {

struct ConstellationOptions {
  int neighbours = 8;   ///< triangles are made of each point and two of this many nearest to it
  double gate = 0.999;  ///< probability with which a side of a triangle is within the gate
  /// Pairs of points that must fit at the least. A placement by fewer is chance.
  int least_matches = 6;
  /// The best placement must fit at least this many times as many points as any other one. Where
  /// points stand in regular rows none does.
  double least_ratio = 1.5;
};

/// A placement found, and the points it was found by.
template <int D>
struct Placement {
  Rigid<D> a_from_b;                       ///< lays map B on map A
  std::vector<std::pair<Key, Key>> names;  ///< points of B, and those of A that they are
  int rival = 0;                           ///< points that the best other placement would fit
};

/// Finds how B lies in A by constellations of points: three neighbouring points of B whose
/// distances are those of three of A, all within what their covariances allow, give a placement; it
/// is judged by how many other points of B come to lie where A has one.
///
/// Two placements are the same when they move the points of B to the same places, within the
/// distance of neighbours. \returns nothing when no placement fits enough points, or when another
/// fits nearly as many: then nobody can tell. Mirror images do not fit. O(triangles log triangles),
/// and O(points log points) for each pair of triangles that agree; one factorisation of each map.
/// \throws SingularError; InputError when a map has no anchor or no information.
template <int D>
std::optional<Placement<D>> place_by_constellations(const Map<D>& a, const Map<D>& b,
                                                    const ConstellationOptions& options = {});

/// Which variables of B are in A, where neither keys nor a pose say anything: placed by
/// constellations, then associated in full (association.h). The points by which B was placed count
/// as matches.
/// \throws DisconnectedError when there is no placement, or no clear one.
template <int D>
Association associate_unplaced(const Map<D>& a, const Map<D>& b,
                               const AssociationOptions& options = {},
                               const ConstellationOptions& constellations = {});

}  // namespace mapjoin
