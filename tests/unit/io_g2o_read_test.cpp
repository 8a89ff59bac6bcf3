#include <fmt/format.h>
#include <gtest/gtest.h>

#include "mapjoin/io/g2o.h"
#include "tests/support/io.h"

namespace mapjoin {
namespace {

using test::expect_input_error;

const std::string kEdge = "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n";
const std::string kEdge3 =
    "EDGE_SE3:QUAT 0 1 1 0 0 0 0 0 1 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n";

class G2oRead : public testing::Test {
 protected:
  std::string file(const std::string& text, const std::string& name = "graph.g2o") {
    const std::string path = folder_.file(name);
    test::write_text(path, text);
    return path;
  }
  G2oGraph read(const std::string& text, const G2oOptions& options = {}) {
    return read_g2o(file(text), options);
  }

  /// Expects that the text is refused at the given line, with all the parts in the message.
  void expect_refused(const std::string& text, int line, std::vector<std::string> parts,
                      const G2oOptions& options = {}) {
    SCOPED_TRACE(text);
    parts.push_back(fmt::format("graph.g2o:{}: ", line));
    expect_input_error([&] { read(text, options); }, parts);
  }

  test::TemporaryDirectory folder_;
};

TEST_F(G2oRead, PlanarGraph) {
  const G2oGraph g = read(
      "# comment\n\nVERTEX_SE2 3 9 9 9\r\nEDGE_SE2 3 5 1 2 0.5 1 2 3 40 5 60\r\n"
      "  EDGE_SE2_XY 5 7 -1 +2.5 4 1 2  \nFIX 3\n");
  EXPECT_EQ(g.dimension, 2);
  EXPECT_EQ(g.fixed, pose_key(3));
  EXPECT_EQ(g.counts.poses, 2);
  EXPECT_EQ(g.counts.points, 1);
  EXPECT_EQ(g.counts.edges.at("EDGE_SE2"), 1);
  EXPECT_EQ(g.counts.edges.at("EDGE_SE2_XY"), 1);
  EXPECT_EQ(g.counts.isolated_vertices, 0);
  const auto& graph = g.as<2>();
  ASSERT_EQ(graph.relative.size(), 2U);
  const auto& points = graph.relative[0];
  const auto& poses = graph.relative[1];
  EXPECT_EQ(graph.variables.key(poses.from[0]), pose_key(3));
  EXPECT_EQ(graph.variables.key(poses.to[0]), pose_key(5));
  const Rigid2 z = rigid2(1, 2, 0.5);
  EXPECT_EQ(reinterpret_cast<const Rigid2*>(poses.z.data())->R, z.R);
  EXPECT_EQ(reinterpret_cast<const Rigid2*>(poses.z.data())->t, z.t);
  EXPECT_EQ(poses.info, (std::vector<double>{1, 2, 3, 2, 40, 5, 3, 5, 60}));
  EXPECT_EQ(graph.variables.key(points.to[0]), point_key(7));
  EXPECT_EQ(points.z, (std::vector<double>{-1, 2.5}));
  EXPECT_EQ(points.info, (std::vector<double>{4, 1, 1, 2}));
}

TEST_F(G2oRead, InformationIsTakenPerRadianUnlessToldOtherwise) {
  const std::string text =
      "EDGE_SE3:QUAT 0 1 0 0 0 0 0 0 2 1 0 0 .2 0 0 1 0 0 0 0 1 0 0 0 4 0 0 4 0 4\n";
  const G2oGraph as_is = read(text);
  const Eigen::Map<const Mat<6, 6>> plain(as_is.as<3>().relative[0].info.data());
  EXPECT_EQ(plain(3, 3), 4.0);
  EXPECT_EQ(plain(0, 3), 0.2);
  // In g2o's own meaning r = (t, q_v) with q_v = phi / 2 to first order.
  G2oOptions options;
  options.quaternion_information = true;
  const G2oGraph scaled = read(text, options);
  const Eigen::Map<const Mat<6, 6>> info(scaled.as<3>().relative[0].info.data());
  EXPECT_EQ(info(0, 0), 1.0);
  EXPECT_EQ(info(3, 3), 1.0);
  EXPECT_EQ(info(0, 3), 0.1);
  EXPECT_EQ(info(3, 0), 0.1);
}

TEST_F(G2oRead, SensorOffsetsAreApplied) {
  // The sensor stands at (1, 2, 3), turned by 90 degrees about z: its x axis is the body's y axis.
  const G2oGraph g = read("PARAMS_SE3OFFSET 4 1 2 3 0 0 1 1\n" + kEdge3 +
                          "EDGE_SE3_TRACKXYZ 0 9 4 10 0 0 100 0 0 1 0 2\n");
  const auto& points = g.as<3>().relative[0];
  ASSERT_EQ(points.kind->tag, Tag("point"));
  EXPECT_NEAR(points.z[0], 1.0, 1e-12);
  EXPECT_NEAR(points.z[1], 12.0, 1e-12);
  EXPECT_NEAR(points.z[2], 3.0, 1e-12);
  const Eigen::Map<const Mat<3, 3>> info(points.info.data());
  EXPECT_NEAR(info(0, 0), 1.0, 1e-10);
  EXPECT_NEAR(info(1, 1), 100.0, 1e-10);
  EXPECT_NEAR(info(2, 2), 2.0, 1e-10);
}

TEST_F(G2oRead, PointsWithoutParametersAreSeenFromThePose) {
  const G2oGraph g = read(kEdge3 + "EDGE_SE3_TRACKXYZ 0 9 10 0 0 100 0 0 1 0 2\n");
  EXPECT_EQ(g.counts.points, 1);
}

TEST_F(G2oRead, SessionsComeFromOptionsOrIds) {
  G2oOptions options;
  options.session = 4;
  const G2oGraph g = read("EDGE_SE2 1 2/1 1 0 0 1 0 0 1 0 1\n", options);
  EXPECT_EQ(g.as<2>().variables.key(0), pose_key(1, 2));
  EXPECT_EQ(g.as<2>().variables.key(1), pose_key(1, 4));
}

TEST_F(G2oRead, SeveralFilesBecomeOneGraph) {
  const std::vector<G2oSource> files{
      {file(kEdge + "FIX 0\n", "a.g2o"), 1},
      {file(kEdge + "FIX 1\n", "b.g2o"), 2},
      {file("EDGE_SE2 1/0 2/0 1 0 0 1 0 0 1 0 1\n", "links.g2o"), 0}};
  const G2oGraph g = read_g2o(files);
  EXPECT_EQ(g.counts.poses, 4);
  EXPECT_EQ(g.counts.edges.at("EDGE_SE2"), 3);
  EXPECT_EQ(g.fixed, pose_key(0, 1));
}

TEST_F(G2oRead, RepeatedEdgesAreSeveralMeasurements) {
  EXPECT_EQ(read(kEdge + kEdge).as<2>().size(), 2U);
}

TEST_F(G2oRead, TheGraphTakesNoMoreMemoryThanItsMeasurements) {
  std::string text = "VERTEX_SE2 0 0 0 0\nEDGE_SE2_XY 0 1000 1 2 1 0 1\n";
  for (int k = 0; k < 99; ++k) text += fmt::format("EDGE_SE2 {} {} 1 0 0 1 0 0 1 0 1\n", k, k + 1);
  const G2oGraph g = read(text);
  ASSERT_EQ(g.as<2>().relative.size(), 2U);
  for (const auto& column : g.as<2>().relative) {
    EXPECT_EQ(column.z.capacity(), column.z.size());
    EXPECT_EQ(column.info.capacity(), column.info.size());
  }
}

TEST_F(G2oRead, IsolatedVerticesAreCountedAndLeftOut) {
  const G2oGraph g = read(kEdge + "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 8 0 0 0\nVERTEX_XY 9 0 0\n");
  EXPECT_EQ(g.counts.isolated_vertices, 2);
  EXPECT_EQ(g.counts.poses, 2);
}

TEST_F(G2oRead, TinyNumbersAreZeroOrDenormal) {
  EXPECT_EQ(read("EDGE_SE2 0 1 1e-400 1e-310 0 1 0 0 1 0 1\n").counts.poses, 2);
}

TEST_F(G2oRead, TruncatedLines) {
  expect_refused(
      "EDGE_SE2 0 1 1 0 0 1 0 0 1 0\n", 1,
      {"the line ends where the information matrix was expected", "'EDGE_SE2 0 1 1 0 0 1 0 0 1 0'",
       "complete the line", "expected: EDGE_SE2 i j x y theta I11"});
  expect_refused(kEdge + "EDGE_SE2 0\n", 2, {"id '' is missing"});
  expect_refused(kEdge + "VERTEX_SE2 0 1 2", 2,
                 {"the line ends where theta was expected", "VERTEX_SE2 id x y theta"});
  expect_refused("EDGE_SE3:QUAT 0 1 1 0 0 0 0 0\n", 1, {"where qw was expected"});
  expect_refused("EDGE_SE2_XY 0 1 1 0 1 0\n", 1, {"where the information matrix was expected"});
  // A missing last number must not make the parameter's number a coordinate.
  expect_refused("PARAMS_SE3OFFSET 0 0 0 0 0 0 0 1\nEDGE_SE3_TRACKXYZ 0 9 0 1 2 3 1 0 0 1 0\n", 2,
                 {"where the information matrix was expected"});
}

TEST_F(G2oRead, TrailingGarbage) {
  expect_refused("EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1 7\n", 1,
                 {"goes on with '7' after the information matrix", "remove what is too much"});
  expect_refused(kEdge + "VERTEX_XY 5 1 2 # here\n", 2, {"goes on with '# here' after the point"});
}

TEST_F(G2oRead, WordsThatAreNoNumbers) {
  expect_refused("EDGE_SE2 0 1 one 0 0 1 0 0 1 0 1\n", 1,
                 {"x is 'one', but a number was expected"});
  expect_refused("EDGE_SE2 0 1 1 0 0x10 1 0 0 1 0 1\n", 1,
                 {"theta is '0x10', but a number was expected"});
  expect_refused("EDGE_SE2 0 1 1 0,5 0 1 0 0 1 0 1\n", 1,
                 {"y is '0,5', but a number was expected"});
}

TEST_F(G2oRead, NumbersThatAreNotFinite) {
  for (const std::string bad : {"nan", "inf", "-inf", "1e999"}) {
    expect_refused("EDGE_SE2 0 1 " + bad + " 0 0 1 0 0 1 0 1\n", 1,
                   {"x is '" + bad + "', but a finite number was expected"});
    expect_refused("EDGE_SE2 0 1 1 0 0 1 0 0 1 0 " + bad + "\n", 1,
                   {"the information matrix is '" + bad + "'"});
  }
}

TEST_F(G2oRead, QuaternionsOfLengthZero) {
  expect_refused("EDGE_SE3:QUAT 0 1 1 0 0 0 0 0 0 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n", 1,
                 {"the quaternion qx qy qz qw has length zero", "0 0 0 1 for no rotation"});
}

TEST_F(G2oRead, Ids) {
  expect_refused("EDGE_SE2 -1 1 1 0 0 1 0 0 1 0 1\n", 1,
                 {"vertex id '-1' is negative", "whole numbers from 0"});
  expect_refused("EDGE_SE2 0 1.5 1 0 0 1 0 0 1 0 1\n", 1, {"vertex id '1.5' is not an id"});
  expect_refused("EDGE_SE2 0 99999999999999999999 1 0 0 1 0 0 1 0 1\n", 1, {"is out of range"});
  expect_refused("EDGE_SE2 0 9999999999999999999 1 0 0 1 0 0 1 0 1\n", 1, {"is out of range"});
  expect_refused("EDGE_SE2 0 4294967296/1 1 0 0 1 0 0 1 0 1\n", 1,
                 {"session that is out of range"});
  expect_refused("EDGE_SE2 0 1/ 1 0 0 1 0 0 1 0 1\n", 1, {"'1/' is not an id"});
}

TEST_F(G2oRead, SelfLoops) {
  expect_refused(kEdge + "EDGE_SE2 4 4 1 0 0 1 0 0 1 0 1\n", 2,
                 {"from vertex 4 to itself", "remove it"});
}

TEST_F(G2oRead, AnIdThatIsPoseAndPoint) {
  expect_refused(kEdge + "\nEDGE_SE2_XY 0 1 1 0 1 0 1\n", 3,
                 {"vertex 1 is a point here, but a pose at", "graph.g2o:1;", "renumber"});
}

TEST_F(G2oRead, VertexTagsThatContradictTheEdges) {
  expect_refused(kEdge + "VERTEX_XY 1 0 0\n", 2,
                 {"vertex 1 is a point here, but the edges use it as a pose"});
  expect_refused(kEdge + "EDGE_SE2_XY 0 7 1 0 1 0 1\nVERTEX_SE2 7 0 0 0\n", 3,
                 {"vertex 7 is a pose here, but the edges use it as a point"});
}

TEST_F(G2oRead, ConflictingVertices) {
  expect_refused(
      kEdge + "VERTEX_SE2 1 0 0 0\nVERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 0 0 1\n", 4,
      {"conflicting vertices: 1 stands here with another value", "graph.g2o:2;", "keep one"});
  expect_refused(kEdge + "VERTEX_SE2 1 0 0 0\nVERTEX_XY 1 0 0\n", 3,
                 {"conflicting vertices: 1 stands here with another type"});
  EXPECT_EQ(read(kEdge + "VERTEX_SE2 1 1 2 3\nVERTEX_SE2 1 1 2 3\n").counts.isolated_vertices, 0);
}

TEST_F(G2oRead, MixedDimensions) {
  expect_refused(kEdge + kEdge3, 2,
                 {"EDGE_SE3:QUAT is 3D, but EDGE_SE2 at", "graph.g2o:1 is 2D", "split the data"});
  expect_refused("VERTEX_XY 0 0 0\n" + kEdge3, 2, {"is 3D, but VERTEX_XY at"});
}

TEST_F(G2oRead, UnknownRecordsAndPriors) {
  const std::string unknown = kEdge + "EDGE_BEARING_SE2_XY 0 1 1 1\n";
  const std::string prior = kEdge + "EDGE_SWITCH_PRIOR 0 1 1 1\n";
  expect_refused(unknown, 2, {"unknown record EDGE_BEARING_SE2_XY", "--skip-unknown"});
  expect_refused(prior, 2,
                 {"EDGE_SWITCH_PRIOR is a prior", "stands for the world", "--skip-unknown"});
  G2oOptions options;
  options.skip_unknown = true;
  EXPECT_EQ(read(unknown + "EDGE_BEARING_SE2_XY 0 1 1 1\n", options)
                .counts.skipped.at("EDGE_BEARING_SE2_XY"),
            2);
  EXPECT_EQ(read(prior, options).counts.skipped.at("EDGE_SWITCH_PRIOR"), 1);
}

TEST_F(G2oRead, SeveralFixedVertices) {
  expect_refused(kEdge + "FIX 0\nFIX 1\n", 3,
                 {"a second vertex is fixed (the first is 0 at", "keep one FIX"});
  EXPECT_EQ(read(kEdge + "FIX 1\nFIX 1\n").fixed, pose_key(1));
  G2oOptions options;
  options.skip_unknown = true;
  const G2oGraph g = read(kEdge + "FIX 1 0\n", options);
  EXPECT_EQ(g.fixed, pose_key(1));
  EXPECT_EQ(g.counts.skipped.at("FIX"), 1);
}

TEST_F(G2oRead, FixedVerticesThatAreNoPoses) {
  expect_refused(kEdge + "FIX 7\n", 2,
                 {"FIX names vertex 7, which is not a pose of any measurement"});
  expect_refused(kEdge + "EDGE_SE2_XY 0 7 1 0 1 0 1\nFIX 7\n", 3, {"FIX names vertex 7"});
}

TEST_F(G2oRead, UnknownParameters) {
  expect_refused(kEdge3 + "EDGE_SE3_TRACKXYZ 0 9 4 10 0 0 100 0 0 1 0 2\n", 2,
                 {"parameter 4 is not given above", "PARAMS_SE3OFFSET 4"});
  expect_refused("PARAMS_SE3OFFSET 4 1 2 3 0 0 0 1\nPARAMS_SE3OFFSET 4 1 2 3 0 0 0 1\n", 2,
                 {"parameter 4 is given twice"});
}

TEST_F(G2oRead, FilesWithoutMeasurements) {
  for (const std::string text : {"", "# nothing\n", "VERTEX_SE2 0 0 0 0\n"}) {
    expect_input_error([&] { read(text); },
                       {"graph.g2o: there is no measurement in this file", "at least one EDGE_"});
  }
}

TEST_F(G2oRead, IndefiniteInformationFollowsThePolicy) {
  const std::string text =
      kEdge + "EDGE_SE2 1 2 1 0 0 1 2 0 1 0 1\nEDGE_SE2 2 3 1 0 0 1 0 0 1 0 -1\n";
  expect_refused(text, 2, {"indefinite (smallest eigenvalue -1)", "the first of 2 in this file"});
  G2oOptions options;
  options.indefinite = InformationPolicy::kClamp;
  EXPECT_EQ(read(text, options).counts.repaired, 2);
  EXPECT_EQ(read("EDGE_SE2 1 2 1 0 0 0 0 0 0 0 0\n").counts.repaired, 0);
}

TEST_F(G2oRead, FilesThatCannotBeRead) {
  const std::string missing = folder_.file("missing.g2o");
  EXPECT_THAT(test::message_of<FileError>([&] { read_g2o(missing); }),
              testing::HasSubstr("cannot read '" + missing));
  EXPECT_THAT(test::message_of<FileError>([&] { read_g2o(folder_.path()); }),
              testing::HasSubstr("it is a directory"));
}

TEST_F(G2oRead, ValuesAreVertices) {
  G2oOptions options;
  options.feature_offset = 100;
  const auto any =
      read_g2o_values(file(kEdge + "VERTEX_XY 107 3 4\nVERTEX_SE2 7 1 2 0.5\n"), options);
  const auto& values = std::get<Values<2>>(any);
  EXPECT_EQ(values.size(), 2);
  EXPECT_EQ(values.point(point_key(7)), Vec<2>(3, 4));
  EXPECT_EQ(heading(values.pose(pose_key(7))), 0.5);
}

TEST_F(G2oRead, ValuesAreCheckedToo) {
  const auto refused = [&](const std::string& text, const std::vector<std::string>& parts,
                           const G2oOptions& options = {}) {
    expect_input_error([&] { read_g2o_values(file(text), options); }, parts);
  };
  refused("VERTEX_SE2 1 0 0 0\nVERTEX_SE2 1 0 0 1\n", {"graph.g2o:2: conflicting vertices"});
  refused("VERTEX_SE2 1 0 0\n", {"graph.g2o:1: the line ends where theta was expected"});
  refused("VERTEX_SE2 1 0 0 0\nVERTEX_TRACKXYZ 2 0 0 0\n", {"graph.g2o:2: VERTEX_TRACKXYZ is 3D"});
  refused("VERTEX_CAM 1 0 0 0\n", {"graph.g2o:1: unknown record VERTEX_CAM"});
  refused(kEdge, {"graph.g2o: there is no vertex"});
  G2oOptions options;
  options.feature_offset = 100;
  refused("VERTEX_XY 7 0 0\n", {"graph.g2o:1: point 7 has an id below the feature offset 100"},
          options);
}

}  // namespace
}  // namespace mapjoin
