#pragma once

#include <cstdint>
#include <string_view>

#include "mapjoin/graph/map.h"

namespace mapjoin {

/// Worlds whose truth is known.
enum class World {
  kManhattan,    ///< the plane: a drive through streets on a grid, loop closures at revisits
  kSphere,       ///< space: rings on a sphere from pole to pole, each pose linked to the ring below
  kGrid3d,       ///< space: a flight through a lattice of corridors, loop closures at revisits
  kLandmarks2d,  ///< the streets again, loops closed by point features alone
  kLandmarks3d   ///< the corridors again, likewise
};

/// "manhattan", "sphere", "grid3d", "landmarks2d", "landmarks3d". \throws InputError.
World parse_world(std::string_view name);
std::string_view name(World world);
/// 2 or 3.
int dimension(World world);

/// What to simulate. Take simulation_defaults(world) and change what you like.
struct SimulationOptions {
  World world = World::kManhattan;
  std::int64_t poses = 1000;
  std::uint64_t seed = 1;

  double sigma_translation = 0.05;  ///< of a relative pose, metres a coordinate
  double sigma_rotation = 0.02;     ///< radians an axis
  double sigma_feature = 0.1;       ///< of an observed feature, metres a coordinate
  /// Multiplies the noise that is drawn, not the sigmas that the information is made of: 0 gives
  /// measurements that are exact.
  double noise = 1.0;

  /// Relative poses a pose, odometry included: 1 is odometry alone. At most 4; reached on average
  /// where the path comes back to itself often enough.
  double edges_per_pose = 1.5;
  /// Side of the streets' square or corridors' cube, radius of the sphere, in metres. 0: such that
  /// every street is driven about twice, and poses on the sphere stand a metre apart.
  double world_size = 0.0;
  double sensor_range = 5.0;      ///< within which features are seen, metres
  double visible_features = 5.0;  ///< in range of a pose, on average: sets their density
  int max_observations = 12;      ///< of features from one pose
};

/// Manhattan: as above. Sphere: two edges a pose. Landmark worlds: odometry alone and features.
SimulationOptions simulation_defaults(World world);

/// A world as measured, and as it is.
template <int D>
struct Simulation {
  MeasurementGraph<D> graph;
  Values<D> truth;  ///< in the frame of pose 0, of the same variables
};

/// Makes a world. The same options give the same numbers, whatever the compiler or standard
/// library.
///
/// Poses are 0 .. n-1 in order of time. Features are numbered in order of sighting, from 100000 or
/// the next power of ten above the poses, so that ids are unique in a g2o file. Odometry goes from
/// each pose to the next, loop closures from a pose to one that it comes back to, at most four from
/// and four to any pose. Noise is normal, independent, and what the information says it is.
/// O(poses), whatever the size of the world: a million poses take a few seconds.
/// \throws InputError when an option makes no sense or the world has another dimension.
template <int D>
Simulation<D> simulate(const SimulationOptions& options);

extern template Simulation<2> simulate<2>(const SimulationOptions&);
extern template Simulation<3> simulate<3>(const SimulationOptions&);

}  // namespace mapjoin
