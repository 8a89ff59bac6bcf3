// A pipeline of one's own from the library's parts, in memory, with measurements in Eigen's types.

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "mapjoin/evaluation/evaluate.h"
#include "mapjoin/evaluation/random.h"
#include "mapjoin/joining/join.h"
#include "mapjoin/joining/join_all.h"
#include "mapjoin/joining/refine.h"

using namespace mapjoin;

int main() {
  // 1. Your front end: here two rounds on a circle of 20 m, features seen within 5 m.
  Random random(6);
  const auto noise = [&] { return Eigen::Vector2d(0.1 * random.normal(), 0.1 * random.normal()); };
  const Mat<3, 3> info = Vec<3>(100.0, 100.0, 1000.0).asDiagonal();
  ValuesBuilder<2> truth;
  std::vector<MeasurementGraphBuilder<2>> stretches(10);
  Eigen::Isometry2d last = Eigen::Isometry2d::Identity();
  for (int k = 0; k < 200; ++k) {
    auto& stretch = stretches[std::max(0, k - 1) / 20];
    Eigen::Isometry2d pose(Eigen::Rotation2Dd(k * EIGEN_PI / 50.0));
    pose.translate(Eigen::Vector2d(10.0, 0.0));
    truth.add<Pose2>(pose_key(k), {pose.linear(), pose.translation()});
    Eigen::Isometry2d step = last.inverse() * pose;
    step.pretranslate(noise()).rotate(0.03 * random.normal());
    const Rigid2 z{step.linear(), step.translation()};
    if (k > 0) stretch.add<Pose2>(pose_key(k - 1), pose_key(k), z, info);
    for (int f = 0; f < 49; ++f) {
      const Eigen::Vector2d feature(5.0 * (f / 7) - 15.0, 5.0 * (f % 7) - 15.0);
      const Eigen::Vector2d seen = pose.inverse() * feature + noise();
      if (seen.norm() > 5.0) continue;
      stretch.add<Point2>(pose_key(k), point_key(f), seen, info.topLeftCorner<2, 2>());
    }
    last = pose;
  }

  // 2. A local map of every stretch. Their measurements together are the graph to refine on.
  std::vector<Map<2>> maps;
  MeasurementGraphBuilder<2> all;
  for (auto& stretch : stretches) {
    maps.push_back(join_all(std::move(stretch).build()).maps[0]);
    all.add(*maps.back().observations);
  }
  const MeasurementGraph<2> graph = std::move(all).build();

  // 3. Joins by summaries, in an order of your own: here from the end of the drive backwards.
  for (; maps.size() > 1; maps.pop_back()) {
    maps[maps.size() - 2] = join(maps[maps.size() - 2], maps.back());
  }

  // 4. Refinement over all measurements: linear solves until nothing moves.
  Piece<2> piece = to_piece(graph.variables, maps[0].values);
  piece.observations.resize(graph.size());
  std::iota(piece.observations.begin(), piece.observations.end(), 0);
  Places places(graph.variables.size());
  ObservationSystem<2> system(graph, piece, {}, places);
  FrontalCholesky cholesky;
  WorkerPool pool;
  const double refined = refine(graph, piece, system, cholesky, pool, 20, 1e-9, {}).chi2;

  // 5. Evaluation, beside the library's own pipeline.
  const Values<2> drive = std::move(truth).build();
  const auto print = [&](const char* name, const Values<2>& x) {
    fmt::print("{:8} chi2 {:10.4f}, RMSE of the poses {:.4f} m\n", name, chi2(x, graph),
               deviation(x, drive).pose_rmse);
  };
  print("joined", maps[0].values);
  print("refined", to_values(graph.variables, piece));
  const JoinResult<2> expected = join_all(graph);
  print("join_all", expected.maps[0].values);
  return std::abs(refined - expected.report.chi2) < 1e-6 * refined ? 0 : 1;
}
