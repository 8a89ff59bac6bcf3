// Optimal mode on every data set: the nonlinear least squares optimum, without a guess, whatever
// the vertices are called and whatever the number of threads.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <numeric>
#include <random>

#include "mapjoin/evaluation/evaluate.h"
#include "tests/support/data_sets.h"

namespace mapjoin::test {
namespace {

constexpr double kTolerance = 1e-6;  // of chi2, relative

const std::vector<DataSet> kPoseGraphs = {
    {"pose_graphs", "intel_943", 546.4611},
    {"pose_graphs", "manhattan_3500", 137.9130},
    {"pose_graphs", "city_10000", 511.9852},
    {"pose_graphs", "sphere_2500", 1153.8544},
    {"pose_graphs", "parking_garage_1661", 1.288830},
    {"pose_graphs", "manhattan_3500_anisotropic", 3549.0368},
    {"pose_graphs", "intel_1728", 45.004696},
    {"pose_graphs", "csail_1045", 40.555129},
    {"pose_graphs", "torus_5000", 24233.0187},
};

const std::vector<DataSet> kOthers = {
    {"landmark_graphs", "victoria_park", 9012.7196}, {"landmark_graphs", "dlr", 27688.5556},
    {"local_maps", "victoria_park_200", 3643.4349},  {"local_maps", "dlr_200", 11163.6435},
    {"local_maps", "victoria_park_6898", 9012.7196}, {"local_maps", "dlr_3298", 27688.5556},
    {"local_maps", "simu_8240_50", 458.1544},        {"local_maps", "simu_35188_700", 10315.6331},
    {"local_maps", "intel_943", 546.4611},
};

const DataSet kSpatialMaps = {"local_maps", "simu3d_870"};
const DataSet kSphereMaps = {"local_maps", "sphere_2500"};

/// The optimum of simu3d_870 in the library's charts, from this program: the authors give none.
constexpr double kSpatialMapsOptimum = 289.947146;

std::string name_of(const testing::TestParamInfo<DataSet>& info) { return info.param.label(); }

/// The result's single map, if it is what it has to be.
template <int D>
const Map<D>& single_map(const JoinResult<D>& result) {
  EXPECT_EQ(result.report.components, 1);
  EXPECT_TRUE(result.report.minimum);
  const Map<D>& map = result.maps.at(0);
  const auto poses = map.variables().find_column(Tag("pose"));
  EXPECT_EQ(map.anchor.keys.at(0), map.variables().column(poses).keys[0]);
  return map;
}

class Optimum : public testing::TestWithParam<DataSet> {};

TEST_P(Optimum, IsReachedWithoutAGuess) {
  const auto problem = load(GetParam());
  if (!problem) GTEST_SKIP() << missing(GetParam());
  std::visit(
      [&]<int D>(const Problem<D>& p) {
        const JoinResult<D> result = p.join({});
        const Map<D>& map = single_map(result);
        const double optimum = GetParam().optimum;
        EXPECT_NEAR(chi2(map.values, p.graph), optimum, kTolerance * optimum);
        EXPECT_NEAR(result.report.chi2, optimum, kTolerance * optimum);
        if (!p.reference) return;
        const Deviation d = deviation(map.values, *p.reference);
        EXPECT_EQ(d.poses + d.features, static_cast<std::size_t>(map.values.size()));
        EXPECT_LT(d.pose_rmse, 2e-3);  // metres; the references are optima to some 1e-6 of chi2
      },
      *problem);
}

INSTANTIATE_TEST_SUITE_P(PoseGraphs, Optimum, testing::ValuesIn(kPoseGraphs), name_of);
INSTANTIATE_TEST_SUITE_P(Others, Optimum, testing::ValuesIn(kOthers), name_of);

/// The chi2 that the data sets' own tool prints, in Euler angles, for a set of local maps.
std::optional<double> judged(const DataSet& set, const Map<3>& map) {
  const auto tool = data_file("../tools/chi2.py");
  if (!tool || std::system("python3 --version >/dev/null 2>&1") != 0) return std::nullopt;
  const TemporaryDirectory scratch;
  G2oWriteOptions options;
  options.feature_offset = true;
  write_g2o(scratch.file("map.g2o"), map.values, options);
  const std::string command = "python3 " + shell_quoted(tool->string()) + " " +
                              shell_quoted(unpacked_local_maps(set.name)->string()) + " " +
                              shell_quoted(scratch.file("map.g2o")) + " >" +
                              shell_quoted(scratch.file("out"));
  if (std::system(command.c_str()) != 0) return std::nullopt;
  double value = 0.0;
  if (std::sscanf(read_text(scratch.file("out")).c_str(), "chi2 %lf", &value) != 1) {
    return std::nullopt;
  }
  return value;
}

TEST(OptimumInSpace, IsTheSameByDivideAndConquerAndSequentially) {
  const auto problem = load(kSpatialMaps);
  if (!problem) GTEST_SKIP() << missing(kSpatialMaps);
  const auto& p = std::get<Problem<3>>(*problem);
  for (const Strategy strategy : {Strategy::kDivideAndConquer, Strategy::kSequential}) {
    JoinOptions options;
    options.strategy = strategy;
    const JoinResult<3> result = p.join(options);
    EXPECT_NEAR(chi2(single_map(result).values, p.graph), kSpatialMapsOptimum,
                kTolerance * kSpatialMapsOptimum);
    const auto in_angles = judged(kSpatialMaps, result.maps[0]);
    if (!in_angles) GTEST_SKIP() << "no python3, or no tool that judges in Euler angles";
    EXPECT_LT(*in_angles, 310.853);  // Linear SLAM
  }
}

TEST(OptimumInSpace, OfTheSphereInEulerAngles) {
  const auto problem = load(kSphereMaps);
  if (!problem) GTEST_SKIP() << missing(kSphereMaps);
  const auto& p = std::get<Problem<3>>(*problem);
  const JoinResult<3> result = p.join({});
  EXPECT_LE(chi2(single_map(result).values, p.graph), 1155.0);
  const auto in_angles = judged(kSphereMaps, result.maps[0]);
  if (!in_angles) GTEST_SKIP() << "no python3, or no tool that judges in Euler angles";
  EXPECT_LE(*in_angles, 1155.0);
}

/// 0 .. n-1 in an order that is the same everywhere.
std::vector<std::size_t> shuffled(std::size_t n, std::mt19937_64& random) {
  std::vector<std::size_t> order(n);
  std::iota(order.begin(), order.end(), std::size_t{0});
  for (std::size_t k = n; k > 1; --k) std::swap(order[k - 1], order[random() % k]);
  return order;
}

/// The same poses under each other's names, measurements in another order.
template <int D>
MeasurementGraph<D> shuffled(const MeasurementGraph<D>& graph, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const std::vector<std::size_t> names =
      shuffled(static_cast<std::size_t>(graph.variables.size()), random);
  const auto renamed = [&](const Key& key) {
    const int variable = graph.variables.require(key, "renaming");
    return graph.variables.key(static_cast<int>(names[static_cast<std::size_t>(variable)]));
  };
  const Edges<D> edges(graph);
  MeasurementGraphBuilder<D> builder;
  for (const std::size_t e : shuffled(edges.size(), random)) {
    edges.add_to(builder, e, renamed(edges.from(e)), renamed(edges.to(e)));
  }
  return std::move(builder).build();
}

class ShuffledIds : public testing::TestWithParam<DataSet> {};

TEST_P(ShuffledIds, ReachTheSameOptimum) {
  const auto problem = load(GetParam());
  if (!problem) GTEST_SKIP() << missing(GetParam());
  std::visit(
      [&]<int D>(const Problem<D>& p) {
        for (std::uint64_t seed = 1; seed <= 5; ++seed) {
          SCOPED_TRACE(seed);
          const MeasurementGraph<D> graph = shuffled(p.graph, seed);
          JoinOptions options;
          options.information = false;
          const JoinResult<D> result = join_all(graph, options);
          const double optimum = GetParam().optimum;
          EXPECT_NEAR(chi2(single_map(result).values, graph), optimum, kTolerance * optimum);
        }
      },
      *problem);
}

INSTANTIATE_TEST_SUITE_P(, ShuffledIds, testing::ValuesIn(kPoseGraphs), name_of);

class Threads : public testing::TestWithParam<DataSet> {};

TEST_P(Threads, DoNotChangeABit) {
  const auto problem = load(GetParam());
  if (!problem) GTEST_SKIP() << missing(GetParam());
  std::visit(
      [&]<int D>(const Problem<D>& p) {
        for (const Mode mode : {Mode::kOptimal, Mode::kSummary}) {
          JoinOptions options;
          options.mode = mode;
          const JoinResult<D> one = p.join(options);
          for (const int threads : {2, 3}) {
            options.threads = threads;
            const JoinResult<D> many = p.join(options);
            EXPECT_EQ(one.report.chi2, many.report.chi2);
            ASSERT_EQ(one.maps.size(), many.maps.size());
            EXPECT_TRUE(one.maps[0].information == many.maps[0].information);
            for (int i = 0; i < one.maps[0].values.size(); ++i) {
              const auto size =
                  static_cast<std::size_t>(one.maps[0].variables().kind(i).value_size);
              ASSERT_TRUE(std::equal(one.maps[0].values.value(i),
                                     one.maps[0].values.value(i) + size,
                                     many.maps[0].values.value(i)))
                  << to_string(one.maps[0].variables().key(i));
            }
          }
        }
      },
      *problem);
}

INSTANTIATE_TEST_SUITE_P(, Threads,
                         testing::Values(DataSet{"pose_graphs", "city_10000"},
                                         DataSet{"pose_graphs", "sphere_2500"},
                                         DataSet{"pose_graphs", "torus_5000"},
                                         DataSet{"landmark_graphs", "victoria_park"},
                                         DataSet{"local_maps", "simu_35188_700"},
                                         DataSet{"local_maps", "simu3d_870"}),
                         name_of);

}  // namespace
}  // namespace mapjoin::test
