// Consistency: NEES against its dense definition and over simulated runs; chi-squared against
// tables.
#include "mapjoin/evaluation/consistency.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "mapjoin/evaluation/chi_squared.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/graph/symmetric.h"
#include "mapjoin/joining/join_all.h"
#include "mapjoin/solvers/covariance.h"
#include "mapjoin/solvers/marginalize.h"
#include "tests/support/dense.h"
#include "tests/support/random_maps.h"

namespace mapjoin::test {
namespace {

TEST(ChiSquared, QuantilesAreThoseOfTheTables) {
  struct Row {
    int dimension;
    double p, x;
  };
  // Printed in any table of the distribution.
  for (const Row& row : {Row{1, 0.95, 3.841458821},
                         {2, 0.95, 5.991464547},
                         {3, 0.95, 7.814727903},
                         {1, 0.99, 6.634896601},
                         {2, 0.99, 9.210340372},
                         {3, 0.99, 11.34486673},
                         {5, 0.05, 1.145476226},
                         {10, 0.95, 18.30703805},
                         {10, 0.025, 3.246972780},
                         {30, 0.975, 46.97924224},
                         {100, 0.95, 124.3421134},
                         {100, 0.05, 77.92946517}}) {
    EXPECT_NEAR(chi_squared_quantile(row.p, row.dimension), row.x, 2e-9 * row.x) << row.dimension;
  }
}

TEST(ChiSquared, TwoDimensionsIsAnExponential) {
  for (const double x : {0.1, 1.0, 5.0, 20.0, 60.0})
    EXPECT_NEAR(chi_squared_probability(x, 2), 1.0 - std::exp(-0.5 * x), 1e-14);
}

TEST(ChiSquared, QuantileInvertsProbability) {
  for (const int n : {1, 2, 3, 7, 50, 1224, 8404, 100000}) {
    for (const double p : {0.001, 0.025, 0.3, 0.5, 0.95, 0.975, 0.9999}) {
      const double x = chi_squared_quantile(p, n);
      EXPECT_NEAR(chi_squared_probability(x, n), p, 1e-10) << n;
    }
  }
}

TEST(ChiSquared, SumsOfSquaresFallBelowQuantilesAsOftenAsTheySay) {
  Dice dice(5);
  int below = 0;
  const double x = chi_squared_quantile(0.9, 6);
  for (int k = 0; k < 20000; ++k) below += dice.matrix(6, 1).squaredNorm() <= x;
  EXPECT_NEAR(below / 20000.0, 0.9, 0.01);
}

TEST(ChiSquared, RefusesWhatIsNoProbability) {
  EXPECT_THROW(chi_squared_quantile(0.0, 3), InputError);
  EXPECT_THROW(chi_squared_quantile(1.0, 3), InputError);
  EXPECT_THROW(chi_squared_quantile(0.5, 0), InputError);
  EXPECT_THROW(chi_squared_probability(-1.0, 3), InputError);
}

template <class Dimension>
class ConsistencyOf : public ::testing::Test {
 public:
  static constexpr int kDimension = Dimension::value;
};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(ConsistencyOf, Dimensions);

TYPED_TEST(ConsistencyOf, NeesIsTheErrorWeighedByTheInverseCovariance) {
  constexpr int D = TestFixture::kDimension;
  for (int trial = 0; trial < 5; ++trial) {
    Dice dice(70 + static_cast<std::uint64_t>(trial));
    const Map<D> map = random_map<D>(dice, ids(10), ids(8), 0);
    const Values<D> truth = noisy(dice, map.values, 0.01);
    // Features and every other pose are known, in a frame of their own.
    Values<D> known = part_of(truth, {0, 2, 4, 6, 8}, ids(6));
    const Rigid<D> into = motion_into(map.anchor, known);
    Values<D> there = known;
    there.transform(into);
    known.transform(random_pose<D>(dice));

    std::vector<Key> keys;
    Eigen::VectorXd e(0);
    for (int i = 0; i < there.size(); ++i) {
      const Key key = there.variables().key(i);
      if (key == pose_key(0)) continue;
      keys.push_back(key);
      const int dim = there.variables().dim(i);
      Eigen::VectorXd part(dim);
      there.variables().kind(i).local(map.values.value(map.variables().require(key, "")),
                                      there.value(i), 1, part.data());
      e.conservativeResize(e.size() + dim);
      e.tail(dim) = part;
    }
    const double dense = e.dot(test::dense_solve(Covariance<D>(map).of(keys), e).col(0));
    const Consistency c = consistency(map, known);
    EXPECT_EQ(c.dimension, e.size());
    EXPECT_NEAR(c.nees, dense, 1e-8 * dense);
    // The same of the map that has nothing else.
    keys.push_back(pose_key(0));
    EXPECT_NEAR(consistency(marginalize(map, std::span<const Key>(keys)), known).nees, dense,
                1e-8 * dense);
  }
}

TYPED_TEST(ConsistencyOf, NeesIsTheSameInAllFramesToFirstOrder) {
  constexpr int D = TestFixture::kDimension;
  Dice dice(83);
  const Map<D> map = random_map<D>(dice, ids(8), ids(6), 0);
  const Values<D> truth = noisy(dice, map.values, 1e-6);
  const double nees = consistency(map, truth).nees;
  for (const std::uint64_t id : {1U, 5U, 7U}) {
    const Map<D> there = change_frame(map, pose_anchor<D>(pose_key(id)));
    EXPECT_NEAR(consistency(there, truth).nees, nees, 1e-3 * nees);
  }
}

// A Monte Carlo of solved worlds: the sum of chi-squared variables is one.
TYPED_TEST(ConsistencyOf, SolvedSimulatedWorldsAreConsistent) {
  constexpr int D = TestFixture::kDimension;
  constexpr int G = kGauge<D>;
  constexpr int kRuns = 20;
  double all = 0.0, features = 0.0;
  int dimension = 0, feature_dimension = 0;
  double within[3] = {};  // one, two, three standard deviations
  for (std::uint64_t run = 0; run < kRuns; ++run) {
    Dice dice(900 + run);
    const double sigma = 0.01;
    std::vector<Rigid<D>> pose(1);
    for (int k = 1; k < 15; ++k) {
      Rigid<D> step = random_pose<D>(dice, 0.2, 0.4);
      step.t(0) += 1.0;
      pose.push_back(pose.back() * step);
    }
    ValuesBuilder<D> truth, beacons;
    MeasurementGraphBuilder<D> graph;
    const auto id = [](std::size_t k) { return static_cast<std::uint64_t>(k); };
    for (std::size_t k = 0; k < pose.size(); ++k) {
      truth.template add<PoseType<D>>(pose_key(id(k)), pose[k]);
      for (const std::size_t step : {std::size_t{1}, std::size_t{4}}) {
        if (k < step) continue;
        graph.template add<PoseType<D>>(
            pose_key(id(k - step)), pose_key(id(k)),
            noisy<PoseType<D>>(dice, pose[k - step].inverse() * pose[k], sigma),
            Mat<G, G>(Mat<G, G>::Identity() / (sigma * sigma)));
      }
    }
    beacons.template add<PoseType<D>>(pose_key(0), pose[0]);
    for (std::size_t p = 0; p < 8; ++p) {
      const std::size_t home = static_cast<std::size_t>(dice.below(12));
      const Vec<D> x = pose[home] * random_point<D>(dice, 2.0);
      truth.template add<PointType<D>>(point_key(id(p)), x);
      beacons.template add<PointType<D>>(point_key(id(p)), x);
      for (std::size_t s = home; s < home + 3; ++s) {
        graph.template add<PointType<D>>(pose_key(id(s)), point_key(id(p)),
                                         noisy<PointType<D>>(dice, pose[s].inverse() * x, sigma),
                                         Mat<D, D>(Mat<D, D>::Identity() / (sigma * sigma)));
      }
    }
    const Map<D> map = join_all(std::move(graph).build()).maps.at(0);
    const Values<D> everything = std::move(truth).build();
    const Consistency a = consistency(map, everything);
    for (std::size_t k = 0; k < 3; ++k) {
      const Coverage part = coverage(map, everything, static_cast<double>(k + 1));
      EXPECT_EQ(part.count, a.dimension) << "all but what the frame pins";
      within[k] += part.share() / kRuns;
    }
    const Consistency b = consistency(map, std::move(beacons).build());
    all += a.nees;
    dimension += a.dimension;
    features += b.nees;
    feature_dimension += b.dimension;
  }
  EXPECT_EQ(dimension, kRuns * (14 * G + 8 * D));
  EXPECT_EQ(feature_dimension, kRuns * 8 * D);
  EXPECT_NEAR(within[0], 0.683, 0.06);  // errors within a world are correlated
  EXPECT_NEAR(within[1], 0.954, 0.04);
  EXPECT_NEAR(within[2], 0.997, 0.03);
  EXPECT_GT(all, chi_squared_quantile(0.005, dimension));
  EXPECT_LT(all, chi_squared_quantile(0.995, dimension));
  EXPECT_GT(features, chi_squared_quantile(0.005, feature_dimension));
  EXPECT_LT(features, chi_squared_quantile(0.995, feature_dimension));
}

TYPED_TEST(ConsistencyOf, OverconfidentMapsAreFound) {
  constexpr int D = TestFixture::kDimension;
  Dice dice(97);
  Map<D> map = random_map<D>(dice, ids(12), ids(12), 0);
  // An error drawn from the map's own covariance.
  std::vector<Key> keys;
  std::vector<int> numbers;
  for (int i = 0; i < map.values.size(); ++i) keys.push_back(map.variables().key(i));
  for (double& v : map.information.values()) v *= 1e8;  // small errors, so first order holds
  const Eigen::MatrixXd sigma = Covariance<D>(map).of(keys);
  const Spectrum eigen = spectrum(sigma);
  const Eigen::VectorXd d = eigen.vectors * (eigen.values.cwiseMax(0.0).cwiseSqrt().asDiagonal() *
                                             dice.matrix(sigma.rows(), 1));
  Values<D> truth = map.values;
  truth.retract({d.data(), static_cast<std::size_t>(d.size())});
  EXPECT_TRUE(consistency(map, truth, 0.999).consistent());
  for (double& v : map.information.values()) v *= 4.0;
  const Consistency c = consistency(map, truth, 0.999);
  EXPECT_GT(c.nees, c.upper);
}

TEST(Consistency, SaysWhatTheTruthLacks) {
  Dice dice(101);
  const Map<2> map = random_map<2>(dice, ids(4), ids(4), 0);
  EXPECT_THAT(complaint_of<InputError>([&] {
                consistency(map, part_of(map.values, {}, {0, 1}));
              }),
              ::testing::HasSubstr("pose:0"));
  EXPECT_THAT(complaint_of<InputError>([&] { consistency(map, part_of(map.values, {0}, {})); }),
              ::testing::HasSubstr("nothing"));
}

TEST(ConfidenceRegion, HoldsAsManySamplesAsItSays) {
  Dice dice(103);
  const Eigen::MatrixXd root = dice.matrix(2, 2);
  const Mat<2, 2> covariance = root * root.transpose();
  const ConfidenceRegion<2> region = confidence_region<2>(covariance, 0.8);
  EXPECT_GE(region.semi_axes(0), region.semi_axes(1));
  EXPECT_NEAR(region.axes.determinant(), 1.0, 1e-12);
  int inside = 0;
  for (int k = 0; k < 20000; ++k) {
    const Eigen::Vector2d x = root * dice.matrix(2, 1);
    const Eigen::Vector2d y = (region.axes.transpose() * x).cwiseQuotient(region.semi_axes);
    inside += y.squaredNorm() <= 1.0;
  }
  EXPECT_NEAR(inside / 20000.0, 0.8, 0.01);
}

}  // namespace
}  // namespace mapjoin::test
