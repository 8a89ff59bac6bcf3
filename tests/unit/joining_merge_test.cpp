#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "mapjoin/frames/change_frame.h"
#include "mapjoin/frames/local_map.h"
#include "mapjoin/graph/symmetric.h"
#include "mapjoin/joining/join.h"
#include "tests/support/ceres_reference.h"
#include "tests/support/random_maps.h"

namespace mapjoin {
namespace {

using namespace test;  // NOLINT
using ::testing::AllOf;
using ::testing::HasSubstr;

template <class T>
class JoinMaps : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(JoinMaps, Dimensions);

template <int D>
void expect_close_maps(const Map<D>& a, const Map<D>& b, double tolerance) {
  ASSERT_EQ(a.variables(), b.variables());
  EXPECT_LT(distance(a.values, b.values), tolerance);
  EXPECT_LT(relative_distance(a.information.dense(), b.information.dense()), tolerance);
}

/// Parts of one world, each in the frame of some pose of its own: with `noise` they contradict each
/// other.
template <int D>
std::vector<Map<D>> parts(Dice& dice, int count, double noise) {
  const Values<D> all = random_values<D>(dice, ids(3 * count + 3), ids(4 * count + 4));
  std::vector<Map<D>> out;
  for (int k = 0; k < count; ++k) {
    const auto first = static_cast<std::uint64_t>(k);
    const auto poses = ids(5, 3 * first);  // shares two poses and three points with the next
    const Values<D> x = noisy(dice, part_of(all, poses, ids(7, 4 * first)), noise);
    const auto at = poses[static_cast<std::size_t>(dice.below(5))];
    out.push_back(map_of(dice, x, pose_anchor<D>(pose_key(at)), 100.0));
  }
  return out;
}

TYPED_TEST(JoinMaps, SolvesTheEquationsItShows) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    const Merge<D> merged = merge<D>(parts<D>(dice, 2 + static_cast<int>(seed % 2), 0.1));
    const Eigen::MatrixXd A(merged.equations.A()), I(merged.equations.I_Z());
    const Eigen::VectorXd Z = merged.equations.Z();
    const Eigen::MatrixXd normal = A.transpose() * I * A;
    EXPECT_LT(relative_distance(merged.equations.normal_matrix().dense(), normal), 1e-12);
    EXPECT_LT(relative_distance(merged.equations.right_hand_side(), A.transpose() * I * Z), 1e-11);
    ASSERT_EQ(merged.dropped.size(), static_cast<std::size_t>(kGauge<D>));
    std::vector<int> kept;
    for (int k = 0; k < A.cols(); ++k) {
      if (std::find(merged.dropped.begin(), merged.dropped.end(), k) == merged.dropped.end())
        kept.push_back(k);
    }
    const Eigen::MatrixXd AK = A(Eigen::all, kept);
    const Eigen::VectorXd dk = (AK.transpose() * I * AK).fullPivLu().solve(AK.transpose() * I * Z);
    std::vector<double> d(static_cast<std::size_t>(A.cols()), 0.0);
    for (std::size_t k = 0; k < kept.size(); ++k)
      d[static_cast<std::size_t>(kept[k])] = dk(static_cast<Eigen::Index>(k));
    Values<D> x = merged.x0;
    x.retract(d);
    const Map<D> joined = solve(merged);
    EXPECT_LT(distance(joined.values, x), 1e-9);
    EXPECT_EQ(joined.anchor, merged.anchor);
  }
}

TYPED_TEST(JoinMaps, HasResidualsThatAreDifferencesAndAThatIsTheirSlope) {
  constexpr int D = TypeParam::value;
  Dice dice(3);
  const Merge<D> merged = merge<D>(parts<D>(dice, 2, 0.2));
  const Eigen::MatrixXd A(merged.equations.A());
  const Eigen::VectorXd Z = merged.equations.Z();
  const auto residual = [&](const std::vector<double>& d) {
    Values<D> x = merged.x0;
    x.retract(d);
    Eigen::VectorXd r(Z.size());
    Eigen::Index at = 0;
    for (const Summary<D>& map : merged.placed) {
      const Values<D> values = to_values(merged.variables, map.piece);
      const Eigen::VectorXd part = values.local(
          to_values(merged.variables, to_piece(merged.variables, subset(x, map.piece.variables))));
      r.segment(at, part.size()) = part;
      at += part.size();
    }
    return r;
  };
  std::vector<double> d(static_cast<std::size_t>(A.cols()), 0.0);
  EXPECT_LT(distance(residual(d), -Z), 1e-12);
  for (Eigen::Index k = 0; k < A.cols(); ++k) {
    const auto at = static_cast<std::size_t>(k);
    d[at] = 1e-6;
    const Eigen::VectorXd up = residual(d);
    d[at] = -1e-6;
    EXPECT_LT(distance((up - residual(d)) / 2e-6, A.col(k)), 1e-7);
    d[at] = 0.0;
  }
}

TYPED_TEST(JoinMaps, AddsUpWhatAgrees) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    std::vector<Map<D>> maps = parts<D>(dice, 3, 0.0);
    const auto anchor = pose_anchor<D>(pose_key(4));  // of the first two
    const Map<D> joined = change_frame(solve(merge<D>(maps)), anchor);
    // The sum of the maps' information, all in one frame, densely.
    const int n = joined.variables().scalars();
    Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(n, n);
    for (Map<D> map : maps) {
      const Key common = map.variables().key(map.variables().size() - 1);
      move(map, Rigid<D>(joined.values.pose(common) * map.values.pose(common).inverse()));
      const auto numbers = numbers_in(map.variables(), joined.variables());
      Eigen::MatrixXd S = Eigen::MatrixXd::Zero(map.variables().scalars(), n);
      for (int i = 0; i < map.variables().size(); ++i) {
        const int dim = map.variables().dim(i);
        S.block(map.variables().offset(i),
                joined.variables().offset(numbers[static_cast<std::size_t>(i)]), dim, dim)
            .setIdentity();
      }
      sum += S.transpose() * map.information.dense() * S;
    }
    EXPECT_LT(relative_distance(joined.information.dense(), sum), 1e-9);
  }
}

TYPED_TEST(JoinMaps, DoesNotDependOnTheOrderWhenTheyAgree) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    std::vector<Map<D>> maps = parts<D>(dice, 3, 0.0);
    const auto anchor = pose_anchor<D>(pose_key(7));
    const Map<D> all = change_frame(solve(merge<D>(maps)), anchor);
    const Map<D> left = join(join(maps[0], maps[1]), maps[2]);
    const Map<D> right = join(maps[2], join(maps[1], maps[0]));
    expect_close_maps(change_frame(left, anchor), all, 1e-8);
    expect_close_maps(change_frame(right, anchor), all, 1e-8);
    std::swap(maps[0], maps[2]);
    expect_close_maps(change_frame(solve(merge<D>(maps)), anchor), all, 1e-8);
  }
}

TYPED_TEST(JoinMaps, DoesNotDependOnTheFramesTheyComeIn) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    const std::vector<Map<D>> maps = parts<D>(dice, 2, 0.0);
    const auto anchor = pose_anchor<D>(pose_key(4));
    const Map<D> joined = change_frame(join(maps[0], maps[1]), anchor);
    for (std::uint64_t at = 0; at < 5; ++at) {
      const Map<D> first = change_frame(maps[0], pose_anchor<D>(pose_key(at)));
      const Map<D> second = change_frame(maps[1], pose_anchor<D>(pose_key(7 - at)));
      EXPECT_EQ(join(first, second).anchor, first.anchor);
      expect_close_maps(change_frame(join(first, second), anchor), joined, 1e-8);
    }
  }
}

TYPED_TEST(JoinMaps, KeepsInformationPositiveSemidefiniteAndSymmetric) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    Dice dice(seed);
    const Map<D> joined = solve(merge<D>(parts<D>(dice, 3, 0.3)));
    const Eigen::MatrixXd I = joined.information.dense();
    EXPECT_LT((I - I.transpose()).cwiseAbs().maxCoeff(), 1e-12 * I.cwiseAbs().maxCoeff());
    const Eigen::VectorXd found = eigenvalues(I);
    EXPECT_GT(found.minCoeff(), -1e-11 * found.maxCoeff());
  }
}

TYPED_TEST(JoinMaps, SaysWhatTwoMapsShareAndWhatIsMissing) {
  constexpr int D = TypeParam::value;
  Dice dice(4);
  const Values<D> all = random_values<D>(dice, ids(4), ids(9));
  const auto map = [&](const std::vector<std::uint64_t>& poses,
                       const std::vector<std::uint64_t>& points) {
    return map_of(dice, part_of(all, poses, points), pose_anchor<D>(pose_key(poses[0])));
  };
  const Map<D> a = map({0, 1}, {0, 1, 2, 3});
  EXPECT_THAT(complaint_of<DisconnectedError>([&] {
                (void)join(a, map({2}, {7, 8}));
              }),
              AllOf(HasSubstr("map 2"), HasSubstr("nothing"), HasSubstr("one common pose")));
  const std::string one = complaint_of<DisconnectedError>([&] { (void)join(a, map({2}, {3, 8})); });
  EXPECT_THAT(one, AllOf(HasSubstr("point:3"), HasSubstr("1 variable")));
  EXPECT_THAT(one, HasSubstr(D == 2 ? "two common points" : "three common points"));
  if constexpr (D == 3) {
    EXPECT_THAT(complaint_of<DisconnectedError>([&] {
                  (void)join(a, map({2}, {2, 3}));
                }),
                AllOf(HasSubstr("point:2"), HasSubstr("point:3"), HasSubstr("2 variables")));
  }
  EXPECT_NO_THROW((void)join(a, map({2}, D == 2 ? std::vector<std::uint64_t>{2, 3}
                                                : std::vector<std::uint64_t>{1, 2, 3})));
  EXPECT_NO_THROW((void)join(a, map({1}, {8})));
  EXPECT_THROW((void)merge<D>({a}), InputError);
  EXPECT_THROW((void)merge<D>({}), InputError);
}

TYPED_TEST(JoinMaps, JoinsAMapThatSharesEnoughOnlyWithTwoOthersTogether) {
  // The third shares too little with either of the others, and enough with both.
  constexpr int D = TypeParam::value;
  Dice dice(5);
  const Values<D> all = random_values<D>(dice, ids(9), ids(9));
  const auto map = [&](std::uint64_t pose, const std::vector<std::uint64_t>& points) {
    return map_of(dice, part_of(all, {pose}, points), pose_anchor<D>(pose_key(pose)));
  };
  std::vector<Map<D>> maps;
  if constexpr (D == 2) {
    maps = {map(0, {0, 1, 2}), map(1, {1, 2, 3}), map(2, {0, 3})};
  } else {
    maps = {map(0, {0, 1, 2, 4}), map(1, {1, 2, 4, 3, 5}), map(2, {0, 3, 5})};
  }
  const Map<D> joined = solve(merge<D>(maps));
  Values<D> truth = part_of(all, ids(3), D == 2 ? ids(4) : ids(6));
  truth.transform(truth.pose(pose_key(0)).inverse());
  EXPECT_LT(distance(joined.values, truth), 1e-9);
}

TYPED_TEST(JoinMaps, NamesAVariableThatNothingDetermines) {
  constexpr int D = TypeParam::value;
  Dice dice(6);
  std::vector<Map<D>> maps = parts<D>(dice, 2, 0.0);
  // point:5 is in both maps; take the information about it away.
  for (Map<D>& map : maps) {
    const int i = map.variables().require(point_key(5), "test");
    for (int j = 0; j < map.information.size(); ++j) {
      for (auto s = map.information.begin(j); s < map.information.end(j); ++s) {
        if (j != i && map.information.row(s) != i) continue;
        const int size = map.information.dim(map.information.row(s)) * map.information.dim(j);
        std::fill_n(map.information.block(s), size, 0.0);
      }
    }
  }
  EXPECT_THAT(complaint_of<SingularError>([&] { (void)join(maps[0], maps[1]); }),
              HasSubstr("point:5"));
}

TYPED_TEST(JoinMaps, ALocalMapAsAMapIsTheMapItWas) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    Dice dice(seed);
    const Map<D> map = random_map<D>(dice, ids(5), ids(4), 3);
    const Map<D> back = to_map(as_local_map(map));
    EXPECT_EQ(back.anchor, map.anchor);
    expect_close_maps(back, map, 1e-11);
  }
}

TYPED_TEST(JoinMaps, FusesWhatALocalMapMeasuresTwice) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    const Values<D> all = random_values<D>(dice, ids(4), ids(3));
    const LocalMap<D> local = random_local_map<D>(
        dice, all, 2, {pose_key(1), point_key(0), pose_key(1), pose_key(3), point_key(0)}, 0.05);
    const Map<D> map = to_map(local);
    EXPECT_EQ(map.anchor, local.anchor);
    ASSERT_EQ(map.variables().size(), 4);
    CeresReference<D> reference;
    reference.add(local);
    Values<D> start = part_of(all, {1, 2, 3}, {0});
    start.transform(start.pose(pose_key(2)).inverse());
    const Values<D> best = reference.minimise(start, pose_key(2));
    EXPECT_LT(distance(map.values, best), 1e-7);
    EXPECT_LT(relative_distance(map.information.dense(), reference.normal_equations(best).H), 1e-6);
  }
}

TYPED_TEST(JoinMaps, ALocalMapThatFallsApartIsNoMap) {
  constexpr int D = TypeParam::value;
  LocalMap<D> empty;
  empty.anchor = pose_anchor<D>(pose_key(0));
  EXPECT_THROW((void)to_map(empty), Error);
}

}  // namespace
}  // namespace mapjoin
