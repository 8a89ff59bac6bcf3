// The measurement models: their laws, and that they are what the units say.
#include "mapjoin/building/models.h"

#include <ceres/jet.h>
#include <gtest/gtest.h>

#include <numbers>

#include "mapjoin/building/robust_loss.h"
#include "mapjoin/building/testing/model_conformance.h"
#include "mapjoin/graph/error.h"
#include "tests/support/user_types.h"

namespace mapjoin {
namespace {

using testing::Generator;
using testing::random_motion;
using testing::random_vector;
using testing::uniform;

using RelativePose2 = RelativeModel<Pose2>;
using RelativePose3 = RelativeModel<Pose3>;
using PointIn2D = RelativeModel<Point2>;
using PointIn3D = RelativeModel<Point3>;
using Wall = RelativeModel<own::Line>;

Rigid2 some_pose2(Generator& g) { return random_motion<2>(g, 5.0); }
Rigid3 some_pose3(Generator& g) { return random_motion<3>(g, 5.0); }
Vec<2> some_point2(Generator& g) { return random_vector<2>(g, 5.0); }
Vec<3> some_point3(Generator& g) { return random_vector<3>(g, 5.0); }
Vec<2> some_range_bearing(Generator& g) { return {uniform(g, 1.0, 9.0), uniform(g, -9.0, 9.0)}; }
Vec<3> some_elevation(Generator& g) {
  return {uniform(g, 1.0, 9.0), uniform(g, -9.0, 9.0), uniform(g, -1.3, 1.3)};
}
Vec<1> some_bearing(Generator& g) { return Vec<1>(uniform(g, -9.0, 9.0)); }
Vec<1> some_range(Generator& g) { return Vec<1>(uniform(g, 1.0, 9.0)); }
Vec<3> some_velocity(Generator& g) {
  return {uniform(g, -2.0, 2.0), uniform(g, -3.0, 3.0), uniform(g, 0.1, 0.5)};
}
ValueOf<own::Line> some_wall(Generator& g) {
  return {uniform(g, -3.0, 3.0), uniform(g, -5.0, 5.0)};
}

/// A user's own, as docs/building.md shows it: a sonar that looks up.
struct Height {
  using Target = mapjoin::Point3;
  using Measurement = mapjoin::Vec<1>;
  static constexpr int dim = 1;
  static constexpr std::string_view name = "height";
  template <class S>
  static mapjoin::Vec<1, S> residual(const Measurement& z, const mapjoin::Vec<3, S>& seen) {
    return mapjoin::Vec<1, S>(seen(2) - z(0));
  }
  static mapjoin::Vec<3> hypothesis(const Measurement& z, double u) {
    return {20.0 * u - 10.0, 0.0, z(0)};
  }
};

MAPJOIN_TEST_MODEL(Height, some_range);
MAPJOIN_TEST_MODEL(RelativePose2, some_pose2);
MAPJOIN_TEST_MODEL(RelativePose3, some_pose3);
MAPJOIN_TEST_MODEL(PointIn2D, some_point2);
MAPJOIN_TEST_MODEL(PointIn3D, some_point3);
MAPJOIN_TEST_MODEL(RangeBearing, some_range_bearing);
MAPJOIN_TEST_MODEL(RangeBearingElevation, some_elevation);
MAPJOIN_TEST_MODEL(BearingOnly, some_bearing);
MAPJOIN_TEST_MODEL(RangeOnly, some_range);
MAPJOIN_TEST_MODEL(VelocityTurnRate, some_velocity);
MAPJOIN_TEST_MODEL(Wall, some_wall);

TEST(Models, BearingsWrap) {
  const Vec<2> behind(-1.0, -0.01);
  const double turns = 2.0 * std::numbers::pi * 3.0;
  EXPECT_NEAR(BearingOnly::residual<double>(Vec<1>(std::numbers::pi), behind)(0), 0.01, 1e-5);
  EXPECT_NEAR(BearingOnly::residual<double>(Vec<1>(std::numbers::pi + turns), behind)(0), 0.01,
              1e-5);
}

TEST(Models, AVehicleTurnsBeforeItDrives) {
  const Rigid2 step = VelocityTurnRate::seen({2.0, 0.5, 0.2});
  EXPECT_NEAR(heading(step), 0.1, 1e-15);
  EXPECT_NEAR(step.t(0), 0.4 * std::cos(0.1), 1e-15);
  EXPECT_NEAR(step.t(1), 0.4 * std::sin(0.1), 1e-15);
}

TEST(Models, SlidingSidewaysIsSidewaysSpeed) {
  Rigid2 step = VelocityTurnRate::seen({2.0, 0.5, 0.2});
  step.t += step.R * Vec<2>(0.0, 0.02);
  const Vec<3> r = VelocityTurnRate::residual<double>({2.0, 0.5, 0.2}, step);
  EXPECT_TRUE(r.isApprox(Vec<3>(0.0, 0.1, 0.0), 1e-12)) << r.transpose();
}

/// Ceres differentiates the same templates by its own numbers.
TEST(Models, DerivativesAreThoseOfCeres) {
  using Jet = ceres::Jet<double, 2>;
  const Vec<2> z(4.0, 0.7), x(2.0, 3.0);
  Vec<2, Jet> jets;
  for (int k = 0; k < 2; ++k) jets(k) = Jet(x(k), k);
  const Vec<2, Jet> r = RangeBearing::residual<Jet>(z, jets);
  const Vec<2, Dual<2>> d = RangeBearing::residual<Dual<2>>(
      z, Vec<2, Dual<2>>(Dual<2>::variable(x(0), 0), Dual<2>::variable(x(1), 1)));
  for (int i = 0; i < 2; ++i) {
    EXPECT_NEAR(r(i).a, d(i).a, 1e-14);
    EXPECT_NEAR(r(i).v(0), d(i).v(0), 1e-14);
    EXPECT_NEAR(r(i).v(1), d(i).v(1), 1e-14);
  }
}

TEST(RobustLoss, DerivativesAreThoseByDifferences) {
  for (const char* name : {"none", "huber:2", "cauchy:2", "geman-mcclure:2"}) {
    const RobustLoss loss = parse_robust_loss(name);
    for (const double s : {0.1, 1.0, 3.9, 4.1, 25.0, 1e4}) {
      const double h = 1e-5 * s;
      double at[3], above[3], below[3];
      loss.evaluate(s, at);
      loss.evaluate(s + h, above);
      loss.evaluate(s - h, below);
      EXPECT_NEAR(at[1], (above[0] - below[0]) / (2 * h), 1e-6) << name << " " << s;
      EXPECT_NEAR(at[2], (above[1] - below[1]) / (2 * h), 1e-6) << name << " " << s;
    }
  }
}

TEST(RobustLoss, CountsGoodMeasurementsInFull) {
  for (const char* name : {"none", "huber", "cauchy", "geman-mcclure"})
    EXPECT_NEAR(parse_robust_loss(name).weight(1e-9), 1.0, 1e-6) << name;
}

TEST(RobustLoss, RefusesWhatIsNoLoss) {
  for (const char* text : {"", "tukey", "huber:", "huber:-1", "cauchy:0", "cauchy:2x", "huber:nan"})
    EXPECT_THROW(parse_robust_loss(text), InputError) << text;
}

}  // namespace
}  // namespace mapjoin
