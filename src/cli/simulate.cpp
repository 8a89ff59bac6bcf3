#include "mapjoin/evaluation/simulate.h"

#include <fmt/format.h>

#include <memory>
#include <optional>

#include "mapjoin/building/simulate_log.h"
#include "mapjoin/cli/arguments.h"
#include "mapjoin/cli/commands.h"
#include "mapjoin/cli/output.h"
#include "mapjoin/cli/progress.h"
#include "mapjoin/io/g2o.h"

namespace mapjoin::cli {

namespace {

constexpr const char* kSimulateExamples = R"(Worlds:
  manhattan     2D: a drive through streets on a grid, loop closures at revisits
  sphere        3D: rings on a sphere, each pose linked to the ring below
  grid3d        3D: a flight through a lattice of corridors, loop closures at revisits
  landmarks2d   2D: the streets again, loops closed by point features alone
  landmarks3d   3D: the corridors again, likewise
  beacons       2D: a field of 50 x 50 beacons, seen by range and bearing, and a vehicle's speed and
                turn rate: the simulation of SLSJF. Raw measurements, so OUTPUT is a folder of CSV
                files: what 'mapjoin build' reads, and the truth

Examples:
  mapjoin simulate manhattan --poses 3500 --seed 1 --output world.g2o --truth truth.g2o
  mapjoin simulate sphere --poses 2500 --sigma-rotation 0.1 --output hard.g2o
  mapjoin simulate beacons --poses 27924 --output field
  mapjoin simulate beacons --beacons-a-side 14 --world-size 40 --sensor-range 5 --output square
      The simulation of D-SLAM map joining.
  mapjoin simulate landmarks2d --poses 1000 --sensor-range 8 --visible-features 10 --output l.g2o

The same options give the same world everywhere. Ids of features begin at 100000, or at the next
power of ten above the poses.
)";

constexpr const char* kBeacons = "beacons";  // the one world of raw measurements

struct SimulateCommand {
  std::string world;
  std::string output;
  std::string truth;
  SimulationOptions options;
  std::optional<double> edges_per_pose;
  int beacons_a_side = 50;
  double speed = 1.0;
  bool sensor_range_given = false;  ///< worlds differ in their defaults
};

template <int D>
void simulate_and_write(const SimulateCommand& a, const SimulationOptions& options) {
  const Stopwatch making;
  const Simulation<D> world = simulate<D>(options);
  const double made = making.seconds();
  if (world.graph.size() == 0) {
    throw InputError("a world of one pose has no measurements; ask for --poses 2 or more");
  }
  const Stopwatch writing;
  OutputFiles files;
  const std::string comment =
      fmt::format("mapjoin simulate {} --poses {} --seed {}", a.world, options.poses, options.seed);
  files.write(a.output, [&](const auto& at) {
    G2oWriteOptions how;
    how.comment = comment;
    write_g2o<D>(at, world.graph, nullptr, how);
  });
  if (!a.truth.empty()) {
    files.write(a.truth, [&](const auto& at) {
      G2oWriteOptions how;
      how.comment = comment + ": truth, in the frame of pose 0";
      write_g2o<D>(at, world.truth, how);
    });
  }
  files.commit();
  fmt::print("{}: {} poses, {} features, {} measurements ({:.2f} s made, {:.2f} s written)\n",
             a.output, options.poses, world.truth.size() - options.poses, world.graph.size(), made,
             writing.seconds());
}

void simulate_beacons(const SimulateCommand& a) {
  if (!a.truth.empty()) {
    throw InputError("the world of beacons has its truth in the output folder: leave --truth out");
  }
  LogSimulationOptions options;
  options.poses = a.options.poses;
  options.seed = a.options.seed;
  options.noise = a.options.noise;
  options.beacons_a_side = a.beacons_a_side;
  options.speed = a.speed;
  if (a.options.world_size > 0.0) options.spacing = a.options.world_size / a.beacons_a_side;
  if (a.sensor_range_given) options.sensor_range = a.options.sensor_range;
  OutputFolder folder(a.output);
  const SimulatedLog world = simulate_log(options);
  write_csv_log(folder.path(), world);
  folder.commit();
  fmt::print("{}: {} poses, {} beacons, {} measurements\n", a.output, options.poses,
             world.truth.size() - options.poses, world.log.size());
}

void run_simulate(const SimulateCommand& a) {
  if (a.world == kBeacons) return simulate_beacons(a);
  for (const std::string& path : {a.output, a.truth}) {
    if (path.empty()) continue;
    if (output_format(path) != OutputFormat::kG2o) {
      throw InputError(fmt::format("{}: worlds and their truth are written as .g2o", path));
    }
    OutputFiles::expect(path);
  }
  SimulationOptions options = a.options;
  options.world = parse_world(a.world);
  options.edges_per_pose =
      a.edges_per_pose.value_or(simulation_defaults(options.world).edges_per_pose);
  if (dimension(options.world) == 2) {
    simulate_and_write<2>(a, options);
  } else {
    simulate_and_write<3>(a, options);
  }
}

void add_world_options(Command& command, SimulateCommand& a) {
  SimulationOptions& o = a.options;
  const auto option = [&](const std::string& name, auto& target, const std::string& help) {
    command.add_option(name, target, help).show_default();
  };
  option("--poses", o.poses, "How many");
  option("--seed", o.seed, "Another seed, another world");
  option("--sigma-translation", o.sigma_translation, "Of relative poses, m a coordinate");
  option("--sigma-rotation", o.sigma_rotation, "Of relative poses, rad an axis");
  option("--sigma-feature", o.sigma_feature, "Of observed features, m a coordinate");
  option("--noise", o.noise,
         "Factor on the noise that is drawn, not on the sigmas that the "
         "information states; 0 measures exactly");
  command.add_option("--edges-per-pose", a.edges_per_pose,
                     "Relative poses a pose, odometry included, 1 to 4 [1.5; sphere 2; landmark "
                     "worlds 1]");
  option("--world-size", o.world_size,
         "Side of the streets' square or corridors' cube, radius of "
         "the sphere, m; 0: every street is driven about twice, poses "
         "on the sphere are 1 m apart; side of the field of beacons, 3 m a beacon");
  option("--sensor-range", o.sensor_range, "Within which features are seen, m [beacons 6]");
  option("--speed", a.speed, "Of the vehicle among the beacons, m/s; a pose is 0.3 s");
  option("--beacons-a-side", a.beacons_a_side, "Of the field of beacons: rows, and columns");
  option("--visible-features", o.visible_features, "In range of a pose on average");
  option("--max-observations", o.max_observations, "Of features from one pose");
}

}  // namespace

void add_simulate(Command& app) {
  auto arguments = std::make_shared<SimulateCommand>();
  Command command = app.add_command("simulate", "Make a world whose truth is known");
  command
      .add_option("world", arguments->world,
                  "manhattan, sphere, grid3d, landmarks2d, landmarks3d, beacons")
      .type_name("WORLD")
      .required();
  command.add_option("-o,--output", arguments->output, "The measurements")
      .type_name("FILE.g2o|FOLDER")
      .required();
  command.add_option("--truth", arguments->truth, "Where everything really is")
      .type_name("TRUTH.g2o");
  add_world_options(command, *arguments);
  command.examples(kSimulateExamples);
  command.run([arguments, command] {
    arguments->sensor_range_given = command.has("--sensor-range");
    run_simulate(*arguments);
  });
}

}  // namespace mapjoin::cli
