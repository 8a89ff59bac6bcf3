#include "mapjoin/io/tum.h"

#include <gtest/gtest.h>

#include "tests/support/io.h"

namespace mapjoin {
namespace {

using test::expect_input_error;

class Tum : public testing::Test {
 protected:
  std::string text() const { return test::read_text(path_); }
  template <int D>
  void expect_refused(const std::string& content, const std::vector<std::string>& parts) {
    test::write_text(path_, content);
    expect_input_error([&] { read_tum<D>(path_); }, parts);
  }

  test::TemporaryDirectory folder_;
  std::string path_ = folder_.file("path.tum");
};

TEST_F(Tum, PlanarTrajectoriesLieInZeroAndComeBack) {
  ValuesBuilder<2> builder;
  builder.add<Pose2>(pose_key(3), rigid2(0.1, 1.0 / 3.0, 2.5));
  builder.add<Pose2>(pose_key(1), Rigid2::identity());
  builder.add<Point2>(point_key(1), {1, 2});
  const Values<2> values = std::move(builder).build();
  write_tum(path_, values);
  EXPECT_THAT(text(), testing::HasSubstr("\n1 0 0 0 0 0 0 1\n3 0.1 0.3333333333333333 0 0 0 "));
  const Values<2> back = read_tum<2>(path_);
  EXPECT_EQ(back.size(), 2);
  EXPECT_EQ(back.pose(pose_key(3)).t, values.pose(pose_key(3)).t);
  EXPECT_NEAR(heading(back.pose(pose_key(3))), 2.5, 1e-15);
}

TEST_F(Tum, SpatialTrajectoriesComeBack) {
  ValuesBuilder<3> builder;
  builder.add<Pose3>(pose_key(7, 2), rigid3({1, 2, 3}, Eigen::Quaterniond(-0.1, 0.5, 0.6, 0.7)));
  const Values<3> values = std::move(builder).build();
  write_tum(path_, values);
  const Values<3> back = read_tum<3>(path_, 2);
  EXPECT_LT((back.pose(pose_key(7, 2)).R - values.pose(pose_key(7, 2)).R).norm(), 1e-15);
}

TEST_F(Tum, SessionsAreWrittenIntoTheTimestamps) {
  ValuesBuilder<2> builder;
  builder.add<Pose2>(pose_key(12, 1), Rigid2::identity());
  builder.add<Pose2>(pose_key(3, 0), Rigid2::identity());
  write_tum(path_, std::move(builder).build());
  EXPECT_THAT(text(), testing::HasSubstr("# ids are session * 100 + id\n3 0 0"));
  EXPECT_THAT(text(), testing::HasSubstr("\n112 0 0"));
}

TEST_F(Tum, WhatIsNoTrajectoryIsRefused) {
  ValuesBuilder<2> builder;
  builder.add<Point2>(point_key(1), {1, 2});
  const Values<2> points = std::move(builder).build();
  expect_input_error([&] { write_tum(path_, points); }, {"there is no pose to write"});
  expect_refused<3>("0 0 0 0 0 0 1\n",
                    {"path.tum:1: the line ends where qw was expected", "timestamp tx ty tz"});
  expect_refused<3>("0.5 0 0 0 0 0 0 1\n", {"path.tum:1: the timestamp is not the id of a pose"});
  expect_refused<3>("0 0 0 0 0 0 0 0\n", {"path.tum:1: the quaternion"});
  expect_refused<3>("0 0 0 0 0 0 0 1\n0 0 0 0 0 0 0 1\n",
                    {"path.tum: variable pose:0 is given twice"});
  expect_refused<3>("# nothing\n", {"path.tum: there is no pose"});
  expect_refused<2>("0 0 0 0.5 0 0 0 1\n", {"path.tum:1: this pose does not lie in the plane"});
  expect_refused<2>("0 0 0 0 0.1 0 0 1\n", {"path.tum:1: this pose does not lie in the plane"});
}

}  // namespace
}  // namespace mapjoin
