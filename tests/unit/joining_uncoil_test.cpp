// Chains of poses that are wound up: found, and laid so that refinement ends where it should.
#include "mapjoin/joining/uncoil.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <numeric>

#include "mapjoin/graph/whole_piece.h"
#include "mapjoin/joining/refine.h"
#include "tests/support/random_maps.h"

namespace mapjoin::test {
namespace {

template <class Dimension>
class Coils : public testing::Test {
 public:
  static constexpr int D = Dimension::value;
  static constexpr int kPoses = 30;

  /// Poses in a row, a point in view of the middle, and ties that hold both ends where they are.
  void build(double noise) {
    Dice dice(7);
    MeasurementGraphBuilder<D> builder;
    const auto tie = [&](int a, int b) {
      const Rigid<D> z = noisy<PoseType<D>>(dice, pose(a).inverse() * pose(b), noise);
      builder.template add<PoseType<D>>(key(a), key(b), z,
                                        Mat<kGauge<D>, kGauge<D>>::Identity() * 100.0);
    };
    for (int k = 1; k < kPoses; ++k) tie(k - 1, k);
    for (int k = 2; k <= 10; ++k) tie(0, k);
    for (int k = 20; k < kPoses - 1; ++k) tie(k, kPoses - 1);
    tie(0, kPoses - 1);
    Vec<D> point = Vec<D>::Zero();
    point(0) = 15.0;
    point(1) = 2.0;
    for (const int k : {14, 15, 16}) {
      builder.template add<PointType<D>>(key(k), point_key(1), pose(k).inverse() * point,
                                         Mat<D, D>(Mat<D, D>::Identity()));
    }
    graph = std::move(builder).build();
    ValuesBuilder<D> values;
    for (int k = 0; k < kPoses; ++k) values.template add<PoseType<D>>(key(k), pose(k));
    values.template add<PointType<D>>(point_key(1), point);
    truth = std::move(values).build();
  }
  static Key key(int k) { return pose_key(static_cast<std::uint64_t>(k)); }
  static Rigid<D> pose(int k) {
    Rigid<D> out;
    out.t(0) = k;
    return out;
  }
  /// The piece at the truth, poses 10 to 20 turned by `turns` from one end to the other.
  Piece<D> wound(double turns) const {
    Values<D> values = truth;
    for (int k = 10; k <= 20; ++k)
      turn(values, k, turns * 2.0 * std::numbers::pi * (k - 10) / 10.0);
    return whole_piece(graph, values);
  }
  /// One pose turned.
  Piece<D> turned(int k, double angle) const {
    Values<D> values = truth;
    turn(values, k, angle);
    return whole_piece(graph, values);
  }
  static void turn(Values<D>& values, int k, double angle) {
    Rigid<D> x = pose(k);
    x.R(0, 0) = x.R(1, 1) = std::cos(angle);
    x.R(1, 0) = std::sin(angle);
    x.R(0, 1) = -x.R(1, 0);
    values.template set<PoseType<D>>(values.variables().require(key(k), "test"), x);
  }
  double refined(Piece<D>& piece) {
    Places places(graph.variables.size());
    ObservationSystem<D> system(graph, piece, {}, places);
    FrontalCholesky cholesky;
    WorkerPool pool;
    return refine(graph, piece, system, cholesky, pool, 200, 1e-12, {}).chi2;
  }

  MeasurementGraph<D> graph;
  Values<D> truth;
};
using Dimensions = testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(Coils, Dimensions);

TYPED_TEST(Coils, AreMinimaThatRefinementDoesNotLeave) {
  this->build(0.01);
  Piece<TestFixture::D> straight = this->wound(0.0), wound = this->wound(1.0);
  const double optimum = this->refined(straight);
  EXPECT_GT(this->refined(wound), 10.0 * optimum);
}

TYPED_TEST(Coils, AreFoundAndLaidSoThatRefinementEndsInTheOptimum) {
  this->build(0.01);
  Piece<TestFixture::D> straight = this->wound(0.0), wound = this->wound(1.0);
  const double optimum = this->refined(straight);
  Places places(this->graph.variables.size());
  WorkerPool pool(2);
  const std::vector<int> coiled = coiled_poses(this->graph, wound, places, pool);
  ASSERT_GE(coiled.size(), 10U);
  EXPECT_GE(wound.variables[static_cast<std::size_t>(coiled.front())], 0);
  lay_anew(this->graph, wound, places, coiled);
  EXPECT_TRUE(coiled_poses(this->graph, wound, places, pool).empty());
  EXPECT_NEAR(this->refined(wound), optimum, 1e-9 * optimum);
  EXPECT_LT(distance(to_values(this->graph.variables, wound), this->truth), 0.5);
}

TYPED_TEST(Coils, AreNoneWherePosesAreOnlyTurnedALittle) {
  this->build(0.01);
  Places places(this->graph.variables.size());
  WorkerPool pool;
  EXPECT_TRUE(coiled_poses(this->graph, this->wound(0.0), places, pool).empty());
  EXPECT_TRUE(coiled_poses(this->graph, this->turned(15, 0.5), places, pool).empty());
  EXPECT_FALSE(coiled_poses(this->graph, this->turned(15, 2.0), places, pool).empty());
}

TYPED_TEST(Coils, LeaveWhatNothingReachesWhereItIs) {
  this->build(0.0);
  Piece<TestFixture::D> piece = this->wound(1.0);
  const Piece<TestFixture::D> before = piece;
  std::vector<int> all(static_cast<std::size_t>(this->kPoses));
  const int first =
      piece.column_start[static_cast<std::size_t>(this->graph.variables.find_column(Tag("pose")))];
  std::iota(all.begin(), all.end(), first);
  Places places(this->graph.variables.size());
  lay_anew(this->graph, piece, places, all);  // nothing is left to lay them from
  EXPECT_LT(
      distance(to_values(this->graph.variables, piece), to_values(this->graph.variables, before)),
      1e-12);
}

}  // namespace
}  // namespace mapjoin::test
