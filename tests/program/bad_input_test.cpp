// Every bad input ends in a message that a stranger can act on, exit code 2 and no output file.

#include <tuple>

#include "tests/program/workbench.h"

namespace mapjoin::test {
namespace {

const std::string kEdge = "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n";
const std::string kPointEdge = "EDGE_SE2_XY 1 7 1 2 1 0 1\n";
const std::string kEdge3 =
    "EDGE_SE3:QUAT 1 2 1 0 0 0 0 0 1 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n";

struct BadFile {
  std::string name;
  std::string content;
  std::string message;  ///< part of what must be said
};
void PrintTo(const BadFile& bad, std::ostream* out) { *out << bad.name; }
std::string name_of(const ::testing::TestParamInfo<BadFile>& info) { return info.param.name; }

class BadGraph : public Workbench, public ::testing::WithParamInterface<BadFile> {};

TEST_P(BadGraph, IsRefused) {
  const std::string graph = write("bad.g2o", GetParam().content);
  for (const std::string ending : {".g2o", ".map", ".tum"}) {
    expect_refused({"solve", graph, "--output", file("out" + ending), "--json", file("s.json")},
                   GetParam().message);
  }
  expect_refused({"evaluate", write("result.g2o", "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\n"),
                  "--graph", graph},
                 GetParam().message);
}

INSTANTIATE_TEST_SUITE_P(
    , BadGraph,
    ::testing::Values(
        BadFile{"Empty", "", "bad.g2o"}, BadFile{"OnlyVertices", "VERTEX_SE2 0 0 0 0\n", "bad.g2o"},
        BadFile{"Truncated", kEdge + "EDGE_SE2 1 2 1 0 0 1 0", "bad.g2o:2"},
        BadFile{"TooLong", "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1 5\n", "bad.g2o:1"},
        BadFile{"Garbage", "It was a dark and stormy night\n", "bad.g2o:1"},
        BadFile{"Binary", std::string("\x7f\x45LF\0\1\2\3", 8), "bad.g2o:1"},
        BadFile{"Letters", kEdge + "EDGE_SE2 1 2 one 0 0 1 0 0 1 0 1\n", "bad.g2o:2"},
        BadFile{"NaN", kEdge + "EDGE_SE2 1 2 nan 0 0 1 0 0 1 0 1\n", "bad.g2o:2"},
        BadFile{"Infinite", kEdge + "EDGE_SE2 1 2 0 0 0 inf 0 0 1 0 1\n", "bad.g2o:2"},
        BadFile{"Overflow", kEdge + "EDGE_SE2 1 2 1e999 0 0 1 0 0 1 0 1\n", "bad.g2o:2"},
        BadFile{"SelfLoop", kEdge + "EDGE_SE2 1 1 1 0 0 1 0 0 1 0 1\n", "bad.g2o:2"},
        BadFile{"ConflictingVertices", "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 0 1 0 0\n" + kEdge,
                "bad.g2o"},
        BadFile{"NegativeId", kEdge + "EDGE_SE2 1 -2 1 0 0 1 0 0 1 0 1\n", "bad.g2o:2"},
        BadFile{"HugeId", kEdge + "EDGE_SE2 1 99999999999999999999999 1 0 0 1 0 0 1 0 1\n",
                "bad.g2o:2"},
        BadFile{"PoseAndPoint", kEdge + kPointEdge + "EDGE_SE2 1 7 1 0 0 1 0 0 1 0 1\n", "bad.g2o"},
        BadFile{"MixedDimensions", kEdge + kEdge3, "bad.g2o:2"},
        BadFile{"Indefinite", kEdge + "EDGE_SE2 1 2 1 0 0 1 5 0 1 0 1\n", "bad.g2o:2"},
        BadFile{"ZeroQuaternion",
                "EDGE_SE3:QUAT 1 2 1 0 0 0 0 0 0 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n",
                "bad.g2o:1"},
        BadFile{"UnknownTag", kEdge + "EDGE_FOO 1 2 1 0 0\n", "EDGE_FOO"},
        BadFile{"Prior", kEdge + "EDGE_SWITCH_PRIOR 1 0 0 0 1 0 0 1 0 1\n", "EDGE_SWITCH_PRIOR"},
        BadFile{"SeveralFix", kEdge + "FIX 0\nFIX 1\n", "FIX"}),
    name_of);

/// A map 2 -> (pose 1, feature 5), with the given matrix in place of the identity's last rows.
std::string local_map(const std::string& last_rows) {
  return "1\n5\n-2 1\n-2 0\n-2 0\n5 2\n5 1\n"
         "1 0 0 0 0\n0 1 0 0 0\n0 0 1 0 0\n" +
         last_rows;
}

class BadLocalMap : public Workbench, public ::testing::WithParamInterface<BadFile> {};

TEST_P(BadLocalMap, IsRefused) {
  write("maps/localmap_1.txt", local_map("0 0 0 1 0\n0 0 0 0 1\n"));
  write("maps/localmap_2.txt", GetParam().content);
  expect_refused({"join", file("maps"), "--output", file("out.g2o")}, GetParam().message);
}

INSTANTIATE_TEST_SUITE_P(
    , BadLocalMap,
    ::testing::Values(BadFile{"Empty", "", "localmap_2.txt"},
                      BadFile{"Garbage", "hello\n", "localmap_2.txt:1"},
                      BadFile{"Truncated", local_map("0 0 0 1 0\n0 0 "), "localmap_2.txt"},
                      BadFile{"TooLong", local_map("0 0 0 1 0\n0 0 0 0 1\n7\n"), "localmap_2.txt"},
                      BadFile{"NotSymmetric", local_map("0 0 0 1 0\n0 0 0 0.5 1\n"), "symmetric"},
                      BadFile{"Indefinite", local_map("0 0 0 1 5\n0 0 0 5 1\n"), "localmap_2.txt"},
                      BadFile{"NaN", local_map("0 0 0 nan 0\n0 0 0 0 1\n"), "localmap_2.txt"},
                      BadFile{"ClaimsAHugeState", "1\n2000000000\n-2 1\n", "localmap_2.txt"},
                      BadFile{"ClaimsAnImpossibleState", "1\n99999999999999999999\n-2 1\n",
                              "localmap_2.txt"},
                      BadFile{"NegativeState", "1\n-5\n", "localmap_2.txt"},
                      BadFile{"RunThatIsNoVariable", "1\n1\n-2 1\n1\n", "localmap_2.txt"}),
    name_of);

class BadInput : public Workbench {
 protected:
  std::string good() const { return write("good.g2o", kEdge); }
  std::string good3() const { return write("good3.g2o", kEdge3); }
};

TEST_F(BadInput, ToleranceThatMeansNothing) {
  for (const char* tolerance : {"-1e-6", "0.01", "nan"}) {
    expect_refused({"solve", good(), "--tolerance", tolerance, "--output", file("out.g2o")},
                   "refine_tolerance must be at least 0 and at most 0.001");
  }
  expect_refused(
      {"solve", good(), "--tolerance", "1e-6", "--mode", "observe", "--output", file("out.g2o")},
      "--tolerance is for optimal mode");
  run({"solve", good(), "--tolerance", "1e-9", "--output", file("out.g2o")});
}

TEST_F(BadInput, MissingFiles) {
  expect_refused({"solve", file("none.g2o"), "--output", file("out.g2o")}, "none.g2o");
  expect_refused({"join", file("none"), "--output", file("out.g2o")}, "none");
  expect_refused({"reframe", file("none.map"), "--anchor", "pose:0", "--output", file("o.map")},
                 "none.map");
  expect_refused({"evaluate", file("none.g2o"), "--graph", good()}, "none.g2o");
  expect_refused({"info", file("none.g2o")}, "none.g2o");
}

TEST_F(BadInput, OutputsThatCannotBe) {
  expect_refused({"solve", good(), "--output", file("no/such/folder/out.g2o")}, "no/such/folder");
  expect_refused({"solve", good(), "--output", file("out.txt")}, ".map");
  expect_refused({"solve", good(), "--output", file("out.g2o"), "--json", file("no/s.json")},
                 "s.json");
  std::filesystem::create_directory(file("taken.g2o"));
  expect_refused({"solve", good(), "--output", file("taken.g2o")}, "taken.g2o");
  expect_refused({"simulate", "sphere", "--output", file("no/out.g2o")}, "out.g2o");
}

TEST_F(BadInput, ASecondPieceThatCannotBeWrittenLeavesNoFirst) {
  const std::string graph = write("two.g2o", kEdge + "EDGE_SE2 5 6 1 0 0 1 0 0 1 0 1\n");
  std::filesystem::create_directory(file("out.2.g2o"));
  expect_refused({"solve", graph, "--output", file("out.g2o")}, "out.2.g2o");
}

TEST_F(BadInput, Anchors) {
  for (const char* anchor :
       {"pose:99", "1/pose:0", "point:0", "pose", "pose:", "0", "pose:x", ""}) {
    if (*anchor == '\0') continue;
    expect_refused({"solve", good(), "--output", file("out.g2o"), "--anchor", anchor}, "pose");
  }
  run({"solve", good(), "--output", file("good.map")});
  expect_refused({"reframe", file("good.map"), "--anchor", "pose:99", "--output", file("o.map")},
                 "pose:99");
}

TEST_F(BadInput, NativeMaps) {
  run({"solve", good(), "--output", file("good.map")});
  const std::string content = read_text(file("good.map"));
  for (const std::size_t size :
       {std::size_t{0}, std::size_t{7}, std::size_t{40}, content.size() / 2, content.size() - 1}) {
    const std::string cut = write("cut.map", content.substr(0, size));
    expect_refused({"join", cut, "--output", file("out.g2o")}, "cut.map");
    expect_refused({"info", cut}, "cut.map");
  }
  std::string damaged = content;
  damaged[content.size() / 2] = static_cast<char>(damaged[content.size() / 2] ^ 1);
  expect_refused(
      {"reframe", write("damaged.map", damaged), "--anchor", "pose:0", "--output", file("out.map")},
      "damaged.map");
  expect_refused({"join", write("text.map", "hello"), "--output", file("out.map")}, "text.map");
}

TEST_F(BadInput, Joins) {
  run({"solve", good(), "--output", file("good.map")});
  run({"solve", good3(), "--output", file("good3.map")});
  const std::string out = file("out.g2o");
  expect_refused({"join", file("good.map"), file("good3.map"), "--output", out}, "good3.map");
  expect_refused({"join", good(), "--output", out}, "mapjoin solve");
  expect_refused({"solve", file("good.map"), "--output", out}, "mapjoin join");
  std::filesystem::create_directory(file("empty"));
  expect_refused({"join", file("empty"), "--output", out}, "localmap");
  expect_refused({"join", file("empty"), file("good.map"), "--output", out}, "folder");
  const std::string links = write("links.g2o", "EDGE_SE2 0 3/7 1 0 0 1 0 0 1 0 1\n");
  expect_refused({"join", file("good.map"), "--links", links, "--output", out}, "3/pose:7");
  expect_refused({"join", file("good.map"), "--links", good3(), "--output", out}, "3D");
}

TEST_F(BadInput, LocalMapsThatAreMissing) {
  write("maps/localmap_1.txt", local_map("0 0 0 1 0\n0 0 0 0 1\n"));
  write("maps/localmap_3.txt", local_map("0 0 0 1 0\n0 0 0 0 1\n"));
  expect_refused({"join", file("maps"), "--output", file("out.g2o")}, "2");
}

TEST_F(BadInput, Evaluations) {
  const std::string result = write("result.g2o", "VERTEX_SE2 0 0 0 0\n");
  expect_refused({"evaluate", result}, "--graph");
  expect_refused({"evaluate", result, "--graph", good()}, "pose:1");
  expect_refused({"evaluate", result, "--graph", good3()}, "result.g2o");
  expect_refused({"evaluate", result, "--graph", good(), "--maps", "x"}, "--maps");
}

TEST_F(BadInput, Simulations) {
  const std::string out = file("out.g2o");
  expect_refused({"simulate", "venus", "--output", out}, "landmarks2d");
  expect_refused({"simulate", "manhattan", "--poses", "0", "--output", out}, "poses");
  expect_refused({"simulate", "manhattan", "--poses", "-5", "--output", out}, "poses");
  expect_refused({"simulate", "manhattan", "--poses", "many", "--output", out}, "poses");
  expect_refused({"simulate", "manhattan", "--poses", "1", "--output", out}, "poses");
  expect_refused({"simulate", "manhattan", "--edges-per-pose", "9", "--output", out}, "edges");
  expect_refused({"simulate", "manhattan", "--noise", "nan", "--output", out}, "noise");
  expect_refused({"simulate", "manhattan", "--output", file("out.map")}, ".g2o");
}

}  // namespace
}  // namespace mapjoin::test
