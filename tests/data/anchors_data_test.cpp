// Real maps through frames of all kinds: in other poses, in features of Linear SLAM's data sets,
// and back.

#include <gtest/gtest.h>

#include <algorithm>
#include <span>
#include <vector>

#include "mapjoin/frames/change_frame.h"
#include "mapjoin/frames/gauge.h"
#include "mapjoin/frames/local_map.h"
#include "mapjoin/frames/points_anchor.h"
#include "mapjoin/joining/join.h"
#include "tests/support/data_sets.h"

namespace mapjoin::test {
namespace {

template <int D>
Map<D> joined(const Problem<D>& problem) {
  JoinOptions options;
  options.mode = Mode::kSummary;
  JoinResult<D> result = problem.join(options);
  EXPECT_EQ(result.maps.size(), 1U);
  return std::move(result.maps.at(0));
}

double largest(const Eigen::SparseMatrix<double>& M) {
  double out = 0.0;
  for (Eigen::Index k = 0; k < M.outerSize(); ++k) {
    for (Eigen::SparseMatrix<double>::InnerIterator it(M, k); it; ++it)
      out = std::max(out, std::abs(it.value()));
  }
  return out;
}

template <int D>
void expect_same(const Map<D>& a, const Map<D>& b) {
  ASSERT_EQ(a.anchor, b.anchor);
  double size = 0.0;
  for (const Rigid<D>& pose : b.values.template column<PoseType<D>>())
    size = std::max(size, pose.t.norm());
  EXPECT_LT(b.values.local(a.values).cwiseAbs().maxCoeff(), 1e-8 * size);
  const AnchoredInformation I = anchored_information(a), J = anchored_information(b);
  EXPECT_EQ(I.scalars, J.scalars);
  EXPECT_LT(largest(I.lower - J.lower), 1e-8 * largest(J.lower));
  EXPECT_EQ(a.information.blocks(), b.information.blocks());
}

/// Every pair of frames: there and back, and via a third.
template <int D>
void check(const DataSet& set, const std::vector<Anchor<D>>& features) {
  const auto problem = load(set);
  if (!problem) GTEST_SKIP() << missing(set);
  const Map<D> map = joined(std::get<Problem<D>>(*problem));
  const auto& poses = map.variables().column(map.variables().find_column(Tag("pose"))).keys;
  std::vector<Anchor<D>> frames{pose_anchor<D>(poses.front()), pose_anchor<D>(poses.back())};
  frames.insert(frames.end(), features.begin(), features.end());
  frames.push_back(farthest_points(map.values).value());
  for (const Anchor<D>& a : frames) {
    const Map<D> in_a = change_frame(map, a);
    for (const Anchor<D>& b : frames) {
      SCOPED_TRACE(to_string(a) + " " + to_string(b));
      const Map<D> in_b = change_frame(in_a, b);
      expect_same(change_frame(in_b, a), in_a);
      expect_same(in_b, change_frame(map, b));
    }
  }
}

TEST(AnchorsOfRealMaps, VictoriaParkGoesThroughEveryPairOfFrames) {
  check<2>({"local_maps", "victoria_park_200", 0.0}, {points_anchor(point_key(84), point_key(85)),
                                                      points_anchor(point_key(85), point_key(1))});
}

TEST(AnchorsOfRealMaps, Simulation870GoesThroughEveryPairOfFrames) {
  check<3>({"local_maps", "simu3d_870", 0.0},
           {points_anchor(point_key(1758), point_key(1757), point_key(1359)),
            points_anchor(point_key(1359), point_key(1758), point_key(1757))});
}

/// All local maps in frames of their features, joined again. Those with too few features stay in
/// the frames of their poses.
TEST(AnchorsOfRealMaps, VictoriaParkJoinsFromFramesOfFeatures) {
  const DataSet set{"local_maps", "victoria_park_200", 0.0};
  const auto problem = load(set);
  if (!problem) GTEST_SKIP() << missing(set);
  const Problem<2>& given = std::get<Problem<2>>(*problem);
  std::vector<LocalMap<2>> in_features;
  std::size_t moved = 0;
  for (const LocalMap<2>& local : given.local_maps) {
    Map<2> map = to_map(local);
    if (const auto anchor = farthest_points(map.values)) {
      map = change_frame(std::move(map), *anchor);
      map.solved_in = map.anchor;
      ++moved;
    }
    in_features.push_back(as_local_map(map));
  }
  EXPECT_GT(moved, 150U);
  const JoinResult<2> before = given.join({});
  const JoinResult<2> after = join_all(std::span<const LocalMap<2>>(in_features));
  ASSERT_EQ(after.maps.size(), 1U);
  // Residuals are linear in other coordinates, so the optimum is not quite the same number.
  EXPECT_NEAR(after.report.chi2, before.report.chi2, 2e-3 * before.report.chi2);
  RecordProperty("chi2_in_pose_frames", std::to_string(before.report.chi2));
  RecordProperty("chi2_in_feature_frames", std::to_string(after.report.chi2));
}

}  // namespace
}  // namespace mapjoin::test
