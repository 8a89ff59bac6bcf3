#pragma once

#include "mapjoin/graph/measurement_graph.h"
#include "mapjoin/io/native_types.h"

namespace mapjoin::detail {

/// Reads the observations of a native map. Every index is verified: what comes back is safe to use.
/// \throws InputError that says what is wrong.
template <int D>
MeasurementGraph<D> read_observations(ByteReader in, const FileTypes<D>& types);

}  // namespace mapjoin::detail
