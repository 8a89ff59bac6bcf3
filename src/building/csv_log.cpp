#include "mapjoin/building/csv_log.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <system_error>

#include "mapjoin/io/read_file.h"
#include "mapjoin/io/text_scanner.h"

namespace mapjoin {

namespace {

void check(const CsvLogOptions& o) {
  for (const double x : {o.duration, o.sigma_speed, o.sigma_sideways, o.sigma_turn_rate,
                         o.sigma_range, o.sigma_bearing}) {
    if (!std::isfinite(x) || x <= 0.0)
      throw InputError("the duration and the sigmas of a log must be above 0");
  }
  if (!std::isfinite(o.nearest) || o.nearest < 0.0)
    throw InputError("the range below which observations are left out must be 0 or more");
}

double information(double sigma) { return 1.0 / (sigma * sigma); }

/// Calls line(scanner) for each line below the header, which must be the one given.
template <class Line>
void read_lines(const std::filesystem::path& path, std::string_view header, const Line& line) {
  std::string text = read_file(path);
  const std::string_view first = std::string_view(text).substr(0, text.find_first_of("\r\n"));
  if (first != header) {
    throw InputError(fmt::format("{}:1: '{}' is not the header of this file; it should be '{}'",
                                 path.string(), first, header));
  }
  std::replace(text.begin(), text.end(), ',', ' ');
  TextScanner scan(path.string(), text);
  scan.expect(header);
  scan.next_line();
  while (scan.next_line()) line(scan);
}

}  // namespace

CsvLog read_csv_log(const std::filesystem::path& folder, const CsvLogOptions& o) {
  check(o);
  RawLogBuilder<2> builder;
  const Mat<3, 3> odometry = Vec<3>(information(o.sigma_speed), information(o.sigma_sideways),
                                    information(o.sigma_turn_rate))
                                 .asDiagonal();
  std::int64_t poses = 1;
  read_lines(folder / "controls.csv", "speed_mps,turnrate_radps", [&](TextScanner& scan) {
    const double speed = scan.number("speed");
    const double rate = scan.number("turn rate");
    scan.expect_end_of_line("turn rate");
    const auto k = static_cast<std::uint64_t>(poses++);
    builder.add<VelocityTurnRate>(pose_key(k - 1, o.session), pose_key(k, o.session),
                                  {speed, rate, o.duration}, odometry);
  });
  std::int64_t too_near = 0;
  const Mat<2, 2> sight =
      Vec<2>(information(o.sigma_range), information(o.sigma_bearing)).asDiagonal();
  read_lines(
      folder / "observations.csv", "step,beacon,range_m,bearing_rad", [&](TextScanner& scan) {
        const std::int64_t step = scan.integer("step");
        const std::int64_t beacon = scan.integer("beacon");
        const double range = scan.number("range");
        const double bearing = scan.number("bearing");
        scan.expect_end_of_line("bearing");
        if (step < 1 || step > poses)
          scan.fail(fmt::format("step {} is at no pose", step),
                    fmt::format("the controls make poses for steps 1 to {}", poses));
        if (beacon < 0) scan.fail("the number of a beacon is negative", "number beacons from 0");
        if (o.nearest > 0.0 && range < o.nearest) {
          ++too_near;
          return;
        }
        if (!(range > 0.0)) {
          scan.fail(
              "the range is not above 0",
              "near a beacon noise can do that, and nothing is known there: leave out what is "
              "nearer than some sigmas (--nearest)");
        }
        builder.add<RangeBearing>(pose_key(static_cast<std::uint64_t>(step - 1), o.session),
                                  point_key(static_cast<std::uint64_t>(beacon), o.session),
                                  {range, bearing}, sight);
      });
  return {std::move(builder).build(), too_near};
}

bool is_csv_log(const std::filesystem::path& folder) {
  std::error_code ignored;
  return std::filesystem::is_regular_file(folder / "controls.csv", ignored) &&
         std::filesystem::is_regular_file(folder / "observations.csv", ignored);
}

}  // namespace mapjoin
