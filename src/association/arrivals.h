#pragma once

#include <functional>
#include <utility>
#include <vector>

#include "mapjoin/association/association.h"

namespace mapjoin {

/// Data association for local maps that arrive one at a time (SLSJF, Algorithm 2): what a
/// filtering/map_stream.h asks of every arriving local map.
///
///     MapStream<2> stream({.method = StreamMethod::kSlsjf, .associate = associate_arrivals<2>()});
///
/// \returns a function of the map so far and the arriving one, which gives pairs (key in the
/// arriving map, key in the map so far). Names of what may be matched mean nothing to it, poses
/// keep theirs: the local map begins at a pose that the map knows. Each call costs what associate()
/// does: a factorisation of the map's information and a selected inversion. The function throws as
/// associate() does.
template <int D>
std::function<std::vector<std::pair<Key, Key>>(const Map<D>&, const Map<D>&)> associate_arrivals(
    const AssociationOptions& options = {});

}  // namespace mapjoin
