// The exported conformance suites, run on the types and anchors of the library and of a user.

#include <gtest/gtest-spi.h>
#include <gtest/gtest.h>

#include "examples/level_anchor.h"
#include "examples/line_anchor.h"
#include "mapjoin/frames/points_anchor.h"
#include "mapjoin/frames/testing/anchor_conformance.h"
#include "mapjoin/graph/builtin_types.h"
#include "mapjoin/graph/testing/variable_conformance.h"
#include "tests/support/user_types.h"

namespace mapjoin {
namespace {

using test::Wall;
using testing::Generator;
using testing::random_motion;
using testing::random_vector;
using Bias2 = test::BiasType<2>;
using Bias3 = test::BiasType<3>;
using ExampleLine = own::Line;
using ExampleDirection = own::Direction;
using ExamplePlane = own::Plane;

template <int D>
Rigid<D> some_pose(Generator& generator) {
  switch (generator() % 4) {
    case 0:
      return Rigid<D>();
    case 1:
      return random_motion<D>(generator, 1000.0);
    default:
      return random_motion<D>(generator);
  }
}
template <int D>
Vec<D> some_point(Generator& generator) {
  if (generator() % 5 == 0) return Vec<D>::Zero();
  return random_vector<D>(generator, generator() % 2 == 0 ? 1.0 : 1000.0);
}
Wall::Value<double> some_wall(Generator& generator) {
  return {testing::uniform(generator, -3.2, 3.2), testing::uniform(generator, -10.0, 10.0)};
}
own::Line::Value<double> some_line(Generator& generator) {
  return {testing::uniform(generator, -3.2, 3.2), testing::uniform(generator, -10.0, 10.0)};
}
Vec<3> some_direction(Generator& generator) {
  return random_vector<3>(generator, 1.0).normalized();
}
own::Plane::Value<double> some_plane(Generator& generator) {
  return {some_direction(generator), testing::uniform(generator, -10.0, 10.0)};
}
Vec<1> some_bias(Generator& generator) { return random_vector<1>(generator, 5.0); }

MAPJOIN_TEST_VARIABLE(Pose2, some_pose<2>);
MAPJOIN_TEST_VARIABLE(Pose3, some_pose<3>);
MAPJOIN_TEST_VARIABLE(Point2, some_point<2>);
MAPJOIN_TEST_VARIABLE(Point3, some_point<3>);
MAPJOIN_TEST_VARIABLE(Wall, some_wall);
MAPJOIN_TEST_VARIABLE(Bias2, some_bias);
MAPJOIN_TEST_VARIABLE(Bias3, some_bias);
MAPJOIN_TEST_VARIABLE(ExampleLine, some_line);
MAPJOIN_TEST_VARIABLE(ExampleDirection, some_direction);
MAPJOIN_TEST_VARIABLE(ExamplePlane, some_plane);

template <int D>
std::pair<Values<D>, Anchor<D>> some_map(Generator& generator) {
  ValuesBuilder<D> builder;
  for (std::uint64_t id = 0; id < 4; ++id) {
    builder.template add<PoseType<D>>(pose_key(id), some_pose<D>(generator));
    builder.template add<PointType<D>>(point_key(id), random_vector<D>(generator, 10.0));
  }
  return {std::move(builder).build(), pose_anchor<D>(pose_key(generator() % 4))};
}
std::pair<Values<2>, Anchor<2>> some_two_points(Generator& generator) {
  return {some_map<2>(generator).first,
          points_anchor(point_key(generator() % 2), point_key(2 + generator() % 2))};
}
std::pair<Values<3>, Anchor<3>> some_three_points(Generator& generator) {
  const std::uint64_t first = generator() % 4;
  return {some_map<3>(generator).first,
          points_anchor(point_key(first), point_key((first + 1) % 4), point_key((first + 2) % 4))};
}
std::pair<Values<2>, Anchor<2>> some_line_and_point(Generator& generator) {
  ValuesBuilder<2> builder;
  builder.add<own::Line>(own::line_key(7), some_line(generator));
  builder.add<Point2>(point_key(3), random_vector<2>(generator, 10.0));
  return {std::move(builder).build(), own::line_anchor(7, 3)};
}
std::pair<Values<3>, Anchor<3>> some_level_pose(Generator& generator) {
  ValuesBuilder<3> builder;
  builder.add<Pose3>(pose_key(5), random_motion<3>(generator));
  builder.add<own::Direction>(own::up_key(0), some_direction(generator));
  return {std::move(builder).build(), own::level_anchor(5, 0)};
}

MAPJOIN_TEST_ANCHOR(Pose2, 2, some_map<2>);
MAPJOIN_TEST_ANCHOR(Pose3, 3, some_map<3>);
MAPJOIN_TEST_ANCHOR(TwoPoints, 2, some_two_points);
MAPJOIN_TEST_ANCHOR(ThreePoints, 3, some_three_points);
MAPJOIN_TEST_ANCHOR(ExampleLineAndPoint, 2, some_line_and_point);
MAPJOIN_TEST_ANCHOR(ExampleLevelPose, 3, some_level_pose);

// The suite must notice what is wrong: types with one law broken each.
struct WrongAction : Wall {
  static constexpr FrameAction action = FrameAction::kBody;
};
struct WrongGauge : Point2 {
  static Mat<2, 3> gauge(const Vec<2>& p) {
    Mat<2, 3> g = Point2::gauge(p);
    g.col(2) = -g.col(2);
    return g;
  }
};
struct WrongLocal : Point3 {
  template <class S>
  static Vec<3, S> local(const Vec<3, S>& x, const Vec<3, S>& y) {
    return (y - x) * S(1.001);
  }
};

struct WrongDirection : own::Line {
  static Vec<2> direction(const Value<double>& x) { return -own::Line::direction(x); }
};

/// Does a check fail, when it runs on its own?
template <class Check>
bool fails(Check&& check) {
  ::testing::TestPartResultArray results;
  {
    ::testing::ScopedFakeTestPartResultReporter reporter(
        ::testing::ScopedFakeTestPartResultReporter::INTERCEPT_ONLY_CURRENT_THREAD, &results);
    check();
  }
  for (int k = 0; k < results.size(); ++k) {
    if (results.GetTestPartResult(k).failed()) return true;
  }
  return false;
}

TEST(VariableConformance, NoticesAWrongFrameAction) {
  const testing::VariableConformance<WrongAction> suite(some_wall);
  EXPECT_TRUE(fails([&] { suite.frame_jacobian_is_the_derivative(); }));
  EXPECT_FALSE(fails([&] { suite.local_undoes_retract(); }));
}

TEST(VariableConformance, NoticesWrongGaugeRows) {
  const testing::VariableConformance<WrongGauge> suite(some_point<2>);
  EXPECT_TRUE(fails([&] { suite.gauge_is_the_derivative(); }));
}

TEST(VariableConformance, NoticesAnOffsetThatIsNotAlongTheDirection) {
  const testing::VariableConformance<WrongDirection> suite(some_line);
  EXPECT_TRUE(fails([&] { suite.what_aligns_moves_along(); }));
  EXPECT_FALSE(fails([&] { suite.gauge_is_the_derivative(); }));
}

TEST(VariableConformance, NoticesALocalThatDoesNotUndoRetract) {
  const testing::VariableConformance<WrongLocal> suite(some_point<3>);
  EXPECT_TRUE(fails([&] { suite.local_undoes_retract(); }));
  EXPECT_FALSE(fails([&] { suite.transform_is_an_action(); }));
}

}  // namespace
}  // namespace mapjoin
