// The exported conformance suites, run on the types and anchors of the library and of a user.

#include <gtest/gtest-spi.h>
#include <gtest/gtest.h>

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
Vec<1> some_bias(Generator& generator) { return random_vector<1>(generator, 5.0); }

MAPJOIN_TEST_VARIABLE(Pose2, some_pose<2>);
MAPJOIN_TEST_VARIABLE(Pose3, some_pose<3>);
MAPJOIN_TEST_VARIABLE(Point2, some_point<2>);
MAPJOIN_TEST_VARIABLE(Point3, some_point<3>);
MAPJOIN_TEST_VARIABLE(Wall, some_wall);
MAPJOIN_TEST_VARIABLE(Bias2, some_bias);
MAPJOIN_TEST_VARIABLE(Bias3, some_bias);

template <int D>
std::pair<Values<D>, Anchor<D>> some_map(Generator& generator) {
  ValuesBuilder<D> builder;
  for (std::uint64_t id = 0; id < 4; ++id) {
    builder.template add<PoseType<D>>(pose_key(id), some_pose<D>(generator));
    builder.template add<PointType<D>>(point_key(id), random_vector<D>(generator, 10.0));
  }
  return {std::move(builder).build(), pose_anchor<D>(pose_key(generator() % 4))};
}
std::pair<Values<2>, Anchor<2>> some_map_of_points(Generator& generator) {
  return {some_map<2>(generator).first, test::two_points(generator() % 2, 2 + generator() % 2)};
}

MAPJOIN_TEST_ANCHOR(Pose2, 2, some_map<2>);
MAPJOIN_TEST_ANCHOR(Pose3, 3, some_map<3>);
MAPJOIN_TEST_ANCHOR(TwoPoints, 2, some_map_of_points);

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

TEST(VariableConformance, NoticesALocalThatDoesNotUndoRetract) {
  const testing::VariableConformance<WrongLocal> suite(some_point<3>);
  EXPECT_TRUE(fails([&] { suite.local_undoes_retract(); }));
  EXPECT_FALSE(fails([&] { suite.transform_is_an_action(); }));
}

}  // namespace
}  // namespace mapjoin
