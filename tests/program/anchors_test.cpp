// Frames fixed by features, as a user asks for them: --anchor points:84,85.

#include <cstdlib>

#include "tests/program/workbench.h"

namespace mapjoin::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class Anchors : public Workbench {
 protected:
  /// Ids of features that are seen in a graph file: the first, the last, and one between.
  static std::vector<std::string> features(const std::string& graph) {
    std::set<long> ids;
    std::istringstream lines(read_text(graph));
    for (std::string line; std::getline(lines, line);) {
      std::istringstream words(line);
      std::string tag;
      long from = 0, to = 0;
      words >> tag >> from >> to;
      if (tag == "EDGE_SE2_XY" || tag == "EDGE_SE3_TRACKXYZ") ids.insert(to);
    }
    EXPECT_GE(ids.size(), 3U);
    auto middle = ids.begin();
    std::advance(middle, ids.size() / 2);
    return {std::to_string(*ids.begin()), std::to_string(*ids.rbegin()), std::to_string(*middle)};
  }
  /// The numbers of a vertex in a g2o text.
  static std::vector<double> vertex(const std::string& text, const std::string& head) {
    const std::size_t at = text.find("\n" + head + " ");
    if (at == std::string::npos) {
      ADD_FAILURE() << "no " << head << " in " << text.substr(0, 500);
      return std::vector<double>(3, NAN);
    }
    std::istringstream numbers(text.substr(at + head.size() + 2, text.find('\n', at + 1) - at));
    std::vector<double> out;
    for (double v = 0.0; out.size() < 3 && numbers >> v;) out.push_back(v);
    out.resize(3, 0.0);
    return out;
  }
};

TEST_F(Anchors, ReframeGoesToPointsAndBackInThePlane) {
  const std::string world = simulate("landmarks2d", 150);
  const auto ids = features(world);
  const std::string anchor = "points:" + ids[0] + "," + ids[1];
  run({"solve", world, "--output", file("a.map")});
  EXPECT_THAT(run({"reframe", file("a.map"), "--anchor", anchor, "--output", file("p.map")}),
              HasSubstr("from the frame of pose:0 to that of " + anchor));
  EXPECT_THAT(run({"info", file("p.map")}), HasSubstr("frame         " + anchor));
  run({"reframe", file("a.map"), "--anchor", anchor, "--output", file("p.g2o")});
  const std::string text = read_text(file("p.g2o"));
  EXPECT_THAT(text, AllOf(HasSubstr("# mapjoin: in the frame of " + anchor + "\n"),
                          HasSubstr("point:" + ids[0] + " is the origin"), Not(HasSubstr("FIX"))));
  EXPECT_EQ(vertex(text, "VERTEX_XY " + ids[0]), (std::vector<double>{0.0, 0.0, 0.0}));
  EXPECT_GT(vertex(text, "VERTEX_XY " + ids[1])[0], 0.0);
  EXPECT_EQ(vertex(text, "VERTEX_XY " + ids[1])[1], 0.0);

  run({"reframe", file("p.map"), "--anchor", "pose:0", "--output", file("back.map")});
  const std::string figures =
      run({"evaluate", file("back.map"), "--graph", world, "--reference", file("a.map")});
  EXPECT_LT(figure(figures, "pose_rmse"), 1e-9);
  EXPECT_LT(figure(figures, "feature_rmse"), 1e-9);
  const double before = figure(run({"evaluate", file("a.map"), "--graph", world}), "chi2");
  EXPECT_NEAR(figure(run({"evaluate", file("p.map"), "--graph", world}), "chi2"), before,
              1e-9 * before);
}

TEST_F(Anchors, SolveAndJoinWriteInPointsOfSpace) {
  const std::string world = simulate("landmarks3d", 100);
  const auto ids = features(world);
  const std::string anchor = "points:" + ids[0] + "," + ids[1] + "," + ids[2];
  const std::string report = run({"solve", world, "--anchor", anchor, "--output", file("a.map")});
  EXPECT_THAT(report, HasSubstr("frame of " + anchor));
  run({"reframe", file("a.map"), "--anchor", "pose:3", "--output", file("b.map")});
  run({"join", file("a.map"), file("b.map"), "--anchor", anchor, "--output", file("c.g2o")});
  const std::string text = read_text(file("c.g2o"));
  EXPECT_THAT(text, HasSubstr("point:" + ids[2] + " in the x-y plane at positive y"));
  EXPECT_EQ(vertex(text, "VERTEX_TRACKXYZ " + ids[0]), (std::vector<double>{0.0, 0.0, 0.0}));
  const auto on_x = vertex(text, "VERTEX_TRACKXYZ " + ids[1]);
  const auto at_y = vertex(text, "VERTEX_TRACKXYZ " + ids[2]);
  EXPECT_GT(on_x[0], 0.0);
  EXPECT_EQ(on_x[1], 0.0);
  EXPECT_EQ(on_x[2], 0.0);
  EXPECT_GT(at_y[1], 0.0);
  EXPECT_EQ(at_y[2], 0.0);
}

TEST_F(Anchors, PointsAreOfTheSessionTheyAreSaidToBe) {
  const std::string world = simulate("landmarks2d", 80);
  const auto ids = features(world);
  const std::string plain = "points:" + ids[0] + "," + ids[1];
  const std::string full = "points:1/" + ids[0] + ",1/" + ids[1];
  run({"solve", world, "--session", "1", "--anchor", plain, "--output", file("a.map")});
  EXPECT_THAT(run({"info", file("a.map")}), HasSubstr(full));
  run({"reframe", file("a.map"), "--anchor", "pose:5", "--output", file("b.map")});
  EXPECT_THAT(run({"reframe", file("b.map"), "--anchor", full, "--output", file("c.map")}),
              HasSubstr("from the frame of 1/pose:5 to that of " + full));
  expect_refused({"reframe", file("b.map"), "--anchor", "points:2/" + ids[0] + ",1/" + ids[1],
                  "--output", file("d.map")},
                 "2/point:" + ids[0]);
}

TEST_F(Anchors, ThatAreNoneAreRefused) {
  const std::string graph = write("in.g2o",
                                  "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n"
                                  "EDGE_SE2_XY 0 7 1 2 1 0 1\n"
                                  "EDGE_SE2_XY 1 8 3 2 1 0 1\n"
                                  "EDGE_SE2_XY 1 9 0 2 1 0 1\n");  // where 7 is
  run({"solve", graph, "--output", file("in.map")});
  const std::vector<std::pair<std::string, std::string>> wrong = {
      {"points:7", "takes 2 points, not 1"},
      {"points:7,8,9", "takes 2 points, not 3"},
      {"points:7,7", "point:7 stands in it twice"},
      {"points:7,77", "point:77"},
      {"points:7,9", "point:7 and point:9 do not fix a frame"},
      {"points:7;8", "points:84,85"},
      {"point:7", "points:84,85"},
      {"7", "pose:12"}};
  for (const auto& [anchor, message] : wrong) {
    SCOPED_TRACE(anchor);
    expect_refused({"reframe", file("in.map"), "--anchor", anchor, "--output", file("out.map")},
                   message);
    expect_refused({"solve", graph, "--anchor", anchor, "--output", file("out.g2o")}, message);
    expect_refused({"join", file("in.map"), "--anchor", anchor, "--output", file("out.g2o")},
                   message);
  }
}

TEST_F(Anchors, PointsThatTheMapCannotTellApartAreRefused) {
  // Half a metre apart, each known to a metre relative to the other.
  const std::string graph = write("in.g2o",
                                  "EDGE_SE2 0 1 1 0 0 100 0 0 100 0 100\n"
                                  "EDGE_SE2_XY 0 7 1.0 2 2 0 2\n"
                                  "EDGE_SE2_XY 1 8 0.5 2 2 0 2\n"
                                  "EDGE_SE2_XY 1 9 9.0 2 2 0 2\n");
  run({"solve", graph, "--output", file("in.map")});
  const std::string message =
      "points:7,8 does not fix a frame within what the map can tell: point:7 and point:8 are 0.5 "
      "apart with a standard deviation of 1";
  expect_refused({"reframe", file("in.map"), "--anchor", "points:7,8", "--output", file("out.map")},
                 message);
  expect_refused({"solve", graph, "--anchor", "points:7,8", "--output", file("out.g2o")}, message);
  run({"reframe", file("in.map"), "--anchor", "points:7,9", "--output", file("out.map")});
}

TEST_F(Anchors, PointsOfDifferentPiecesAreRefused) {
  const std::string graph = write("two.g2o",
                                  "EDGE_SE2 0 1 1 0 0 100 0 0 100 0 100\n"
                                  "EDGE_SE2_XY 0 7 1 2 100 0 100\n"
                                  "EDGE_SE2_XY 1 8 3 2 100 0 100\n"
                                  "EDGE_SE2 20 21 1 0 0 1 0 0 1 0 1\n"
                                  "EDGE_SE2_XY 20 9 1 2 1 0 1\n");
  expect_refused({"solve", graph, "--anchor", "points:7,9", "--output", file("out.map")},
                 "different pieces");
  run({"solve", graph, "--anchor", "points:7,8", "--output", file("out.map")});
  EXPECT_THAT(run({"info", file("out.map")}), HasSubstr("points:7,8"));
  EXPECT_THAT(run({"info", file("out.2.map")}), HasSubstr("pose:20"));
}

}  // namespace
}  // namespace mapjoin::test
