// Local maps that arrive one at a time: SLSJF as a stream, with the map and its uncertainty at hand
// after each; then D-SLAM and a Kalman filter on the same local maps, and the optimum.

#include <fmt/format.h>

#include <cmath>

#include "mapjoin/evaluation/evaluate.h"
#include "mapjoin/evaluation/random.h"
#include "mapjoin/filtering/map_stream.h"
#include "mapjoin/filtering/methods.h"
#include "mapjoin/frames/anchors.h"

using namespace mapjoin;

/// A local map as EKF SLAM leaves it: in the frame of the pose where it begins, the end pose and
/// the features within 4 m, with 1 cm of noise.
LocalMap<2> local_map(std::uint64_t k, const Rigid2& start, const Rigid2& end, Random& random) {
  LocalMap<2> map;
  map.anchor = pose_anchor<2>(pose_key(k));
  map.add_term<Pose2>(pose_key(k + 1),
                      Pose2::retract<double>(start.inverse() * end,
                                             Vec<3>(0.01 * random.normal(), 0.01 * random.normal(),
                                                    0.005 * random.normal())));
  for (std::uint64_t f = 0; f < 144; ++f) {  // features on a grid, 2 m apart
    const Vec<2> feature(2.0 * static_cast<double>(f % 12) - 11.0,
                         2.0 * static_cast<double>(f / 12) - 11.0);
    const Vec<2> seen = start.inverse() * feature;
    if (seen.norm() < 4.0)
      map.add_term<Point2>(
          point_key(f), Vec<2>(seen(0) + 0.01 * random.normal(), seen(1) + 0.01 * random.normal()));
  }
  std::vector<int> offsets{0};
  for (const auto* kind : map.kinds) offsets.push_back(offsets.back() + kind->dim);
  Eigen::VectorXd information = Eigen::VectorXd::Constant(offsets.back(), 1e4);
  information(2) = 4e4;  // the end pose's heading
  map.information = SymmetricBlockMatrix::from_dense(offsets, information.asDiagonal());
  return map;
}

int main() {
  Random random(1);
  std::vector<LocalMap<2>> maps;
  const auto pose = [](std::uint64_t k) {  // twice round a circle of 7 m
    const double a = 0.2 * static_cast<double>(k);
    return rigid2(7.0 * std::cos(a), 7.0 * std::sin(a), a + 1.5708);
  };
  for (std::uint64_t k = 0; k < 63; ++k) maps.push_back(local_map(k, pose(k), pose(k + 1), random));

  MapStream<2> stream({.method = StreamMethod::kSlsjf, .filter = {}, .join = {}, .associate = {}});
  for (const LocalMap<2>& map : maps) {
    const Fusion fusion = stream.add(map);
    if (stream.size() % 9 != 0) continue;
    const Key last = pose_key(static_cast<std::uint64_t>(stream.size()));
    const Eigen::MatrixXd P = stream.covariance(std::span(&last, 1));
    fmt::print("{:>2} local maps: {:>3} scalars, {} within {:.1f} mm{}\n", stream.size(),
               fusion.scalars, to_string(last), 1e3 * std::sqrt(P.topLeftCorner(2, 2).trace()),
               fusion.reordered ? ", reordered" : "");
  }

  const auto best = join_by(Method::kIslsjf, std::span<const LocalMap<2>>(maps)).map.values;
  for (const Method method : kMethods) {
    const FilterResult<2> result = join_by(method, std::span<const LocalMap<2>>(maps));
    fmt::print("{:<7} features within {:.3f} mm of the optimum\n", name(method),
               1e3 * deviation(result.map.values, best).aligned_feature_rmse);
  }
}
