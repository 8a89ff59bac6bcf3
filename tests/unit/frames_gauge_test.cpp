#include "mapjoin/frames/gauge.h"

#include <gtest/gtest.h>

#include <vector>

#include "mapjoin/frames/change_frame.h"
#include "mapjoin/frames/local_map.h"
#include "mapjoin/graph/symmetric.h"
#include "tests/support/dense.h"
#include "tests/support/random_maps.h"
#include "tests/support/textbook_frames.h"

namespace mapjoin {
namespace {

using namespace test;  // NOLINT

template <class T>
class CompleteGauge : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(CompleteGauge, Dimensions);

template <int D>
struct Sample {
  Values<D> values;
  Anchor<D> anchor;
  std::vector<int> pinned;
  SymmetricBlockMatrix anchored;
};

template <int D>
Sample<D> sample_at(Dice& dice, const Anchor<D>& anchor, int poses = 6, int points = 6) {
  Sample<D> out;
  out.values = random_values<D>(dice, ids(poses), ids(points));
  out.values.transform(motion_into(anchor, out.values));
  out.anchor = anchor;
  out.pinned = frame_of(anchor, out.values).pinned;
  std::vector<double*> pointers;
  for (const int i : anchor_variables(anchor, out.values.variables()))
    pointers.push_back(out.values.value(i));
  anchor.kind->pin(pointers.data());
  out.anchored = random_anchored_information(dice, out.values, out.pinned);
  return out;
}
template <int D>
Sample<D> sample(Dice& dice) {
  return sample_at(dice, pose_anchor<D>(pose_key(static_cast<std::uint64_t>(dice.below(6)))));
}

/// The checks that hold for any anchor.
template <int D>
void check(const Sample<D>& s) {
  const auto completed = complete_gauge(s.values, s.anchor, s.anchored);
  const Eigen::MatrixXd Lambda = completed.dense();
  const Eigen::MatrixXd g = s.values.gauge();
  const double scale = Lambda.cwiseAbs().maxCoeff() * g.cwiseAbs().maxCoeff();
  EXPECT_LT((Lambda * g).cwiseAbs().maxCoeff(), 1e-12 * scale) << "moving the map costs something";
  // The formula, densely: J = E - g C^-1 P.
  const auto n = Lambda.rows();
  Eigen::MatrixXd P = Eigen::MatrixXd::Zero(kGauge<D>, n);
  for (int k = 0; k < kGauge<D>; ++k) P(k, s.pinned[static_cast<std::size_t>(k)]) = 1.0;
  const Eigen::MatrixXd J = Eigen::MatrixXd::Identity(n, n) - g * test::dense_inverse(P * g) * P;
  const Eigen::MatrixXd expected = J.transpose() * s.anchored.dense() * J;
  EXPECT_LT(relative_distance(Lambda, expected), 1e-12);
  EXPECT_EQ(without(Lambda, s.pinned, s.pinned), without(s.anchored.dense(), s.pinned, s.pinned))
      << "dropping what is pinned must give the information back, to the last bit";
  Map<D> map;
  map.values = s.values;
  map.anchor = s.anchor;
  map.information = completed;
  const AnchoredInformation back = anchored_information(map);
  EXPECT_EQ(back.dense(), without(s.anchored.dense(), s.pinned, s.pinned));
  EXPECT_EQ(back.scalars.size() + static_cast<std::size_t>(kGauge<D>), static_cast<std::size_t>(n));
}

TYPED_TEST(CompleteGauge, MovesNothingAndGivesTheInformationBack) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 25; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    check(sample<D>(dice));
  }
}

TEST(CompleteGaugeOf, AnyAnchorNotOnlyPoses) {
  for (std::uint64_t seed = 1; seed <= 25; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    check(sample_at<2>(dice, two_points(seed % 2 == 0 ? 4 : 1, seed % 3 == 0 ? 0 : 3)));
    check(sample_at<2>(dice, two_points(1, 3), 0, 5));  // a map of features alone
    check(sample_at<3>(dice, three_points(seed % 2 == 0 ? 4 : 1, 3, seed % 3 == 0 ? 0 : 2)));
    check(sample_at<3>(dice, three_points(4, 0, 2), 0, 5));
  }
}

TYPED_TEST(CompleteGauge, AddsOnlyTheAnchorsRow) {
  constexpr int D = TypeParam::value;
  Dice dice(3);
  const Sample<D> s = sample<D>(dice);
  const auto completed = complete_gauge(s.values, s.anchor, s.anchored);
  const int anchor = s.values.variables().require(s.anchor.keys[0], "test");
  for (int j = 0; j < completed.size(); ++j) {
    for (auto b = completed.begin(j); b < completed.end(j); ++b) {
      const int i = completed.row(b);
      if (i == anchor || j == anchor) continue;
      EXPECT_GE(s.anchored.find(i, j), 0) << i << " " << j;
    }
  }
}

TYPED_TEST(CompleteGauge, LeavesVariablesWithoutInformationAlone) {
  constexpr int D = TypeParam::value;
  Dice dice(4);
  Sample<D> s = sample<D>(dice);
  s.anchored = SymmetricBlockMatrix(s.values.variables().offsets(), {});
  const auto completed = complete_gauge(s.values, s.anchor, s.anchored);
  EXPECT_TRUE(completed.dense().isZero(0.0));
  EXPECT_EQ(completed.blocks(), s.anchored.blocks());
}

TYPED_TEST(CompleteGauge, IsPositiveSemidefiniteOfFullRankLessGauge) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Dice dice(seed);
    const Sample<D> s = sample<D>(dice);
    const Eigen::VectorXd found =
        eigenvalues(complete_gauge(s.values, s.anchor, s.anchored).dense());
    const double top = found.maxCoeff();
    EXPECT_GT(found.minCoeff(), -1e-12 * top);
    EXPECT_LT(found(kGauge<D> - 1), 1e-12 * top);
    EXPECT_GT(found(kGauge<D>), 1e-9 * top);
  }
}

TYPED_TEST(CompleteGauge, OfAnotherFramesInformationIsTheSameMap) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Dice dice(seed);
    const Map<D> map = random_map<D>(dice, ids(5), ids(5), 2);
    const Map<D> there = change_frame(map, pose_anchor<D>(pose_key(4)));
    const auto pinned = frame_of(there.anchor, there.values).pinned;
    Eigen::MatrixXd I = there.information.dense();
    for (const int s : pinned) {
      I.row(s).setZero();
      I.col(s).setZero();
    }
    const auto completed =
        complete_gauge(there.values, there.anchor,
                       SymmetricBlockMatrix::from_dense(there.variables().offsets(), I));
    EXPECT_LT(relative_distance(completed.dense(), there.information.dense()), 1e-11);
  }
}

TYPED_TEST(CompleteGauge, AsLocalMapIsTheAnchoredMap) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Dice dice(seed);
    const Map<D> map = random_map<D>(dice, ids(5), ids(5), 2);
    const LocalMap<D> local = as_local_map(map);
    EXPECT_EQ(local.anchor, map.anchor);
    EXPECT_EQ(static_cast<int>(local.keys.size()), map.variables().size() - 1);
    EXPECT_EQ(local.information.dense(), anchored_information(map).dense());
    // Written elsewhere, it is still the observation that was solved.
    const LocalMap<D> again = as_local_map(change_frame(map, pose_anchor<D>(pose_key(4))));
    EXPECT_EQ(again.anchor, map.anchor);
    EXPECT_LT(relative_distance(again.information.dense(), local.information.dense()), 1e-11);
  }
}

}  // namespace
}  // namespace mapjoin
