#pragma once

#include <cstdint>
#include <filesystem>

#include "mapjoin/building/csv_log.h"
#include "mapjoin/graph/values.h"

namespace mapjoin {

/// A vehicle that drives at random over a square field of beacons in rows and columns, and measures
/// range and bearing of those in the half circle before it, but for those
/// nearer than five sigmas of the range (where ranges come out negative). The defaults are the
/// simulation of the Sparse Local Submap Joining Filter (its section IV-A): 150 m x 150 m, 2500
/// beacons, 6 m, 27924 poses.
struct LogSimulationOptions {
  std::int64_t poses = 27924;
  int beacons_a_side = 50;
  double spacing = 3.0;       ///< of beacons, m
  double sensor_range = 6.0;  ///< m, 180 degrees
  double speed = 1.0;         ///< m/s
  double most_turn = 0.5;     ///< rad/s
  double noise = 1.0;         ///< factor on what is drawn, not on what the log states
  std::uint64_t seed = 1;
  CsvLogOptions sensors = {};  ///< what noise there is, and what the log says of it
};

/// A recording, and where everything really is: poses and all beacons, in the frame of pose 0.
struct SimulatedLog {
  RawLog<2> log;
  Values<2> truth;
};

/// Noise is normal and what the sensors' sigmas say; the vehicle slips sideways by
/// `sigma_sideways`. The same options give the same numbers everywhere. O(poses).
/// \throws InputError when an option makes no sense.
SimulatedLog simulate_log(const LogSimulationOptions& options = {});

/// Writes controls.csv, observations.csv, beacons_true.csv and poses_true.csv into a folder that
/// exists; numbers with as many digits as reading them back exactly takes. What read_csv_log()
/// reads with the same options. \throws InputError when the log holds anything else than
/// VelocityTurnRate and RangeBearing from pose to pose; FileError.
void write_csv_log(const std::filesystem::path& folder, const SimulatedLog& simulated);

}  // namespace mapjoin
