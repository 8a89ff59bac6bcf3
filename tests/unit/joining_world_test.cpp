// Absolute information: measurements from the pose that stands for the world.

#include "mapjoin/graph/world.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "mapjoin/evaluation/consistency.h"
#include "mapjoin/evaluation/evaluate.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/frames/parse_anchor.h"
#include "mapjoin/io/g2o.h"
#include "mapjoin/joining/join_all.h"
#include "tests/support/io.h"
#include "tests/support/random_maps.h"
#include "tests/support/user_types.h"

namespace mapjoin {
namespace {

using namespace test;  // NOLINT
using ::testing::HasSubstr;

template <class T>
class WorldFrame : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(WorldFrame, Dimensions);

/// A graph, and its truth somewhere in the world, the world with it.
template <int D>
struct Case {
  MeasurementGraphBuilder<D> builder;
  Values<D> truth;
  Case(Dice& dice, double noise) {
    const auto sample = random_graph<D>(dice, {.poses = 30, .points = 8, .noise = noise});
    builder.add(sample.graph);
    truth = sample.truth;
    truth.transform(random_pose<D>(dice, 100.0));
  }
  void add_fix(Dice& dice, std::uint64_t pose, double sigma) {
    const Vec<D> position =
        truth.pose(pose_key(pose)).t + sigma * noisy<PointType<D>>(dice, Vec<D>::Zero(), 1.0);
    const double weight = sigma > 0.0 ? 1.0 / (sigma * sigma) : 4.0;
    const auto fix = position_fix<D>(position, weight * Mat<D, D>::Identity());
    builder.template add<PoseType<D>>(world_key(), pose_key(pose), fix.z, fix.information);
  }
  /// The joined map in the frame of the world, without the world.
  Values<D> georeferenced(Mode mode) {
    JoinOptions options;
    options.mode = mode;
    options.leaf_variables = 8;
    MeasurementGraphBuilder<D> copy;
    const MeasurementGraph<D> graph = std::move(builder).build();
    copy.add(graph);
    builder = std::move(copy);
    const JoinResult<D> result = join_all(graph, options);
    EXPECT_EQ(result.maps.size(), 1U);
    EXPECT_EQ(result.maps[0].anchor, pose_anchor<D>(pose_key(0)))
        << "the world only when asked for";
    EXPECT_EQ(result.report.poses, 30);
    const Map<D> map = change_frame(result.maps[0], parse_anchor<D>("world"));
    return subset(map.values, std::span<const int>(numbers_in(truth.variables(), map.variables())));
  }
};

TYPED_TEST(WorldFrame, SurveyedPosesPlaceTheMap) {
  constexpr int D = TypeParam::value;
  Dice dice(1);
  Case<D> world(dice, 0.0);
  for (const std::uint64_t pose : {3U, 17U})
    world.builder.template add<PoseType<D>>(world_key(), pose_key(pose),
                                            world.truth.pose(pose_key(pose)),
                                            dice.definite(kGauge<D>, 10.0));
  for (const Mode mode : {Mode::kSummary, Mode::kObserve, Mode::kOptimal})
    EXPECT_LT(distance(world.georeferenced(mode), world.truth), 1e-8);
}

TYPED_TEST(WorldFrame, PositionsAlonePlaceTheMap) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    Case<D> world(dice, 0.0);
    for (const std::uint64_t pose : {0U, 9U, 20U, 29U}) world.add_fix(dice, pose, 0.0);
    for (const Mode mode : {Mode::kObserve, Mode::kOptimal})
      EXPECT_LT(distance(world.georeferenced(mode), world.truth), 1e-7);
  }
}

TYPED_TEST(WorldFrame, APositionAndAnOrientationPlaceTheMap) {
  constexpr int D = TypeParam::value;
  Dice dice(2);
  Case<D> world(dice, 0.0);
  world.add_fix(dice, 4, 0.0);
  const auto fix = orientation_fix<D>(world.truth.pose(pose_key(11)).R,
                                      100.0 * Mat<kRotation<D>, kRotation<D>>::Identity());
  world.builder.template add<PoseType<D>>(world_key(), pose_key(11), fix.z, fix.information);
  EXPECT_LT(distance(world.georeferenced(Mode::kOptimal), world.truth), 1e-7);
}

TYPED_TEST(WorldFrame, PositionsOfNoisyDrivesGiveConsistentMaps) {
  constexpr int D = TypeParam::value;
  // Chains whose noise is what their information says, and satellite positions of every third pose.
  double nees = 0.0, dimension = 0.0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Dice dice(seed);
    MeasurementGraphBuilder<D> builder;
    ValuesBuilder<D> truth;
    truth.template add<PoseType<D>>(world_key(), Rigid<D>());
    Rigid<D> last;
    for (std::uint64_t k = 0; k < 40; ++k) {
      Rigid<D> step = random_pose<D>(dice, 0.3, 0.5);
      step.t(0) += 1.0;
      const Rigid<D> pose = last * step;
      truth.template add<PoseType<D>>(pose_key(k), pose);
      Vec<kGauge<D>> noise;
      for (int i = 0; i < kGauge<D>; ++i) noise(i) = 0.02 * dice.normal();
      if (k > 0)
        builder.template add<PoseType<D>>(
            pose_key(k - 1), pose_key(k),
            PoseType<D>::template retract<double>(last.inverse() * pose, noise),
            2500.0 * Mat<kGauge<D>, kGauge<D>>::Identity());
      last = pose;
      if (k % 3 != 0) continue;
      Vec<D> at = pose.t;
      for (int i = 0; i < D; ++i) at(i) += 0.3 * dice.normal();
      const auto fix = position_fix<D>(at, Mat<D, D>::Identity() / 0.09);
      builder.template add<PoseType<D>>(world_key(), pose_key(k), fix.z, fix.information);
    }
    const Values<D> known = std::move(truth).build();
    const JoinResult<D> result = join_all(std::move(builder).build());
    ASSERT_EQ(result.maps.size(), 1U);
    EXPECT_TRUE(result.report.minimum);
    const Map<D> map = change_frame(result.maps[0], pose_anchor<D>(world_key()));
    const Consistency c = consistency(map, known);
    nees += c.nees;
    dimension += c.dimension;
  }
  // Chi-squared with `dimension` degrees of freedom: within four standard deviations.
  EXPECT_NEAR(nees, dimension, 4.0 * std::sqrt(2.0 * dimension));
}

TYPED_TEST(WorldFrame, JoinsDrivesThatShareNothingElse) {
  constexpr int D = TypeParam::value;
  Dice dice(6);
  MeasurementGraphBuilder<D> builder;
  ValuesBuilder<D> truth;
  for (std::uint32_t session = 0; session < 2; ++session) {
    Rigid<D> pose = random_pose<D>(dice, 20.0);
    for (std::uint64_t k = 0; k < 8; ++k) {
      const Rigid<D> step = random_pose<D>(dice, 1.0, 0.7);
      truth.template add<PoseType<D>>(pose_key(k, session), pose);
      const auto fix = position_fix<D>(pose.t, dice.definite(D));
      builder.template add<PoseType<D>>(world_key(), pose_key(k, session), fix.z, fix.information);
      if (k < 7)
        builder.template add<PoseType<D>>(pose_key(k, session), pose_key(k + 1, session), step,
                                          dice.definite(kGauge<D>));
      pose = pose * step;
    }
  }
  truth.template add<PoseType<D>>(world_key(), Rigid<D>());
  const JoinResult<D> result = join_all(std::move(builder).build());
  ASSERT_EQ(result.maps.size(), 1U);
  const Map<D> map = change_frame(result.maps[0], pose_anchor<D>(world_key()));
  EXPECT_LT(distance(map.values, std::move(truth).build()), 1e-7);
}

TYPED_TEST(WorldFrame, TooFewPositionsLeaveTheMapWhereItIsAndSaySo) {
  constexpr int D = TypeParam::value;
  Dice dice(3);
  Case<D> world(dice, 0.0);
  for (int k = 0; k < D - 1; ++k) world.add_fix(dice, static_cast<std::uint64_t>(5 * k), 0.0);
  const JoinResult<D> result = join_all(std::move(world.builder).build());
  ASSERT_EQ(result.maps.size(), 1U);
  EXPECT_FALSE(result.maps[0].values.contains(world_key()));
  ASSERT_EQ(result.report.notes.size(), 1U);
  EXPECT_THAT(result.report.notes[0], HasSubstr("from the world"));
  EXPECT_THAT(result.report.notes[0], HasSubstr("left out"));
}

TYPED_TEST(WorldFrame, PositionsHaveNoSummary) {
  constexpr int D = TypeParam::value;
  Dice dice(3);
  Case<D> world(dice, 0.0);
  for (const std::uint64_t pose : {0U, 9U, 20U}) world.add_fix(dice, pose, 0.0);
  JoinOptions options;
  options.mode = Mode::kSummary;
  const auto graph = std::move(world.builder).build();
  expect_input_error([&] { join_all(graph, options); },
                     {"3 measurements from the world", "observe"});
}

TYPED_TEST(WorldFrame, PositionInformationIsAlongTheAxesOfTheWorld) {
  constexpr int D = TypeParam::value;
  Dice dice(8);
  const Mat<D, D> information = dice.definite(D);
  const Vec<D> measured = random_point<D>(dice);
  const auto fix = position_fix<D>(measured, information);
  MeasurementGraphBuilder<D> builder;
  builder.template add<PoseType<D>>(world_key(), pose_key(1), fix.z, fix.information);
  const auto graph = std::move(builder).build();
  for (int round = 0; round < 10; ++round) {
    const Rigid<D> T = random_pose<D>(dice), pose = random_pose<D>(dice);
    ValuesBuilder<D> values;
    values.template add<PoseType<D>>(world_key(), T);
    values.template add<PoseType<D>>(pose_key(1), T * pose);
    const Vec<D> e = pose.t - measured;
    const double expected = e.dot(information * e);
    EXPECT_NEAR(chi2(std::move(values).build(), graph), expected, 1e-9 * expected);
  }
}

TEST(WorldAndGravity, OnePositionLineAndTheDirectionOfGravityPlaceTheMap) {
  // Positions on a straight line leave a turn about it open; which way is down does not.
  Dice dice(4);
  const Rigid3 start = random_pose<3>(dice, 50.0);
  MeasurementGraphBuilder<3> builder;
  ValuesBuilder<3> truth;
  truth.add<Pose3>(world_key(), Rigid3());
  const Vec<3> down(0.0, 0.0, -1.0);
  truth.add<own::Direction>(own::up_key(0), down);
  builder.add<own::Direction>(world_key(), own::up_key(0), down, 1e6 * Mat<2, 2>::Identity());
  Rigid3 pose = start;
  Rigid3 step;
  step.t(0) = 2.0;
  for (std::uint64_t k = 0; k < 10; ++k) {
    truth.add<Pose3>(pose_key(k), pose);
    const auto fix = position_fix<3>(pose.t, Mat<3, 3>::Identity());
    builder.add<Pose3>(world_key(), pose_key(k), fix.z, fix.information);
    builder.add<own::Direction>(pose_key(k), own::up_key(0), pose.R.transpose() * down,
                                1e4 * Mat<2, 2>::Identity());
    if (k < 9)
      builder.add<Pose3>(pose_key(k), pose_key(k + 1), step, 100.0 * Mat<6, 6>::Identity());
    pose = pose * step;
  }
  const JoinResult<3> result = join_all(std::move(builder).build());
  ASSERT_EQ(result.maps.size(), 1U);
  const Map<3> map = change_frame(result.maps[0], pose_anchor<3>(world_key()));
  EXPECT_LT(distance(map.values, std::move(truth).build()), 1e-7);
}

TEST(WorldKey, IsPrintedAndReadAsWorld) {
  EXPECT_EQ(to_string(world_key()), "world");
  EXPECT_EQ(parse_key("world"), world_key());
  EXPECT_EQ(parse_anchor<2>("world", 3).keys.at(0), world_key()) << "whatever the session";
  EXPECT_LT(pose_key(~std::uint64_t{0}, 7), world_key()) << "no map's frame unless asked for";
}

class WorldInG2o : public ::testing::Test {
 protected:
  G2oGraph read(const std::string& text, const G2oOptions& options = {}) const {
    write_text(path_, text);
    return read_g2o(path_, options);
  }
  TemporaryDirectory folder_;
  std::string path_ = folder_.file("priors.g2o");
};

TEST_F(WorldInG2o, PriorsAreMeasurementsFromTheWorld) {
  const auto graph = read(
                         "EDGE_SE2 0 1 1 0 0.5 1 0 0 1 0 1\n"
                         "EDGE_PRIOR_SE2 0 3 4 0.25 5 1 2 6 3 7\n"
                         "EDGE_SE2_PRIOR 1 3 4 0.25 5 1 2 6 3 7\n"
                         "EDGE_PRIOR_SE2_XY 1 8 9 2 0.5 3\n")
                         .as<2>();
  const auto& edges = graph.relative.at(0);
  ASSERT_EQ(edges.size(), 4U);
  const int world = graph.variables.require(world_key(), "test");
  Mat<3, 3> full;
  full << 5, 1, 2, 1, 6, 3, 2, 3, 7;
  Mat<3, 3> position;
  position << 2, 0.5, 0, 0.5, 3, 0, 0, 0, 0;
  int priors = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    if (edges.from[k] != world) continue;
    const auto& z = reinterpret_cast<const Rigid2*>(edges.z.data())[k];
    const bool whole = z.t(0) == 3.0;
    EXPECT_EQ(z.t, whole ? Vec<2>(3, 4) : Vec<2>(8, 9));
    EXPECT_DOUBLE_EQ(heading(z), whole ? 0.25 : 0.0);
    EXPECT_EQ((Mat<3, 3>(Eigen::Map<const Mat<3, 3>>(edges.info.data() + 9 * k))),
              whole ? full : position);
    ++priors;
  }
  EXPECT_EQ(priors, 3);
}

TEST_F(WorldInG2o, PriorsComeBack) {
  const std::string planar =
      "EDGE_SE2 0 1 1 0 0.5 1 0 0 1 0 1\nEDGE_PRIOR_SE2 0 3 4 0.25 5 1 2 6 3 7\n"
      "EDGE_PRIOR_SE2_XY 1 8 9 2 0.5 3\n";
  const auto first = read(planar).as<2>();
  ValuesBuilder<2> values;
  values.add<Pose2>(world_key(), rigid2(1, 2, 3));
  values.add<Pose2>(pose_key(0), Rigid2());
  values.add<Pose2>(pose_key(1), rigid2(1, 0, 0.5));
  const Values<2> known = std::move(values).build();
  write_g2o(path_, first, &known);
  EXPECT_THAT(read_text(path_), HasSubstr("# the world is at 1 2 3\n"));
  const auto again = read_g2o(path_).as<2>();
  EXPECT_EQ(again.variables, first.variables);
  EXPECT_EQ(again.relative.at(0).z, first.relative.at(0).z);
  EXPECT_EQ(again.relative.at(0).info, first.relative.at(0).info);
}

TEST_F(WorldInG2o, ThePoseOfASensorIsMovedToThePose) {
  // The information of a sensor's pose, at values where both residuals are small.
  Dice dice(5);
  const Rigid3 sensor = random_pose<3>(dice, 2.0), pose = random_pose<3>(dice);
  const Rigid3 measured = noisy<Pose3>(dice, pose * sensor, 1e-5);
  const Mat<6, 6> information = dice.definite(6);
  const auto text = [](const Rigid3& T) {
    const Eigen::Quaterniond q(Eigen::Matrix3d(T.R));
    return fmt::format(" {} {} {} {} {} {} {}", T.t(0), T.t(1), T.t(2), q.x(), q.y(), q.z(), q.w());
  };
  std::string line = "EDGE_SE3_PRIOR 4 7" + text(measured);
  for (int i = 0; i < 6; ++i) {
    for (int j = i; j < 6; ++j) line += fmt::format(" {}", information(i, j));
  }
  const auto graph = read("PARAMS_SE3OFFSET 7" + text(sensor) + "\n" + line + "\n").as<3>();
  ValuesBuilder<3> values;
  values.add<Pose3>(world_key(), Rigid3());
  values.add<Pose3>(pose_key(4), pose);
  const Vec<6> e = Pose3::local<double>(measured, pose * sensor);
  const double expected = e.dot(information * e);
  EXPECT_NEAR(chi2(std::move(values).build(), graph), expected, 1e-3 * expected);
}

}  // namespace
}  // namespace mapjoin
