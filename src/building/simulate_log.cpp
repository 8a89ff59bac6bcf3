#include "mapjoin/building/simulate_log.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "mapjoin/building/time_order.h"
#include "mapjoin/evaluation/random.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/io/atomic_file.h"

namespace mapjoin {

namespace {

void check(const LogSimulationOptions& o) {
  const auto demand = [](bool ok, std::string_view what) {
    if (!ok) throw InputError(fmt::format("simulate: {}", what));
  };
  demand(o.poses >= 2 && o.poses <= 100'000'000, "poses must be from 2 to 100000000");
  demand(o.beacons_a_side >= 1 && o.beacons_a_side <= 10000, "beacons a side: from 1 to 10000");
  for (const double x : {o.spacing, o.sensor_range, o.speed, o.most_turn})
    demand(std::isfinite(x) && x > 0.0, "spacing, range, speed and turn rate must be above 0");
  demand(std::isfinite(o.noise) && o.noise >= 0.0, "noise must be 0 or more");
}

/// Steers towards one random place after another.
class Driver {
 public:
  explicit Driver(const LogSimulationOptions& o)
      : o_(o), random_(o.seed, 1), side_(o.spacing * o.beacons_a_side) {
    choose();
  }
  double turn_rate(const Rigid2& pose) {
    if ((goal_ - pose.t).norm() < 4.0 * o_.speed) choose();
    const Vec<2> ahead = pose.inverse() * goal_;
    const double wanted = std::atan2(ahead(1), ahead(0)) / o_.sensors.duration;
    return std::clamp(wanted, -o_.most_turn, o_.most_turn);
  }

 private:
  void choose() { goal_ = side_ * Vec<2>(random_.uniform(), random_.uniform()); }

  const LogSimulationOptions& o_;
  Random random_;
  double side_;
  Vec<2> goal_;
};

/// Beacon (column, row) stands half a spacing from the corner and a spacing from the next.
class Field {
 public:
  explicit Field(const LogSimulationOptions& o) : o_(o) {}

  Vec<2> beacon(int column, int row) const { return o_.spacing * Vec<2>(column + 0.5, row + 0.5); }
  std::uint64_t number(int column, int row) const {
    return static_cast<std::uint64_t>(row) * static_cast<std::uint64_t>(o_.beacons_a_side) +
           static_cast<std::uint64_t>(column) + 1;
  }
  /// Calls see(number, place in the frame of the pose) for the beacons in view.
  template <class See>
  void look(const Rigid2& pose, const See& see) const {
    const auto cell = [&](double x) { return static_cast<int>(std::floor(x / o_.spacing)); };
    const int reach = cell(o_.sensor_range) + 1;
    for (int row = cell(pose.t(1)) - reach; row <= cell(pose.t(1)) + reach; ++row) {
      for (int column = cell(pose.t(0)) - reach; column <= cell(pose.t(0)) + reach; ++column) {
        if (row < 0 || column < 0 || row >= o_.beacons_a_side || column >= o_.beacons_a_side)
          continue;
        const Vec<2> seen = pose.inverse() * beacon(column, row);
        const double range = seen.norm();
        if (seen(0) < 0.0 || range > o_.sensor_range || range < 5.0 * o_.sensors.sigma_range)
          continue;
        see(number(column, row), seen);
      }
    }
  }

 private:
  const LogSimulationOptions& o_;
};

double information(double sigma) { return 1.0 / (sigma * sigma); }

}  // namespace

SimulatedLog simulate_log(const LogSimulationOptions& o) {
  check(o);
  const CsvLogOptions& s = o.sensors;
  const Mat<3, 3> odometry = Vec<3>(information(s.sigma_speed), information(s.sigma_sideways),
                                    information(s.sigma_turn_rate))
                                 .asDiagonal();
  const Mat<2, 2> sight =
      Vec<2>(information(s.sigma_range), information(s.sigma_bearing)).asDiagonal();
  Random slip(o.seed, 2), odometer(o.seed, 3), sensor(o.seed, 4);
  const auto noise = [&](Random& random, double sigma) {
    return o.noise * sigma * random.normal();
  };

  const Field field(o);
  Driver driver(o);
  Rigid2 world_from_start;  // the corner of the field, half a spacing from its first beacons
  world_from_start.R = rotation_exp<2, double>(Vec<1>(0.25 * std::numbers::pi));
  const Rigid2 start_from_world = world_from_start.inverse();
  Rigid2 pose = world_from_start;
  RawLogBuilder<2> log;
  ValuesBuilder<2> truth;
  for (std::int64_t i = 0; i < o.poses; ++i) {
    const auto id = static_cast<std::uint64_t>(i);
    const Key here = pose_key(id, s.session);
    truth.add<Pose2>(here, start_from_world * pose);
    field.look(pose, [&](std::uint64_t beacon, const Vec<2>& seen) {
      const double range = seen.norm() + noise(sensor, s.sigma_range);
      const double bearing = std::atan2(seen(1), seen(0)) + noise(sensor, s.sigma_bearing);
      if (range > 0.0)
        log.add<RangeBearing>(here, point_key(beacon, s.session), {range, bearing}, sight);
    });
    if (i + 1 == o.poses) break;
    const double rate = driver.turn_rate(pose);
    Rigid2 step = VelocityTurnRate::seen({o.speed, rate, s.duration});
    step.t += step.R * Vec<2>(0.0, noise(slip, s.sigma_sideways) * s.duration);
    pose = pose * step;
    log.add<VelocityTurnRate>(here, pose_key(id + 1, s.session),
                              {o.speed + noise(odometer, s.sigma_speed),
                               rate + noise(odometer, s.sigma_turn_rate), s.duration},
                              odometry);
  }
  for (int row = 0; row < o.beacons_a_side; ++row) {
    for (int column = 0; column < o.beacons_a_side; ++column)
      truth.add<Point2>(point_key(field.number(column, row), s.session),
                        start_from_world * field.beacon(column, row));
  }
  return {std::move(log).build(), std::move(truth).build()};
}

void write_csv_log(const std::filesystem::path& folder, const SimulatedLog& simulated) {
  const RawLog<2>& log = simulated.log;
  const TimeOrder order(log);
  std::string controls = "speed_mps,turnrate_radps\n";
  std::string observations = "step,beacon,range_m,bearing_rad\n";
  for (int t = 0; t < order.poses(); ++t) {
    for (const std::int64_t m : order.at(t)) {
      const auto [c, row] = log.find(m);
      const RawMeasurements<2>& column = log.columns[c];
      const double* const z = &column.z[row * static_cast<std::size_t>(column.model->measured)];
      if (column.model->tag == Tag(VelocityTurnRate::name) &&
          order.time(column.to[row]) == order.time(column.from[row]) + 1) {
        controls += fmt::format("{},{}\n", z[0], z[1]);
      } else if (column.model->tag == Tag(RangeBearing::name)) {
        observations +=
            fmt::format("{},{},{},{}\n", t + 1, log.variables.key(column.to[row]).id, z[0], z[1]);
      } else {
        throw InputError(
            "a CSV log holds speeds and turn rates from pose to pose, ranges and bearings, and "
            "nothing else");
      }
    }
  }
  std::string poses = "x_m,y_m,theta_rad\n";
  for (const Rigid2& x : simulated.truth.column<Pose2>())
    poses += fmt::format("{},{},{}\n", x.t(0), x.t(1), heading(x));
  std::string beacons = "beacon,x_m,y_m\n";
  for (int i = 0; i < simulated.truth.size(); ++i) {
    const Key& key = simulated.truth.variables().key(i);
    if (key.type != Tag("point")) continue;
    const Vec<2>& p = simulated.truth.point(key);
    beacons += fmt::format("{},{},{}\n", key.id, p(0), p(1));
  }
  write_atomically(folder / "controls.csv", controls);
  write_atomically(folder / "observations.csv", observations);
  write_atomically(folder / "poses_true.csv", poses);
  write_atomically(folder / "beacons_true.csv", beacons);
}

}  // namespace mapjoin
