#pragma once

#include <cstdint>
#include <filesystem>
#include <numbers>

#include "mapjoin/building/raw_log.h"

namespace mapjoin {

/// What the files do not say: durations and noise (standard deviations).
struct CsvLogOptions {
  double duration = 0.3;                                    ///< of a control, s
  double sigma_speed = 0.02;                                ///< m/s
  double sigma_sideways = 0.01;                             ///< m/s: a vehicle that hardly slips
  double sigma_turn_rate = 2.0 * std::numbers::pi / 180.0;  ///< rad/s
  double sigma_range = 0.1;                                 ///< m
  double sigma_bearing = 1.0 * std::numbers::pi / 180.0;    ///< rad
  /// Observations of a smaller range are left out and counted, m. Near a beacon, within some sigmas
  /// of the range, a measured range may come out negative and a bearing is anything: there no
  /// linearisation holds. 0: none is left out, and one that is not above 0 is an error.
  double nearest = 0.0;
  std::uint32_t session = 0;
};

/// A log as read.
struct CsvLog {
  RawLog<2> log;
  std::int64_t too_near = 0;  ///< observations left out, see CsvLogOptions::nearest
};

/// Reads the log of a vehicle in the plane from a folder of two files:
///
///     controls.csv       speed_mps,turnrate_radps            a line a control
///     observations.csv   step,beacon,range_m,bearing_rad     a line an observation
///
/// Line k (from 1) of the controls takes the vehicle from pose k - 1 to pose k: it turns, then
/// drives along its new heading for `duration` (VelocityTurnRate). Observations of step s are made
/// at pose s - 1, of point:beacon (RangeBearing); bearings need not be wrapped.
/// \throws FileError; InputError with file and line: other headers, numbers missing, in excess or
/// not finite, steps of no pose, ranges that are not positive; options that make no sense.
CsvLog read_csv_log(const std::filesystem::path& folder, const CsvLogOptions& options = {});

/// Is there such a log in a folder?
bool is_csv_log(const std::filesystem::path& folder);

}  // namespace mapjoin
