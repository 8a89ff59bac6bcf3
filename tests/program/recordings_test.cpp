// The sphere in two recordings, from the command line as a user would do it.
#include <cstdlib>

#include "tests/program/workbench.h"
#include "tests/support/data.h"

namespace mapjoin::test {
namespace {

using ::testing::HasSubstr;

constexpr double kOptimum = 1153.8544;
constexpr int kCut = 1250;

class SphereRecordings : public Workbench {
 protected:
  struct Edge {
    int from = 0;
    int to = 0;
    std::string rest;
    std::string between(const std::string& a, const std::string& b) const {
      return "EDGE_SE3:QUAT " + a + " " + b + rest + "\n";
    }
  };

  void SetUp() override {
    const auto found = data_file("pose_graphs/sphere_2500.g2o");
    if (!found) GTEST_SKIP() << missing_data("pose_graphs/sphere_2500.g2o");
    whole_ = found->string();
    std::istringstream lines(read_text(*found));
    for (std::string line; std::getline(lines, line);) {
      std::istringstream words(line);
      std::string tag;
      Edge edge;
      if (words >> tag >> edge.from >> edge.to && tag == "EDGE_SE3:QUAT") {
        std::getline(words, edge.rest);
        edges_.push_back(edge);
      }
    }
  }

  double chi2(const std::string& result) const {
    return figure(run({"evaluate", result, "--graph", whole_}), "chi2");
  }
  /// A figure of what --json wrote.
  double stated(const std::string& json, const std::string& name) const {
    const std::string text = read_text(json);
    const std::string quoted = "\"" + name + "\":";
    const auto at = text.find(quoted);
    EXPECT_NE(at, std::string::npos) << text;
    return at == std::string::npos ? 0.0 : std::strtod(text.c_str() + at + quoted.size(), nullptr);
  }

  std::string whole_;
  std::vector<Edge> edges_;
};

TEST_F(SphereRecordings, ThatShareSomePosesJoinToTheOptimumOfTheWhole) {
  std::string parts[2];
  for (const Edge& e : edges_) {
    const bool before = e.from < kCut && e.to < kCut;
    parts[before ? 0 : 1] += e.between(std::to_string(e.from), std::to_string(e.to));
  }
  run({"solve", write("first.g2o", parts[0]), "--output", file("first.map")});
  run({"solve", write("second.g2o", parts[1]), "--output", file("second.map")});
  run({"join", file("first.map"), file("second.map"), "--output", file("both.g2o")});
  EXPECT_NEAR(chi2(file("both.g2o")), kOptimum, 1e-6 * kOptimum);
  run({"join", file("first.map"), file("second.map"), "--mode", "summary", "--output",
       file("summaries.g2o")});
  EXPECT_LT(chi2(file("summaries.g2o")), 1364.0);
}

TEST_F(SphereRecordings, ThatBothCountFromZeroJoinByLinksAcrossSessions) {
  std::string parts[2];
  std::string links;
  for (const Edge& e : edges_) {
    const int a = e.from / kCut;
    const int b = e.to / kCut;
    const std::string from = std::to_string(e.from % kCut);
    const std::string to = std::to_string(e.to % kCut);
    if (a == b) {
      parts[a] += e.between(from, to);
    } else {
      links += e.between(std::to_string(a + 1) + "/" + from, std::to_string(b + 1) + "/" + to);
    }
  }
  run({"solve", write("first.g2o", parts[0]), "--session", "1", "--output", file("first.map")});
  run({"solve", write("second.g2o", parts[1]), "--session", "2", "--output", file("second.map")});
  run({"join", file("first.map"), file("second.map"), "--links", write("links.g2o", links),
       "--output", file("both.map"), "--json", file("stats.json")});
  EXPECT_NEAR(stated(file("stats.json"), "chi2"), kOptimum, 1e-6 * kOptimum);
  EXPECT_EQ(stated(file("stats.json"), "components"), 1);
  EXPECT_THAT(run({"info", file("both.map")}), HasSubstr("2/pose:1249"));
}

}  // namespace
}  // namespace mapjoin::test
