// Joining from the command line: folders of local maps, and recordings under sessions.

#include <cmath>

#include "tests/program/workbench.h"

namespace mapjoin::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class Join : public Workbench {
 protected:
  /// Edges of a world, each as (from, to, the rest of its line).
  struct Edge {
    std::string tag;
    int from = 0;
    int to = 0;
    std::string rest;
  };
  static std::vector<Edge> edges_of(const std::string& path) {
    std::vector<Edge> edges;
    std::istringstream lines(read_text(path));
    for (std::string line; std::getline(lines, line);) {
      std::istringstream words(line);
      Edge edge;
      if (words >> edge.tag >> edge.from >> edge.to && edge.tag.rfind("EDGE", 0) == 0) {
        std::getline(words, edge.rest);
        edges.push_back(edge);
      }
    }
    return edges;
  }
  static std::string line(const Edge& edge, const std::string& from, const std::string& to) {
    return edge.tag + " " + from + " " + to + edge.rest + "\n";
  }
  double chi2(const std::string& result, const std::string& graph) const {
    return figure(run({"evaluate", result, "--graph", graph}), "chi2");
  }
};

/// A folder of two local maps of the plane: poses 0 and 1, 1 and 2, and four features in both.
std::string local_map_text(int reference, int end, double shift) {
  std::ostringstream out;
  out << -reference << "\n11\n";
  for (const double x : {2.0, 0.0, 0.0}) out << -end << " " << x << "\n";
  const double features[4][2] = {{1, 1}, {4, 2}, {3, -2}, {-1, 3}};
  for (int k = 0; k < 4; ++k) {
    out << 10 + k << " " << features[k][0] - shift << "\n";
    out << 10 + k << " " << features[k][1] << "\n";
  }
  for (int r = 0; r < 11; ++r) {
    for (int c = 0; c < 11; ++c) out << (r == c ? 100 : 0) << (c < 10 ? " " : "\n");
  }
  return out.str();
}

TEST_F(Join, FeaturesOnlyLeavesThePosesOut) {
  write("maps/localmap_1.txt", local_map_text(1, 2, 0.0));
  write("maps/localmap_2.txt", local_map_text(2, 3, 2.0));
  const std::string report =
      run({"join", file("maps"), "--features-only", "--mode", "paper", "--anchor", "points:10,11",
           "--merged-list", file("list.csv"), "--output", file("f.g2o")});
  EXPECT_THAT(report, AllOf(HasSubstr("0 poses, 4 features"), HasSubstr("frame of points:10,11"),
                            HasSubstr("2 feature-only maps of 2 local maps"),
                            HasSubstr("1 join in the frame of common points")));
  const std::string list = read_text(file("list.csv"));
  EXPECT_THAT(list, AllOf(HasSubstr("map,first,last,frame\n1,1,1,\"points:"),
                          HasSubstr("\n2,2,2,\"points:")));
  EXPECT_THAT(read_text(file("f.g2o")), Not(HasSubstr("VERTEX_SE2")));

  expect_refused({"join", file("maps"), "--merged-list", file("l.csv"), "--output", file("o.g2o")},
                 "--merged-list goes with --features-only");
  run({"join", file("maps"), "--output", file("a.map")});
  expect_refused({"join", file("a.map"), "--features-only", "--output", file("o.g2o")},
                 "mapjoin marginalize");
}

TEST_F(Join, TwoRecordingsThatShareVariables) {
  const std::string world = simulate("sphere", 300);
  std::string first;
  std::string second;
  for (const Edge& edge : edges_of(world)) {
    const std::string text = line(edge, std::to_string(edge.from), std::to_string(edge.to));
    (edge.from < 150 && edge.to < 150 ? first : second) += text;
  }
  run({"solve", write("first.g2o", first), "--output", file("first.map")});
  run({"solve", write("second.g2o", second), "--output", file("second.map")});
  run({"join", file("first.map"), file("second.map"), "--output", file("both.g2o")});
  run({"solve", world, "--output", file("whole.g2o")});
  const double whole = chi2(file("whole.g2o"), world);
  EXPECT_NEAR(chi2(file("both.g2o"), world), whole, 1e-6 * whole);

  run({"join", file("first.map"), file("second.map"), "--mode", "summary", "--output",
       file("summary.g2o")});
  EXPECT_LT(chi2(file("summary.g2o"), world), 3 * whole);
}

TEST_F(Join, TwoRecordingsThatBothCountFromZero) {
  const std::string world = simulate("manhattan", 300, "4");
  const int cut = 150;
  std::string parts[2];
  std::string links;
  for (const Edge& edge : edges_of(world)) {
    const int a = edge.from / cut;
    const int b = edge.to / cut;
    const std::string from = std::to_string(edge.from % cut);
    const std::string to = std::to_string(edge.to % cut);
    if (a == b) {
      parts[a] += line(edge, from, to);
    } else {
      links += line(edge, std::to_string(a + 1) + "/" + from, std::to_string(b + 1) + "/" + to);
    }
  }
  run({"solve", write("1.g2o", parts[0]), "--session", "1", "--output", file("1.map")});
  run({"solve", write("2.g2o", parts[1]), "--session", "2", "--output", file("2.map")});
  const std::string report =
      run({"join", file("1.map"), file("2.map"), "--links", write("links.g2o", links), "--output",
           file("both.map"), "--json", file("stats.json"), "--anchor", "2/pose:7"});
  EXPECT_THAT(report, HasSubstr("frame of 2/pose:7"));
  run({"solve", world, "--output", file("whole.g2o")});
  const double whole = chi2(file("whole.g2o"), world);
  const std::string json = read_text(file("stats.json"));
  EXPECT_NEAR(std::stod(json.substr(json.find("\"chi2\":") + 7)), whole, 1e-6 * whole);

  // Without links they are two pieces, and stay so.
  EXPECT_THAT(run({"join", file("1.map"), file("2.map"), "--output", file("apart.g2o")}),
              HasSubstr("apart.2.g2o"));
  run({"reframe", file("both.map"), "--anchor", "1/pose:0", "--output", file("both.g2o")});
  EXPECT_THAT(read_text(file("both.g2o")), HasSubstr("session"));
}

/// One map: from pose `from` one metre ahead to pose `to`, and feature 5 seen on the way.
std::string local_map(int from, int to, double feature_x) {
  std::ostringstream out;
  out << from << "\n5\n-" << to << " 1\n-" << to << " 0\n-" << to << " 0\n5 " << feature_x
      << "\n5 1\n";
  for (int i = 0; i < 5; ++i) {
    for (int j = 0; j < 5; ++j) out << (i == j ? 4 : 1) << (j < 4 ? " " : "\n");
  }
  return out.str();
}

TEST_F(Join, AFolderOfLocalMaps) {
  for (int k = 1; k <= 4; ++k) {
    write("maps/localmap_" + std::to_string(k) + ".txt", local_map(k, k + 1, 5.0 - k));
  }
  for (const char* mode : {"paper", "summary", "observe", "optimal"}) {
    SCOPED_TRACE(mode);
    run({"join", file("maps"), "--mode", mode, "--output", file("out.g2o")});
    const std::string text = read_text(file("out.g2o"));
    EXPECT_THAT(text, HasSubstr("VERTEX_XY 100005 "));
    EXPECT_THAT(text, HasSubstr("VERTEX_SE2 1 0 0 0\n"));
    const std::string figures = run({"evaluate", file("out.g2o"), "--maps", file("maps")});
    EXPECT_LT(figure(figures, "chi2"), 1e-12);
    EXPECT_EQ(figure(figures, "measurements"), 4);
  }
  EXPECT_THAT(run({"info", file("maps")}), HasSubstr("2D set of 4 local maps"));

  // The native map keeps the features' own ids, and finds them again.
  run({"join", file("maps"), "--output", file("out.map")});
  EXPECT_THAT(run({"info", file("out.map")}), HasSubstr("point:5"));
  EXPECT_LT(figure(run({"evaluate", file("out.map"), "--maps", file("maps"), "--reference",
                        file("out.g2o")}),
                   "feature_rmse"),
            1e-9);
}

}  // namespace
}  // namespace mapjoin::test
