// marginalize, covariance, evaluate --truth.
#include <algorithm>
#include <cstdlib>

#include "mapjoin/graph/builtin_types.h"
#include "mapjoin/io/native_map.h"
#include "mapjoin/solvers/covariance.h"
#include "tests/program/workbench.h"

namespace mapjoin::test {
namespace {

using ::testing::HasSubstr;

class Uncertainty : public Workbench {
 protected:
  /// A solved world: world.map, with truth.g2o beside it.
  std::string solved() const {
    const std::string graph = simulate("landmarks2d", 200);
    run({"solve", graph, "--output", file("world.map")});
    return file("world.map");
  }
  /// All numbers of a text from a word on.
  static std::vector<double> numbers_after(const std::string& text, const std::string& word) {
    std::vector<double> out;
    const char* at = text.c_str() + text.find(word);
    while (*at != '\0') {
      if (*at != '-' && (*at < '0' || *at > '9')) {
        ++at;
        continue;
      }
      char* end = nullptr;
      out.push_back(std::strtod(at, &end));
      at = end;
    }
    return out;
  }
  static Map<2> read(const std::string& path) { return read_map<2>(path, builtin_types<2>()); }
};

TEST_F(Uncertainty, OfAKeyIsThatOfTheLibrary) {
  const std::string map = solved();
  const std::string said = run({"covariance", map, "--keys", "pose:7,point:100002", "--json",
                                file("out.json"), "--output", file("out.csv")});
  EXPECT_THAT(said, HasSubstr("pose:7"));
  EXPECT_THAT(said, HasSubstr("point:100002"));
  const std::vector<Key> keys = {pose_key(7), point_key(100002)};
  const Eigen::MatrixXd joint = Covariance<2>(read(map)).of(keys);
  const std::string json = read_text(file("out.json"));
  EXPECT_THAT(json, HasSubstr("\"frame\": \"pose:0\""));
  const std::vector<double> numbers = numbers_after(json, "joint");
  ASSERT_EQ(numbers.size(), 25U);
  for (int k = 0; k < 25; ++k) {
    EXPECT_NEAR(numbers[static_cast<std::size_t>(k)], joint(k / 5, k % 5),
                1e-9 * joint.cwiseAbs().maxCoeff());
  }
}

TEST_F(Uncertainty, OfAllHasALineAVariable) {
  const std::string map = solved();
  run({"covariance", map, "--all", "--output", file("all.csv")});
  const std::string table = read_text(file("all.csv"));
  const Map<2> read_back = read(map);
  EXPECT_EQ(std::count(table.begin(), table.end(), '\n'), read_back.values.size() + 1);
  std::istringstream lines(table);
  std::string header, line;
  std::getline(lines, header);
  while (std::getline(lines, line)) {
    EXPECT_EQ(std::count(line.begin(), line.end(), ','),
              std::count(header.begin(), header.end(), ','));
    EXPECT_EQ(line.find("nan"), std::string::npos);
  }
}

TEST_F(Uncertainty, MarginalizeWritesMapsOfWhatIsKept) {
  const std::string map = solved();
  run({"marginalize", map, "--keep", "poses", "--output", file("poses.map")});
  EXPECT_EQ(read(file("poses.map")).variables().columns().size(), 1U);
  EXPECT_EQ(read(file("poses.map")).values.size(), 200);
  EXPECT_EQ(read(file("poses.map")).observations, nullptr);
  run({"marginalize", map, "--keep", "features", "--output", file("features.map")});
  EXPECT_FALSE(read(file("features.map")).values.contains(pose_key(0)));
  EXPECT_THAT(run({"marginalize", map, "--keep", "last-pose", "--output", file("ekf.map")}),
              HasSubstr("pose:199"));
  run({"marginalize", map, "--keep", "pose:0,point:100001,point:100002", "--output",
       file("part.map")});
  const std::vector<Key> keys = {point_key(100001), point_key(100002)};
  const Eigen::MatrixXd whole = Covariance<2>(read(map)).of(keys);
  EXPECT_LT((Covariance<2>(read(file("part.map"))).of(keys) - whole).cwiseAbs().maxCoeff(),
            1e-8 * whole.cwiseAbs().maxCoeff());
}

TEST_F(Uncertainty, OfASimulatedWorldIsConsistentWithItsTruth) {
  const std::string map = solved();
  const std::string said =
      run({"evaluate", map, "--truth", file("truth.g2o"), "--confidence", "0.999"});
  EXPECT_GT(figure(said, "nees"), figure(said, "lower"));
  EXPECT_LT(figure(said, "nees"), figure(said, "upper"));
  EXPECT_EQ(figure(said, "dimension"), read(map).variables().scalars() - 3);
}

TEST_F(Uncertainty, TruthMayBeATableOfFeatures) {
  const std::string map = solved();
  const Map<2> estimate = read(map);
  std::string table = "beacon,x_m,y_m\n";
  const auto& column = estimate.variables().column(estimate.variables().find_column(Tag("point")));
  for (const Key& key : column.keys) {
    const auto& p = estimate.values.point(key);
    table +=
        std::to_string(key.id) + "," + std::to_string(p(0)) + "," + std::to_string(p(1)) + "\n";
  }
  const std::string said = run({"evaluate", map, "--truth", write("beacons.csv", table)});
  EXPECT_EQ(figure(said, "dimension"), 2 * column.size());
  EXPECT_LT(figure(said, "nees"), 1e-3) << "the estimate itself, to six digits";
  expect_refused({"evaluate", map, "--truth", write("bad.csv", "beacon,x_m,y_m\n1,2\n")},
                 "bad.csv:2");
}

TEST_F(Uncertainty, QuestionsWithoutAnAnswerAreRefused) {
  const std::string map = solved();
  expect_refused({"covariance", map}, "--keys");
  expect_refused({"covariance", map, "--all"}, "--output");
  expect_refused({"covariance", map, "--keys", "point:99999"}, "point:99999");
  expect_refused({"marginalize", map, "--keep", "point:100001", "--output", file("x.map")},
                 "two points");
  expect_refused({"evaluate", map}, "--truth");
}

}  // namespace
}  // namespace mapjoin::test
