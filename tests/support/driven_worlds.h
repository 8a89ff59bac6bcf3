// A vehicle that drives among beacons and measures them in various ways, with the truth.
#pragma once

#include <cmath>
#include <utility>

#include "mapjoin/building/models.h"
#include "mapjoin/building/raw_log.h"
#include "mapjoin/evaluation/random.h"
#include "mapjoin/graph/values.h"

namespace mapjoin::test {

enum class Sensor { kPoint, kRangeBearing, kRange, kBearing };

struct Drive {
  Sensor sensor = Sensor::kRangeBearing;
  int poses = 120;
  int beacons = 40;
  double range = 8.0;     ///< within which beacons are seen, metres
  double noise = 1.0;     ///< factor on what is drawn, not on what is stated
  double outliers = 0.0;  ///< the part of observations that are of somewhere else
  std::uint64_t seed = 1;
};

struct DrivenWorld {
  RawLog<2> log;
  Values<2> truth;  ///< in the frame of pose 0
};

inline DrivenWorld drive(const Drive& d) {
  constexpr double kSeconds = 0.5;
  const Vec<3> odometry_sigma(0.05, 0.02, 0.02);  // m/s, m/s sideways, rad/s
  constexpr double kRangeSigma = 0.05;
  constexpr double kBearingSigma = 0.01;
  Random path(d.seed, 1), places(d.seed, 2), noise(d.seed, 3), wrong(d.seed, 4);
  const auto information = [](double sigma) { return 1.0 / (sigma * sigma); };

  RawLogBuilder<2> log;
  ValuesBuilder<2> truth;
  std::vector<Rigid2> poses{Rigid2::identity()};
  const Mat<3, 3> odometry =
      Vec<3>(odometry_sigma.unaryExpr([&](double s) { return information(s); })).asDiagonal();
  for (int i = 1; i < d.poses; ++i) {
    const double speed = 1.0 + 0.2 * path.uniform();
    const double rate = 0.25 + 0.35 * std::sin(0.11 * i);
    const double sideways = d.noise * odometry_sigma(1) * noise.normal();
    Rigid2 step = VelocityTurnRate::seen({speed, rate, kSeconds});
    step.t += step.R * Vec<2>(0.0, sideways * kSeconds);
    poses.push_back(poses.back() * step);
    log.add<VelocityTurnRate>(pose_key(static_cast<std::uint64_t>(i - 1)),
                              pose_key(static_cast<std::uint64_t>(i)),
                              {speed + d.noise * odometry_sigma(0) * noise.normal(),
                               rate + d.noise * odometry_sigma(2) * noise.normal(), kSeconds},
                              odometry);
  }
  Vec<2> low = poses[0].t;
  Vec<2> high = poses[0].t;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    low = low.cwiseMin(poses[i].t);
    high = high.cwiseMax(poses[i].t);
    truth.add<Pose2>(pose_key(i), poses[i]);
  }
  const Vec<2> margin = Vec<2>::Constant(2.0);
  std::vector<Vec<2>> beacons;
  for (int b = 0; b < d.beacons; ++b) {
    // One by one: compilers differ in the order in which they evaluate arguments.
    const double across = places.uniform();
    const double along = places.uniform();
    const Vec<2> u(along, across);
    beacons.push_back(low - margin + (high - low + 2.0 * margin).cwiseProduct(u));
    truth.add<Point2>(point_key(static_cast<std::uint64_t>(b)), beacons.back());
  }
  for (std::size_t i = 0; i < poses.size(); ++i) {
    for (std::size_t b = 0; b < beacons.size(); ++b) {
      Vec<2> p = poses[i].inverse() * beacons[b];
      if (p.norm() > d.range || p.norm() < 0.5) continue;
      const double aside = wrong.uniform() - 0.5;
      const double ahead = wrong.uniform() - 0.5;
      const Vec<2> elsewhere = p + 6.0 * Vec<2>(ahead, aside);
      if (wrong.uniform() < d.outliers && elsewhere.norm() > 1.0) p = elsewhere;
      const double n0 = d.noise * noise.normal();
      const double n1 = d.noise * noise.normal();
      const double range = p.norm() + kRangeSigma * n0;
      const double bearing = std::atan2(p(1), p(0)) + kBearingSigma * n1;
      const Key from = pose_key(i);
      const Key to = point_key(b);
      switch (d.sensor) {
        case Sensor::kPoint:
          log.add<RelativeModel<Point2>>(from, to, Vec<2>(p + kRangeSigma * Vec<2>(n0, n1)),
                                         information(kRangeSigma) * Mat<2, 2>::Identity());
          break;
        case Sensor::kRangeBearing:
          log.add<RangeBearing>(
              from, to, {range, bearing},
              Vec<2>(information(kRangeSigma), information(kBearingSigma)).asDiagonal());
          break;
        case Sensor::kRange:
          log.add<RangeOnly>(from, to, Vec<1>(range), Mat<1, 1>(information(kRangeSigma)));
          break;
        case Sensor::kBearing:
          log.add<BearingOnly>(from, to, Vec<1>(bearing), Mat<1, 1>(information(kBearingSigma)));
          break;
      }
    }
  }
  return {std::move(log).build(), std::move(truth).build()};
}

}  // namespace mapjoin::test
