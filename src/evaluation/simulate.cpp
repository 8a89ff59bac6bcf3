#include "mapjoin/evaluation/simulate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <unordered_map>

#include "mapjoin/evaluation/random.h"
#include "mapjoin/evaluation/simulated_path.h"

namespace mapjoin {

namespace {

constexpr std::pair<std::string_view, World> kWorlds[] = {{"manhattan", World::kManhattan},
                                                          {"sphere", World::kSphere},
                                                          {"grid3d", World::kGrid3d},
                                                          {"landmarks2d", World::kLandmarks2d},
                                                          {"landmarks3d", World::kLandmarks3d}};

bool has_features(World world) {
  return world == World::kLandmarks2d || world == World::kLandmarks3d;
}

void check(const SimulationOptions& o, int dimension_wanted) {
  const auto demand = [](bool ok, std::string_view what) {
    if (!ok) throw InputError(fmt::format("simulate: {}", what));
  };
  demand(dimension(o.world) == dimension_wanted,
         fmt::format("the world '{}' has {} dimensions, not {}", name(o.world), dimension(o.world),
                     dimension_wanted));
  demand(o.poses >= 1 && o.poses <= 1'000'000'000, "poses must be from 1 to 1000000000");
  for (const double sigma : {o.sigma_translation, o.sigma_rotation, o.sigma_feature}) {
    demand(std::isfinite(sigma) && sigma > 0.0,
           "sigmas must be above 0 (for exact measurements set noise to 0)");
  }
  demand(std::isfinite(o.noise) && o.noise >= 0.0, "noise must be 0 or more");
  demand(o.edges_per_pose >= 1.0 && o.edges_per_pose <= 4.0, "edges per pose must be from 1 to 4");
  demand(o.world_size >= 0.0 && o.world_size <= 1e9, "the world's size must be from 0 to 1e9 m");
  demand(o.sensor_range > 0.0 && o.sensor_range <= 1e9, "the sensor's range must be above 0");
  demand(o.visible_features >= 0.0 && o.visible_features <= 1000.0,
         "visible features must be from 0 to 1000");
  demand(o.max_observations >= 0, "the number of observations must be 0 or more");
}

/// The measured x: the true one disturbed in its tangent, translation first.
template <VariableType T>
ValueOf<T> disturbed(const ValueOf<T>& x, const TangentOf<T>& sigmas, double noise,
                     Random& random) {
  TangentOf<T> d;
  for (int k = 0; k < T::dim; ++k) d(k) = noise * sigmas(k) * random.normal();
  return T::template retract<double>(x, d);
}

template <VariableType T>
Mat<T::dim, T::dim> information_of(const TangentOf<T>& sigmas) {
  return sigmas.cwiseAbs2().cwiseInverse().asDiagonal();
}

template <int D>
void measure_poses(const SimulatedPath<D>& path, const SimulationOptions& o,
                   MeasurementGraphBuilder<D>& builder) {
  using Pose = PoseType<D>;
  TangentOf<Pose> sigmas;
  sigmas << Vec<D>::Constant(o.sigma_translation), Vec<kRotation<D>>::Constant(o.sigma_rotation);
  const auto information = information_of<Pose>(sigmas);
  Random random(o.seed, 3);
  builder.reserve(kind_of<Pose>(), path.poses.size() + path.closures.size());
  const auto measure = [&](std::size_t from, std::size_t to) {
    const Rigid<D> seen = path.poses[from].inverse() * path.poses[to];
    builder.template add<Pose>(pose_key(from), pose_key(to),
                               disturbed<Pose>(seen, sigmas, o.noise, random), information);
  };
  auto closure = path.closures.begin();
  for (std::size_t i = 0; i < path.poses.size(); ++i) {
    if (i > 0) measure(i - 1, i);
    for (; closure != path.closures.end() && closure->first == static_cast<int>(i); ++closure) {
      measure(i, static_cast<std::size_t>(closure->second));
    }
  }
}

/// Features scattered evenly over all of space, made where somebody looks.
///
/// Space is cut into cells as wide as the sensor's range. What is in a cell follows from the seed
/// and the cell alone, so that the world's size costs nothing.
template <int D>
class FeatureField {
 public:
  struct Feature {
    Vec<D> position;
    std::int64_t id = -1;  ///< in order of sighting; -1 while unseen
  };

  explicit FeatureField(const SimulationOptions& o) : range_(o.sensor_range), seed_(o.seed) {
    const double ball = D == 2 ? std::numbers::pi : 4.0 / 3.0 * std::numbers::pi;
    per_cell_ = o.visible_features / ball;
  }

  /// Indices of the features in range of a place.
  const std::vector<std::int32_t>& near(const Vec<D>& place) {
    Cell<D> cell;
    for (int k = 0; k < D; ++k) {
      cell[static_cast<std::size_t>(k)] = static_cast<std::int32_t>(std::floor(place(k) / range_));
    }
    if (around_.empty() || cell != centre_) enter(cell);
    near_.clear();
    for (const auto& [first, count] : around_) {
      for (std::int32_t f = first; f < first + count; ++f) {
        if ((at(f).position - place).squaredNorm() <= range_ * range_) near_.push_back(f);
      }
    }
    return near_;
  }
  Feature& at(std::int32_t index) { return features_[static_cast<std::size_t>(index)]; }

 private:
  struct Hash {
    std::size_t operator()(const Cell<D>& cell) const { return hash_of<D>(cell); }
  };
  using Range = std::pair<std::int32_t, std::int32_t>;  // first feature, number of them

  void enter(const Cell<D>& cell) {
    centre_ = cell;
    around_.clear();
    for (int code = 0; code < (D == 2 ? 9 : 27); ++code) {
      Cell<D> other = cell;
      int rest = code;
      for (std::int32_t& c : other) {
        c += rest % 3 - 1;
        rest /= 3;
      }
      around_.push_back(contents(other));
    }
  }
  Range contents(const Cell<D>& cell) {
    const auto [at, fresh] = cells_.try_emplace(cell);
    if (fresh) {
      Random random(seed_ ^ Random::mix(hash_of<D>(cell)), 4);
      const auto count = static_cast<std::int32_t>(per_cell_ + random.uniform());
      at->second = {static_cast<std::int32_t>(features_.size()), count};
      for (std::int32_t f = 0; f < count; ++f) {
        Feature feature;
        for (int k = 0; k < D; ++k) {
          feature.position(k) = range_ * (cell[static_cast<std::size_t>(k)] + random.uniform());
        }
        features_.push_back(feature);
      }
    }
    return at->second;
  }

  double range_;
  std::uint64_t seed_;
  double per_cell_;
  std::unordered_map<Cell<D>, Range, Hash> cells_;
  std::vector<Feature> features_;
  Cell<D> centre_{};
  std::vector<Range> around_;
  std::vector<std::int32_t> near_;
};

std::uint64_t first_feature_id(std::int64_t poses) {
  std::uint64_t id = 100000;
  while (id < static_cast<std::uint64_t>(poses)) id *= 10;
  return id;
}

template <int D>
void observe_features(const SimulatedPath<D>& path, const SimulationOptions& o,
                      MeasurementGraphBuilder<D>& builder, ValuesBuilder<D>& truth) {
  using Point = PointType<D>;
  const Vec<D> sigmas = Vec<D>::Constant(o.sigma_feature);
  const auto information = information_of<Point>(sigmas);
  const std::uint64_t base = first_feature_id(o.poses);
  FeatureField<D> field(o);
  Random choice(o.seed, 5);
  Random random(o.seed, 6);
  std::int64_t seen = 0;
  std::vector<std::int32_t> chosen;
  for (std::size_t i = 0; i < path.poses.size(); ++i) {
    const Rigid<D> from_map = path.poses[i].inverse();
    chosen = field.near(path.poses[i].t);
    while (static_cast<int>(chosen.size()) > o.max_observations) {  // any may be overlooked
      chosen[static_cast<std::size_t>(choice.below(static_cast<int>(chosen.size())))] =
          chosen.back();
      chosen.pop_back();
    }
    for (const std::int32_t f : chosen) {
      auto& feature = field.at(f);
      if (feature.id < 0) {
        feature.id = seen++;
        truth.template add<Point>(point_key(base + static_cast<std::uint64_t>(feature.id)),
                                  feature.position);
      }
      const Vec<D> z = from_map * feature.position;
      builder.template add<Point>(pose_key(i),
                                  point_key(base + static_cast<std::uint64_t>(feature.id)),
                                  disturbed<Point>(z, sigmas, o.noise, random), information);
    }
  }
}

}  // namespace

World parse_world(std::string_view text) {
  for (const auto& [known, world] : kWorlds) {
    if (known == text) return world;
  }
  throw InputError(
      fmt::format("there is no world '{}': choose manhattan, sphere, grid3d, "
                  "landmarks2d or landmarks3d",
                  text));
}

std::string_view name(World world) {
  for (const auto& [known, w] : kWorlds) {
    if (w == world) return known;
  }
  return "?";
}

int dimension(World world) {
  return world == World::kManhattan || world == World::kLandmarks2d ? 2 : 3;
}

SimulationOptions simulation_defaults(World world) {
  SimulationOptions options;
  options.world = world;
  if (world == World::kSphere) options.edges_per_pose = 2.0;
  if (has_features(world)) options.edges_per_pose = 1.0;
  return options;
}

template <int D>
Simulation<D> simulate(const SimulationOptions& options) {
  check(options, D);
  SimulatedPath<D> path;
  if constexpr (D == 3) {
    path = options.world == World::kSphere ? fly_sphere(options) : drive_streets<D>(options);
  } else {
    path = drive_streets<D>(options);
  }
  MeasurementGraphBuilder<D> builder;
  ValuesBuilder<D> truth;
  for (std::size_t i = 0; i < path.poses.size(); ++i) {
    truth.template add<PoseType<D>>(pose_key(i), path.poses[i]);
  }
  measure_poses(path, options, builder);
  if (has_features(options.world)) observe_features(path, options, builder, truth);
  return {std::move(builder).build(), std::move(truth).build()};
}

template Simulation<2> simulate<2>(const SimulationOptions&);
template Simulation<3> simulate<3>(const SimulationOptions&);

}  // namespace mapjoin
