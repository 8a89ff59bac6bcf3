#pragma once

#include <map>
#include <memory>
#include <utility>

#include "mapjoin/evaluation/simulate.h"
#include "mapjoin/joining/join_all.h"

namespace mapjoin::benchmarks {

/// A simulated world and its optimum, made once and shared by all kernels that ask for it.
template <int D>
struct SolvedWorld {
  MeasurementGraph<D> graph;
  Map<D> map;

  /// Streets in the plane, corridors in space.
  static const SolvedWorld& of_size(std::int64_t poses) {
    static std::map<std::int64_t, std::unique_ptr<SolvedWorld>> made;
    std::unique_ptr<SolvedWorld>& world = made[poses];
    if (world == nullptr) {
      SimulationOptions options = simulation_defaults(D == 2 ? World::kManhattan : World::kGrid3d);
      options.poses = poses;
      world = std::make_unique<SolvedWorld>();
      world->graph = simulate<D>(options).graph;
      world->map = std::move(join_all(world->graph).maps.at(0));
    }
    return *world;
  }
};

}  // namespace mapjoin::benchmarks

/// Runs a kernel, a function template over the dimension, in the plane and in space, on worlds of
/// several sizes.
#define MAPJOIN_KERNEL(kernel)                                                            \
  BENCHMARK(kernel<2>)->Arg(1000)->Arg(10000)->Arg(50000)->Unit(benchmark::kMicrosecond); \
  BENCHMARK(kernel<3>)->Arg(1000)->Arg(10000)->Unit(benchmark::kMicrosecond)
