#pragma once

#include <optional>
#include <span>

#include "mapjoin/frames/best_points.h"
#include "mapjoin/graph/map.h"
#include "mapjoin/joining/join_equations.h"

namespace mapjoin {

/// The points that maps share and that fix a frame best (frames/best_points.h): what feature-only
/// maps are joined in the frame of. Of a single map, the best of all its points.
///
/// Candidates are up to twelve of the common points, far from one another in the first map.
/// \returns nothing when the maps share too few, or none that each map can tell apart: no two
/// points in the plane, no three in space that are not collinear, with lengths of more than three
/// standard deviations. One sparse factorisation of each map's information.
/// \throws SingularError naming a variable that the information does not determine.
template <int D>
std::optional<ChosenPoints<D>> common_points(const VariableSet<D>& all,
                                             std::span<const Summary<D>* const> maps);

template <int D>
std::optional<ChosenPoints<D>> common_points(std::span<const Map<D>* const> maps);

}  // namespace mapjoin
