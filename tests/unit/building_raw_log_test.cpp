// Recordings, in memory and from files.
#include "mapjoin/building/raw_log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <limits>

#include "mapjoin/building/csv_log.h"
#include "mapjoin/evaluation/simulate.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/graph/world.h"
#include "tests/support/program.h"

namespace mapjoin {
namespace {

using ::testing::HasSubstr;

template <class Call>
std::string message_of(const Call& call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return "nothing thrown";
}

TEST(RawLog, AGraphIsARecordingAndBack) {
  SimulationOptions options = simulation_defaults(World::kLandmarks2d);
  options.poses = 50;
  const MeasurementGraph<2> graph = simulate<2>(options).graph;
  const RawLog<2> log = raw_log(graph);
  EXPECT_EQ(log.size(), graph.size());
  MeasurementGraph<2> back;
  ASSERT_TRUE(as_graph(log, back));
  EXPECT_EQ(back.variables, graph.variables);
  ASSERT_EQ(back.relative.size(), graph.relative.size());
  for (std::size_t c = 0; c < graph.relative.size(); ++c) {
    EXPECT_EQ(back.relative[c].from, graph.relative[c].from);
    EXPECT_EQ(back.relative[c].to, graph.relative[c].to);
    EXPECT_EQ(back.relative[c].z, graph.relative[c].z);
    EXPECT_EQ(back.relative[c].info, graph.relative[c].info);
  }
}

TEST(RawLog, RefusesWhatNoLocalMapCanBeBuiltFrom) {
  const Mat<2, 2> I = Mat<2, 2>::Identity();
  RawLogBuilder<2> builder;
  EXPECT_THAT(message_of([&] {
                builder.add<RangeBearing>(point_key(1), point_key(2), {1, 0}, I);
              }),
              HasSubstr("point:1 -> point:2 is not taken from a pose"));
  EXPECT_THAT(message_of([&] {
                builder.add<RelativeModel<Pose2>>(pose_key(1), pose_key(1), Rigid2(),
                                                  Mat<3, 3>::Identity());
              }),
              HasSubstr("itself"));
  EXPECT_THAT(message_of([&] {
                builder.add<RangeBearing>(pose_key(1), pose_key(2), {1, 0}, I);
              }),
              HasSubstr("pose:2"));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(message_of([&] {
                builder.add<RangeBearing>(pose_key(1), point_key(2), {nan, 0}, I);
              }),
              HasSubstr("not finite"));
  Mat<2, 2> indefinite = I;
  indefinite(1, 1) = -1.0;
  EXPECT_THAT(message_of([&] {
                builder.add<RangeBearing>(pose_key(1), point_key(2), {1, 0}, indefinite);
              }),
              HasSubstr("positive definite"));
  EXPECT_THAT(message_of([&] {
                builder.add<RangeBearing>(world_key(), point_key(2), {1, 0}, I);
              }),
              HasSubstr("world"));
  EXPECT_THROW(std::move(builder).build(), InputError);
}

class CsvLogs : public ::testing::Test {
 protected:
  std::filesystem::path folder(const std::string& controls, const std::string& observations) const {
    std::ofstream(directory_.file("controls.csv")) << controls;
    std::ofstream(directory_.file("observations.csv")) << observations;
    return directory_.path();
  }
  const std::string controls_ = "speed_mps,turnrate_radps\n1.0,0.5\n2.0,-0.5\n";
  const std::string observations_ = "step,beacon,range_m,bearing_rad\n1,7,3.0,0.1\n3,7,2.0,9.5\n";
  test::TemporaryDirectory directory_;
};

TEST_F(CsvLogs, StepsAndRowsAreWhereTheFormatSays) {
  const RawLog<2> log = read_csv_log(folder(controls_, observations_)).log;
  ASSERT_EQ(log.size(), 4U);
  ASSERT_EQ(log.columns.size(), 2U);
  const auto& odometry = log.columns[0];
  EXPECT_EQ(odometry.model->tag, Tag("velocity"));
  EXPECT_EQ(log.variables.key(odometry.from[1]), pose_key(1));
  EXPECT_EQ(log.variables.key(odometry.to[1]), pose_key(2));
  EXPECT_THAT(odometry.z, ::testing::ElementsAre(1.0, 0.5, 0.3, 2.0, -0.5, 0.3));
  const auto& sight = log.columns[1];
  EXPECT_EQ(log.variables.key(sight.from[0]), pose_key(0));
  EXPECT_EQ(log.variables.key(sight.from[1]), pose_key(2));
  EXPECT_EQ(log.variables.key(sight.to[1]), point_key(7));
  EXPECT_NEAR(sight.info[0], 100.0, 1e-9);
}

TEST_F(CsvLogs, ErrorsNameFileAndLine) {
  const auto error = [&](const std::string& controls, const std::string& observations) {
    const auto at = folder(controls, observations);
    return message_of([&] { read_csv_log(at); });
  };
  EXPECT_THAT(error("v,w\n1,2\n", observations_), HasSubstr("controls.csv:1: 'v,w'"));
  EXPECT_THAT(error(controls_ + "1.0\n", observations_), HasSubstr("controls.csv:4"));
  EXPECT_THAT(error(controls_ + "1.0,nan\n", observations_), HasSubstr("controls.csv:4"));
  EXPECT_THAT(error(controls_, observations_ + "4,7,2.0,0.5\n"), HasSubstr("observations.csv:4"));
  EXPECT_THAT(error(controls_, observations_ + "0,7,2.0,0.5\n"), HasSubstr("step 0"));
  EXPECT_THAT(error(controls_, observations_ + "1,-7,2.0,0.5\n"), HasSubstr("negative"));
  EXPECT_THAT(error(controls_, observations_ + "1,7,0,0.5\n"), HasSubstr("range"));
  EXPECT_THAT(error(controls_, observations_ + "1,7,2.0,0.5,9\n"), HasSubstr("observations.csv:4"));
}

TEST_F(CsvLogs, LeavesOutWhatIsTooNearWhenAskedAndCountsIt) {
  const auto at = folder(controls_, observations_ + "2,8,-0.01,0.5\n2,9,0.4,0.5\n");
  EXPECT_THAT(message_of([&] { read_csv_log(at); }), HasSubstr("--nearest"));
  const auto read = read_csv_log(at, {.nearest = 0.5});
  EXPECT_EQ(read.too_near, 2);
  EXPECT_EQ(read.log.size(), 4U);
}

TEST_F(CsvLogs, RefusesNoiseThatIsNone) {
  const auto at = folder(controls_, observations_);
  EXPECT_THROW(read_csv_log(at, {.sigma_sideways = 0.0}), InputError);
  EXPECT_THROW(read_csv_log(at, {.duration = -1.0}), InputError);
  EXPECT_THROW(read_csv_log(directory_.path() / "nowhere"), FileError);
}

}  // namespace
}  // namespace mapjoin
