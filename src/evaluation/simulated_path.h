#pragma once

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "mapjoin/evaluation/simulate.h"

namespace mapjoin {

/// Where a simulated robot goes, and where it notices that it has been there before.
template <int D>
struct SimulatedPath {
  std::vector<Rigid<D>> poses;
  /// Loop closures (from, to), from > to, ascending in from.
  std::vector<std::pair<std::int32_t, std::int32_t>> closures;
};

/// Along the streets of a square grid, or the corridors of a cubic one; turns only where they
/// cross.
template <int D>
SimulatedPath<D> drive_streets(const SimulationOptions& options);

/// Rings on a sphere, from pole to pole.
SimulatedPath<3> fly_sphere(const SimulationOptions& options);

/// Cells of a lattice, hashed; negative ones too.
template <int D>
using Cell = std::array<std::int32_t, static_cast<std::size_t>(D)>;
template <int D>
std::uint64_t hash_of(const Cell<D>& cell) {
  std::uint64_t h = 0;
  for (const std::int32_t c : cell) h = h * 0x9e3779b97f4a7c15ULL + static_cast<std::uint32_t>(c);
  h ^= h >> 29;
  h *= 0xbf58476d1ce4e5b9ULL;
  return h ^ (h >> 32);
}

}  // namespace mapjoin
