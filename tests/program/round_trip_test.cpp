// The program's main jobs, on worlds that it makes itself.

#include <cmath>

#include "tests/program/workbench.h"

namespace mapjoin::test {
namespace {

using ::testing::HasSubstr;

std::size_t count(const std::string& text, const std::string& word) {
  std::size_t n = 0;
  for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) ++n;
  return n;
}

class RoundTrip : public Workbench {
 protected:
  /// A number in a JSON text, by its key.
  static double json_number(const std::string& json, const std::string& key) {
    const std::size_t at = json.find("\"" + key + "\":");
    if (at == std::string::npos) {
      ADD_FAILURE() << "no " << key << " in " << json;
      return 0.0;
    }
    return std::stod(json.substr(at + key.size() + 3));
  }
};

class Worlds : public RoundTrip, public ::testing::WithParamInterface<const char*> {};

TEST_P(Worlds, AreSolvedToTheOptimum) {
  const std::string world = simulate(GetParam(), 400);
  run({"solve", world, "--output", file("map.g2o"), "--json", file("stats.json")});
  const std::string figures =
      run({"evaluate", file("map.g2o"), "--graph", world, "--reference", file("truth.g2o")});
  const double chi2 = figure(figures, "chi2");
  const double at_truth = figure(run({"evaluate", file("truth.g2o"), "--graph", world}), "chi2");
  EXPECT_LT(chi2, at_truth);
  EXPECT_GT(chi2, 0.3 * at_truth);
  EXPECT_LT(figure(figures, "pose_rmse"), 0.5);
  EXPECT_EQ(figure(figures, "common_poses"), 400);
  EXPECT_NEAR(json_number(read_text(file("stats.json")), "chi2"), chi2, 1e-6 * chi2);
}

INSTANTIATE_TEST_SUITE_P(, Worlds,
                         ::testing::Values("manhattan", "sphere", "grid3d", "landmarks2d",
                                           "landmarks3d"),
                         [](const auto& world) { return std::string(world.param); });

TEST_F(RoundTrip, EveryModeAndStrategyGivesAMap) {
  const std::string world = simulate("manhattan", 200);
  for (const char* mode : {"paper", "summary", "observe", "optimal"}) {
    for (const char* strategy : {"dc", "sequential"}) {
      SCOPED_TRACE(std::string(mode) + " " + strategy);
      run({"solve", world, "--mode", mode, "--strategy", strategy, "--output", file("map.g2o")});
      EXPECT_LT(figure(run({"evaluate", file("map.g2o"), "--graph", world}), "chi2"), 2000);
    }
  }
}

TEST_F(RoundTrip, TheReportAndItsJsonSayTheSame) {
  const std::string world = simulate("landmarks2d", 150);
  const std::string report =
      run({"solve", world, "--output", file("map.g2o"), "--json", file("stats.json")});
  const std::string json = read_text(file("stats.json"));
  for (const char* key :
       {"chi2", "chi2_linear", "solves_per_join", "root_solves", "refine_solves", "poses",
        "features", "components", "read", "solve", "write", "peak_memory_bytes", "measurements"}) {
    json_number(json, key);
  }
  EXPECT_EQ(json_number(json, "poses"), 150);
  EXPECT_EQ(json_number(json, "components"), 1);
  EXPECT_GT(json_number(json, "features"), 5);
  EXPECT_GT(json_number(json, "peak_memory_bytes"), 1e6);
  EXPECT_GE(json_number(json, "chi2_linear"), json_number(json, "chi2"));
  for (const char* word : {"variables", "measurements", "components", "chi2 linear", "chi2 refined",
                           "linear solve", "seconds", "peak memory", "map.g2o"}) {
    EXPECT_THAT(report, HasSubstr(word));
  }
}

TEST_F(RoundTrip, ThreadsDoNotChangeTheBits) {
  for (const char* world : {"manhattan", "landmarks3d"}) {
    const std::string graph = simulate(world, 500);
    for (const char* ending : {".g2o", ".map"}) {
      const std::string one = file(std::string("one") + ending);
      const std::string two = file(std::string("two") + ending);
      run({"solve", graph, "--threads", "1", "--output", one});
      run({"solve", graph, "--threads", "2", "--output", two});
      EXPECT_EQ(read_text(one), read_text(two)) << world << ending;
    }
  }
}

TEST_F(RoundTrip, SimulatingTwiceGivesTheSameBytes) {
  for (const char* world : {"manhattan", "sphere", "grid3d", "landmarks2d", "landmarks3d"}) {
    const std::string first = read_text(simulate(world, 200, "5"));
    EXPECT_EQ(first, read_text(simulate(world, 200, "5")));
    EXPECT_NE(first, read_text(simulate(world, 200, "6")));
  }
}

TEST_F(RoundTrip, WithoutNoiseTheTruthComesBack) {
  run({"simulate", "landmarks3d", "--poses", "120", "--noise", "0", "--output", file("w.g2o"),
       "--truth", file("t.g2o")});
  run({"solve", file("w.g2o"), "--output", file("map.g2o")});
  const std::string figures =
      run({"evaluate", file("map.g2o"), "--graph", file("w.g2o"), "--reference", file("t.g2o")});
  EXPECT_LT(figure(figures, "chi2"), 1e-6);
  EXPECT_LT(figure(figures, "pose_rmse"), 1e-6);
  EXPECT_LT(figure(figures, "feature_rmse"), 1e-6);
}

TEST_F(RoundTrip, PiecesThatNothingLinksHaveFilesOfTheirOwn) {
  const std::string graph = write("two.g2o",
                                  "EDGE_SE2 10 11 1 0 0 1 0 0 1 0 1\n"
                                  "EDGE_SE2 11 12 1 0 0 1 0 0 1 0 1\n"
                                  "EDGE_SE2 3 4 1 0 0.5 1 0 0 1 0 1\n");
  const std::string report = run({"solve", graph, "--output", file("out.g2o")});
  EXPECT_THAT(report, HasSubstr("out.2.g2o"));
  const std::string both = read_text(file("out.g2o")) + read_text(file("out.2.g2o"));
  EXPECT_EQ(count(both, "VERTEX_SE2"), 5U);
  const std::string figures =
      run({"evaluate", file("out.g2o"), file("out.2.g2o"), "--graph", graph});
  EXPECT_NEAR(figure(figures, "chi2"), 0.0, 1e-12);
}

TEST_F(RoundTrip, TheFrameIsTheFixedPoseOrTheOneAsked) {
  const std::string edges = "EDGE_SE2 1 2 1 0 0 1 0 0 1 0 1\nEDGE_SE2 2 3 1 0 0 1 0 0 1 0 1\n";
  const auto solve = [&](const std::string& text, const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"solve", write("in.g2o", text), "--output",
                                          file("o.g2o")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    run(arguments);
    return read_text(file("o.g2o"));
  };
  EXPECT_THAT(solve(edges, {}), HasSubstr("VERTEX_SE2 1 0 0 0\n"));
  EXPECT_THAT(solve(edges + "FIX 3\n", {}), HasSubstr("VERTEX_SE2 3 0 0 0\n"));
  EXPECT_THAT(solve(edges + "FIX 3\n", {"--anchor", "pose:2"}), HasSubstr("VERTEX_SE2 2 0 0 0\n"));
  EXPECT_THAT(solve(edges, {"--session", "4", "--anchor", "pose:2"}),
              HasSubstr("VERTEX_SE2 2 0 0 0\n"));
  EXPECT_THAT(solve(edges, {"--session", "4", "--anchor", "4/pose:3"}),
              HasSubstr("VERTEX_SE2 3 0 0 0\n"));
}

TEST_F(RoundTrip, ReframingChangesTheFrameAndNothingElse) {
  const std::string world = simulate("landmarks2d", 200);
  run({"solve", world, "--output", file("a.map")});
  run({"reframe", file("a.map"), "--anchor", "pose:120", "--output", file("b.map")});
  run({"reframe", file("b.map"), "--anchor", "pose:0", "--output", file("c.g2o")});
  run({"reframe", file("b.map"), "--anchor", "pose:120", "--output", file("b.g2o")});
  EXPECT_THAT(read_text(file("b.g2o")), HasSubstr("VERTEX_SE2 120 0 0 0\n"));
  const std::string figures =
      run({"evaluate", file("c.g2o"), "--graph", world, "--reference", file("a.map")});
  EXPECT_LT(figure(figures, "pose_rmse"), 1e-9);
  const double before = figure(run({"evaluate", file("a.map"), "--graph", world}), "chi2");
  EXPECT_NEAR(figure(run({"evaluate", file("b.map"), "--graph", world}), "chi2"), before,
              1e-6 * before);
}

TEST_F(RoundTrip, TrajectoriesAreWrittenAsTum) {
  run({"solve", simulate("sphere", 100), "--output", file("out.tum")});
  std::istringstream lines(read_text(file("out.tum")));
  std::size_t poses = 0;
  for (std::string line; std::getline(lines, line);) poses += line[0] != '#' ? 1U : 0U;
  EXPECT_EQ(poses, 100U);
}

TEST_F(RoundTrip, PositionsInTheWorldGeoreferenceAMap) {
  // A drive of three metres to the north at (100, 50), of which the positions of both ends are
  // known.
  const std::string steps =
      "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\nEDGE_SE2 1 2 1 0 0 1 0 0 1 0 1\n"
      "EDGE_SE2 2 3 1 0 0 1 0 0 1 0 1\n";
  const std::string graph = write("fixes.g2o", steps +
                                                   "EDGE_PRIOR_SE2_XY 0 100 50 4 0 4\n"
                                                   "EDGE_PRIOR_SE2_XY 3 100 53 4 0 4\n");
  run({"solve", graph, "--anchor", "world", "--output", file("there.g2o")});
  const std::string there = read_text(file("there.g2o"));
  EXPECT_THAT(there, HasSubstr("in the frame of world"));
  std::istringstream vertex(there.substr(there.find("VERTEX_SE2 2 ") + 13));
  double x = 0.0, y = 0.0, theta = 0.0;
  vertex >> x >> y >> theta;
  EXPECT_NEAR(x, 100.0, 1e-9);
  EXPECT_NEAR(y, 52.0, 1e-9);
  EXPECT_NEAR(theta, 0.5 * M_PI, 1e-9);

  run({"solve", graph, "--output", file("here.map")});
  run({"reframe", file("here.map"), "--anchor", "world", "--output", file("again.tum")});
  EXPECT_EQ(count(read_text(file("again.tum")), "\n"), 5U) << "a head and four poses, no world";
  expect_refused({"solve", write("one.g2o", steps + "EDGE_PRIOR_SE2_XY 0 100 50 4 0 4\n"),
                  "--anchor", "world", "--output", file("none.g2o")},
                 "do not say where anything lies in it");
}

TEST_F(RoundTrip, RepairsAndSkipsWhenAsked) {
  const std::string graph = write("odd.g2o",
                                  "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n"
                                  "EDGE_SE2 1 2 1 0 0 1 5 0 1 0 1\n"
                                  "EDGE_SWITCH_PRIOR 1 0 0 0 1 0 0 1 0 1\n");
  for (const char* policy : {"clamp", "isotropic"}) {
    const std::string report = run(
        {"solve", graph, "--indefinite", policy, "--skip-unknown", "--output", file("out.g2o")});
    EXPECT_THAT(report, HasSubstr("repaired"));
    EXPECT_THAT(report, HasSubstr("EDGE_SWITCH_PRIOR"));
  }
  const std::string about = run({"info", graph});
  EXPECT_THAT(about, HasSubstr("indefinite"));
  EXPECT_THAT(about, HasSubstr("EDGE_SWITCH_PRIOR"));
}

TEST_F(RoundTrip, InfoKnowsWhatAFileIs) {
  const std::string world = simulate("landmarks2d", 100);
  EXPECT_THAT(run({"info", world}), HasSubstr("2D measurement graph"));
  EXPECT_THAT(run({"info", world}), HasSubstr("99 EDGE_SE2"));
  EXPECT_THAT(run({"info", file("truth.g2o")}), HasSubstr("2D solution"));
  run({"solve", world, "--output", file("a.map")});
  EXPECT_THAT(run({"info", file("a.map")}), HasSubstr("2D native map"));
  EXPECT_THAT(run({"info", file("a.map")}), HasSubstr("frame         pose:0"));
}

TEST_F(RoundTrip, TheDemoLeavesAPicture) {
  const std::string said = run({"demo", "--output", file("demo"), "--poses", "300"});
  EXPECT_THAT(said, HasSubstr("before_after.svg"));
  EXPECT_EQ(read_text(file("demo/before_after.svg")).rfind("<svg", 0), 0U);
  run({"join", file("demo/local_maps/0001.map"), file("demo/local_maps/0002.map"), "--output",
       file("two.map")});
  EXPECT_LT(figure(run({"evaluate", file("demo/joined.g2o"), "--graph", file("demo/world.g2o"),
                        "--reference", file("demo/truth.g2o")}),
                   "pose_rmse"),
            0.5);
}

TEST_F(RoundTrip, CtrlCLeavesNothing) {
  run({"simulate", "sphere", "--poses", "100000", "--output", file("large.g2o")});
  const auto before = listing();
  const char* chosen = std::getenv("MAPJOIN_PROGRAM");
  const std::string command = "timeout --preserve-status --signal=INT 0.8 " +
                              shell_quoted(chosen != nullptr ? chosen : kDefaultProgram) +
                              " solve " + shell_quoted(file("large.g2o")) + " --output " +
                              shell_quoted(file("out.map")) + " >/dev/null 2>&1";
  const int status = std::system(command.c_str());
  EXPECT_EQ(WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status), 130);
  EXPECT_EQ(listing(), before);
}

}  // namespace
}  // namespace mapjoin::test
