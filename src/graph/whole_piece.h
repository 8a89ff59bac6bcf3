#pragma once

#include <cstdint>
#include <numeric>

#include "mapjoin/graph/piece.h"

namespace mapjoin {

/// The piece that has all observations of a graph, at the given values.
template <int D>
Piece<D> whole_piece(const MeasurementGraph<D>& graph, const Values<D>& values) {
  Piece<D> piece = to_piece(graph.variables, values);
  piece.observations.resize(graph.size());
  std::iota(piece.observations.begin(), piece.observations.end(), std::int64_t{0});
  return piece;
}

}  // namespace mapjoin
