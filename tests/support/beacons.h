// The truth of the simulated data sets.
#pragma once

#include <cstdio>
#include <fstream>
#include <optional>
#include <string>
#include <utility>

#include "mapjoin/graph/builtin_types.h"
#include "mapjoin/graph/values.h"
#include "tests/support/data.h"

namespace mapjoin::test {

/// The beacons, and the pose at the origin where the robot starts.
inline std::optional<Values<2>> true_beacons(const std::string& world) {
  const auto file = data_file("simulation/" + world + "/beacons_true.csv");
  if (!file) return std::nullopt;
  std::ifstream in(*file);
  std::string line;
  std::getline(in, line);
  ValuesBuilder<2> builder;
  builder.add<Pose2>(pose_key(0), Rigid2::identity());
  while (std::getline(in, line)) {
    unsigned long id = 0;
    double x = 0.0, y = 0.0;
    if (std::sscanf(line.c_str(), "%lu,%lf,%lf", &id, &x, &y) == 3)
      builder.add<Point2>(point_key(id), Vec<2>(x, y));
  }
  return std::move(builder).build();
}

}  // namespace mapjoin::test
