#include <gtest/gtest.h>

#include <cmath>

#include "mapjoin/frames/anchors.h"
#include "mapjoin/graph/map.h"
#include "mapjoin/io/g2o.h"
#include "tests/support/io.h"

namespace mapjoin {
namespace {

using test::expect_input_error;
using testing::HasSubstr;

class G2oWrite : public testing::Test {
 protected:
  std::string text() const { return test::read_text(path_); }

  test::TemporaryDirectory folder_;
  std::string path_ = folder_.file("out.g2o");
};

Rigid3 some_pose3(double a) {
  return rigid3({a, -1.0 / 3.0, 1e-17}, Eigen::Quaterniond(-0.3, 0.1 * a, 0.2, 0.7));
}

Values<3> values3() {
  ValuesBuilder<3> builder;
  builder.add<Pose3>(pose_key(0), some_pose3(1.0));
  builder.add<Pose3>(pose_key(8), some_pose3(M_PI));
  builder.add<Point3>(point_key(20), {0.1, 1e300, -5e-324});
  return std::move(builder).build();
}

TEST_F(G2oWrite, PlanarValuesComeBack) {
  ValuesBuilder<2> builder;
  builder.add<Pose2>(pose_key(0), rigid2(1.0 / 3.0, -2e-9, 3.1));
  builder.add<Point2>(point_key(20), {0.1, 1e300});
  const Values<2> values = std::move(builder).build();
  write_g2o(path_, values);
  const auto back = std::get<Values<2>>(read_g2o_values(path_));
  EXPECT_EQ(back.variables(), values.variables());
  EXPECT_EQ(back.pose(pose_key(0)).t, values.pose(pose_key(0)).t);
  EXPECT_LT((back.pose(pose_key(0)).R - values.pose(pose_key(0)).R).norm(), 1e-15);
  EXPECT_EQ(back.point(point_key(20)), values.point(point_key(20)));
}

TEST_F(G2oWrite, SpatialValuesComeBack) {
  const Values<3> values = values3();
  write_g2o(path_, values);
  const auto back = std::get<Values<3>>(read_g2o_values(path_));
  EXPECT_EQ(back.variables(), values.variables());
  for (const Key& key : {pose_key(0), pose_key(8)}) {
    EXPECT_EQ(back.pose(key).t, values.pose(key).t);
    EXPECT_LT((back.pose(key).R - values.pose(key).R).norm(), 1e-14);
  }
  EXPECT_EQ(back.point(point_key(20)), values.point(point_key(20)));
}

TEST_F(G2oWrite, QuaternionsAreNormalisedWithPositiveW) {
  write_g2o(path_, values3());
  std::istringstream lines(text());
  std::string tag;
  double id = 0, x = 0, y = 0, z = 0, qx = 0, qy = 0, qz = 0, qw = 0;
  while (lines >> tag && tag == "VERTEX_SE3:QUAT") {
    lines >> id >> x >> y >> z >> qx >> qy >> qz >> qw;
    EXPECT_GE(qw, 0.0);
    EXPECT_NEAR(qx * qx + qy * qy + qz * qz + qw * qw, 1.0, 1e-15);
  }
}

template <int D>
MeasurementGraph<D> small_graph() {
  MeasurementGraphBuilder<D> builder;
  Mat<kGauge<D>, kGauge<D>> info = Mat<kGauge<D>, kGauge<D>>::Identity();
  info(0, 1) = info(1, 0) = 0.25;
  info(0, kGauge<D> - 1) = info(kGauge<D> - 1, 0) = 0.1;
  Rigid<D> z;
  z.t(0) = 1.0 / 3.0;
  builder.template add<PoseType<D>>(pose_key(0), pose_key(1), z, info);
  Mat<D, D> point_info = Mat<D, D>::Identity();
  point_info(0, 1) = point_info(1, 0) = 1.0 / 7.0;
  builder.template add<PointType<D>>(pose_key(0), point_key(9), Vec<D>::Constant(0.1), point_info);
  return std::move(builder).build();
}

template <int D>
void expect_same_measurements(const MeasurementGraph<D>& a, const MeasurementGraph<D>& b) {
  EXPECT_EQ(a.variables, b.variables);
  ASSERT_EQ(a.relative.size(), b.relative.size());
  for (std::size_t c = 0; c < a.relative.size(); ++c) {
    EXPECT_EQ(a.relative[c].from, b.relative[c].from);
    EXPECT_EQ(a.relative[c].to, b.relative[c].to);
    EXPECT_EQ(a.relative[c].z, b.relative[c].z);
    EXPECT_EQ(a.relative[c].info, b.relative[c].info);
  }
}

TEST_F(G2oWrite, MeasurementsComeBack) {
  write_g2o(path_, small_graph<2>());
  expect_same_measurements(read_g2o(path_).as<2>(), small_graph<2>());
  write_g2o(path_, small_graph<3>());
  expect_same_measurements(read_g2o(path_).as<3>(), small_graph<3>());
  EXPECT_THAT(text(), HasSubstr("PARAMS_SE3OFFSET 0 0 0 0 0 0 0 1\n"));
}

TEST_F(G2oWrite, QuaternionInformationComesBack) {
  G2oWriteOptions out;
  out.quaternion_information = true;
  write_g2o(path_, small_graph<3>(), nullptr, out);
  G2oOptions in;
  in.quaternion_information = true;
  expect_same_measurements(read_g2o(path_, in).as<3>(), small_graph<3>());
}

TEST_F(G2oWrite, VerticesFixAndCommentsGoAlong) {
  const Values<3> values = values3();
  G2oWriteOptions options;
  options.comment = "first\nsecond";
  options.fixed = pose_key(0);
  write_g2o(path_, small_graph<3>(), &values, options);
  EXPECT_TRUE(text().starts_with("# first\n# second\nPARAMS"));
  EXPECT_EQ(read_g2o(path_).fixed, pose_key(0));
  EXPECT_EQ(std::get<Values<3>>(read_g2o_values(path_)).size(), 3);
  options.fixed = pose_key(77);
  expect_input_error([&] { write_g2o(path_, values, options); },
                     {"FIX pose:77", "no such variable"});
}

Values<2> poses_and_points(std::uint64_t pose, std::uint64_t point, std::uint32_t pose_session,
                           std::uint32_t point_session) {
  ValuesBuilder<2> builder;
  builder.add<Pose2>(pose_key(pose, pose_session), Rigid2::identity());
  builder.add<Point2>(point_key(point, point_session), {1, 2});
  return std::move(builder).build();
}

TEST_F(G2oWrite, PointsKeepTheirIdsWhereTheyCan) {
  write_g2o(path_, poses_and_points(3, 4, 0, 0));
  EXPECT_EQ(text(), "VERTEX_SE2 3 0 0 0\nVERTEX_XY 4 1 2\n");
}

TEST_F(G2oWrite, PointsAreOffsetWhenIdsCollideOrOnRequest) {
  const std::string moved = "# features are written with 100000 added to their ids\n";
  write_g2o(path_, poses_and_points(3, 3, 0, 0));
  EXPECT_EQ(text(), moved + "VERTEX_SE2 3 0 0 0\nVERTEX_XY 100003 1 2\n");
  G2oWriteOptions options;
  options.feature_offset = true;
  write_g2o(path_, poses_and_points(3, 4, 0, 0), options);
  EXPECT_EQ(text(), moved + "VERTEX_SE2 3 0 0 0\nVERTEX_XY 100004 1 2\n");
  write_g2o(path_, poses_and_points(100000, 4, 0, 0), options);
  EXPECT_THAT(text(), HasSubstr("with 1000000 added"));
  EXPECT_THAT(text(), HasSubstr("VERTEX_XY 1000004 "));
}

TEST_F(G2oWrite, SessionsAreWrittenIntoTheIds) {
  write_g2o(path_, poses_and_points(3, 12, 0, 2));
  EXPECT_EQ(text(), "# ids are session * 100 + id\nVERTEX_SE2 3 0 0 0\nVERTEX_XY 212 1 2\n");
  write_g2o(path_, poses_and_points(3, 12, 2, 2));
  EXPECT_EQ(text(), "VERTEX_SE2 3 0 0 0\nVERTEX_XY 12 1 2\n");
}

TEST_F(G2oWrite, IdsThatDoNotFitAreRefused) {
  expect_input_error([&] { write_g2o(path_, poses_and_points(std::uint64_t{1} << 62U, 12, 0, 2)); },
                     {"too large", "renumber"});
  EXPECT_EQ(test::files_in(folder_.path()), 0);
}

TEST_F(G2oWrite, JointInformationIsRefused) {
  LocalMap<2> map;
  map.anchor = pose_anchor<2>(pose_key(0));
  map.add_term<Pose2>(pose_key(1), Rigid2::identity());
  map.add_term<Pose2>(pose_key(2), Rigid2::identity());
  map.information =
      SymmetricBlockMatrix::from_dense({0, 3, 6}, Eigen::MatrixXd::Constant(6, 6, 1.0));
  MeasurementGraphBuilder<2> builder;
  builder.add(map);
  const MeasurementGraph<2> graph = std::move(builder).build();
  expect_input_error([&] { write_g2o(path_, graph); }, {"joint information", "native map"});
  EXPECT_EQ(test::files_in(folder_.path()), 0);
}

}  // namespace
}  // namespace mapjoin
