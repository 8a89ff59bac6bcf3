#include "mapjoin/graph/measurement_graph.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "tests/support/random_maps.h"

namespace mapjoin {
namespace {

using namespace test;  // NOLINT
using ::testing::HasSubstr;

template <class T>
class Builder : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(Builder, Dimensions);

/// A relative measurement, by keys: what must come out as it went in.
struct Line {
  Key from, to;
  std::vector<double> z, info;
  friend auto operator<=>(const Line&, const Line&) = default;
};

template <int D>
std::vector<Line> lines_of(const MeasurementGraph<D>& graph) {
  std::vector<Line> out;
  for (const auto& c : graph.relative) {
    const auto size = static_cast<std::ptrdiff_t>(c.kind->value_size);
    const auto square = static_cast<std::ptrdiff_t>(c.kind->dim) * c.kind->dim;
    for (std::size_t k = 0; k < c.size(); ++k) {
      const auto at = static_cast<std::ptrdiff_t>(k);
      out.push_back({graph.variables.key(c.from[k]),
                     graph.variables.key(c.to[k]),
                     {c.z.begin() + at * size, c.z.begin() + (at + 1) * size},
                     {c.info.begin() + at * square, c.info.begin() + (at + 1) * square}});
    }
  }
  std::sort(out.begin(), out.end());
  return out;
}

template <int D>
Line random_line(Dice& dice, MeasurementGraphBuilder<D>& builder, std::uint64_t range,
                 std::uint32_t sessions, std::uint64_t first = 0) {
  const auto session = [&] {
    return static_cast<std::uint32_t>(dice.below(static_cast<int>(sessions)));
  };
  const auto id = [&] { return first + dice.generator()() % range; };
  Line line;
  line.from = pose_key(id(), session());
  const auto note = [&](const auto& z, const auto& I) {
    const auto* x = reinterpret_cast<const double*>(&z);
    line.z.assign(x, x + sizeof(z) / sizeof(double));
    line.info.assign(I.data(), I.data() + I.size());
  };
  constexpr int G = kGauge<D>;
  if (dice.below(2) == 0) {
    do line.to = pose_key(id(), session());
    while (line.to == line.from);
    const Rigid<D> z = random_pose<D>(dice);
    const Mat<G, G> I = dice.definite(G);
    builder.template add<PoseType<D>>(line.from, line.to, z, I);
    note(z, I);
  } else {
    line.to = point_key(id(), session());
    const Vec<D> z = random_point<D>(dice);
    const Mat<D, D> I = dice.definite(D);
    builder.template add<PointType<D>>(line.from, line.to, z, I);
    note(z, I);
  }
  return line;
}

TYPED_TEST(Builder, KeepsEveryMeasurementWhateverTheIds) {
  constexpr int D = TypeParam::value;
  struct Case {
    std::uint64_t range;
    std::uint32_t sessions;
    std::uint64_t first;
  };
  for (const Case& c : {Case{30, 1, 0}, Case{30, 1, ~std::uint64_t{0} - 40}, Case{30, 3, 5},
                        Case{1000000007, 1, 0}, Case{~std::uint64_t{0}, 2, 0}}) {
    SCOPED_TRACE(c.range);
    Dice dice(c.range + c.sessions);
    MeasurementGraphBuilder<D> builder;
    std::vector<Line> expected;
    std::set<Key> keys;
    for (int k = 0; k < 100; ++k) {
      expected.push_back(random_line<D>(dice, builder, c.range, c.sessions, c.first));
      if (k % 3 == 0) {  // the same again is another measurement
        const Line& l = expected.back();
        const auto& kind =
            l.to.type == Tag("pose") ? kind_of<PoseType<D>>() : kind_of<PointType<D>>();
        builder.add(kind, l.from, l.to, l.z.data(), l.info.data());
        expected.push_back(l);
      }
    }
    for (const Line& l : expected) keys.insert({l.from, l.to});
    const MeasurementGraph<D> graph = std::move(builder).build();
    std::sort(expected.begin(), expected.end());
    EXPECT_EQ(lines_of(graph), expected);
    EXPECT_EQ(graph.size(), expected.size());
    std::size_t residuals = 0;
    for (const Line& l : expected)
      residuals += l.to.type == Tag("pose") ? static_cast<std::size_t>(kGauge<D>) : D;
    EXPECT_EQ(graph.residuals(), residuals);
    ASSERT_EQ(static_cast<std::size_t>(graph.variables.size()), keys.size());
    for (const Key& key : keys) EXPECT_TRUE(graph.variables.find(key).has_value());
  }
}

TYPED_TEST(Builder, RefusesWhatSaysNothing) {
  constexpr int D = TypeParam::value;
  constexpr int G = kGauge<D>;
  MeasurementGraphBuilder<D> builder;
  const Mat<G, G> I = Mat<G, G>::Identity();
  EXPECT_THAT(complaint_of<InputError>([&] {
                builder.template add<PoseType<D>>(pose_key(3), pose_key(3), Rigid<D>(), I);
              }),
              HasSubstr("pose:3"));
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), -std::numeric_limits<double>::infinity()}) {
    Rigid<D> z;
    z.t(1) = bad;
    EXPECT_THAT(complaint_of<InputError>(
                    [&] { builder.template add<PoseType<D>>(pose_key(3), pose_key(4), z, I); }),
                HasSubstr("pose:4"));
    Mat<D, D> broken = Mat<D, D>::Identity();
    broken(0, 1) = bad;
    EXPECT_THAT(complaint_of<InputError>([&] {
                  builder.template add<PointType<D>>(pose_key(3), point_key(9), Vec<D>::Zero(),
                                                     broken);
                }),
                HasSubstr("point:9"));
  }
  const MeasurementGraph<D> graph = std::move(builder).build();
  EXPECT_EQ(graph.size(), 0U);
  EXPECT_EQ(graph.variables.size(), 0) << "what was refused leaves nothing behind";
}

TYPED_TEST(Builder, RefusesMeasurementsFromWhatIsNoPose) {
  constexpr int D = TypeParam::value;
  MeasurementGraphBuilder<D> builder;
  EXPECT_THAT(complaint_of<InputError>([&] {
                builder.template add<PointType<D>>(point_key(1), point_key(2), Vec<D>::Zero(),
                                                   Mat<D, D>::Identity());
              }),
              HasSubstr("point:1"));
}

TYPED_TEST(Builder, RefusesKeysOfAnotherTypeThanTheirValue) {
  constexpr int D = TypeParam::value;
  MeasurementGraphBuilder<D> builder;
  EXPECT_THAT(complaint_of<InputError>([&] {
                builder.template add<PointType<D>>(pose_key(1), pose_key(2), Vec<D>::Zero(),
                                                   Mat<D, D>::Identity());
              }),
              HasSubstr("pose:2"));
  LocalMap<D> map;
  map.anchor = pose_anchor<D>(pose_key(0));
  map.template add_term<PointType<D>>(pose_key(3), Vec<D>::Zero());
  map.information = SymmetricBlockMatrix({0, D}, {});
  EXPECT_THAT(complaint_of<InputError>([&] { builder.add(map); }), HasSubstr("pose:3"));
}

/// A local map of poses 1.. and points, whose information couples only within the given groups.
template <int D>
LocalMap<D> grouped(Dice& dice, const std::vector<std::vector<Key>>& groups) {
  LocalMap<D> map;
  map.anchor = pose_anchor<D>(pose_key(0));
  std::vector<int> offsets{0};
  std::vector<Key> keys;
  std::vector<std::size_t> group_of;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    for (const Key& key : groups[g]) {
      keys.push_back(key);
      group_of.push_back(g);
    }
  }
  std::vector<std::size_t> order(keys.size());
  std::iota(order.begin(), order.end(), 0U);
  std::shuffle(order.begin(), order.end(), dice.generator());
  std::vector<std::size_t> group;
  for (const std::size_t k : order) {
    group.push_back(group_of[k]);
    if (keys[k].type == Tag("pose")) {
      map.template add_term<PoseType<D>>(keys[k], random_pose<D>(dice));
    } else {
      map.template add_term<PointType<D>>(keys[k], random_point<D>(dice));
    }
    offsets.push_back(offsets.back() + map.kinds.back()->dim);
  }
  Eigen::MatrixXd I = dice.definite(offsets.back());
  for (std::size_t i = 0; i < group.size(); ++i) {
    for (std::size_t j = 0; j < group.size(); ++j) {
      if (group[i] == group[j]) continue;
      I.block(offsets[i], offsets[j], offsets[i + 1] - offsets[i], offsets[j + 1] - offsets[j])
          .setZero();
    }
  }
  map.information = SymmetricBlockMatrix::from_dense(offsets, I);
  return map;
}

TYPED_TEST(Builder, SplitsALocalMapIntoItsIndependentParts) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    const LocalMap<D> map = grouped<D>(dice, {{pose_key(1)},
                                              {point_key(1), pose_key(2), point_key(3)},
                                              {point_key(2)},
                                              {pose_key(4), pose_key(4)},
                                              {point_key(9)}});  // pose 4 is a term twice
    MeasurementGraphBuilder<D> builder;
    builder.add(map);
    const MeasurementGraph<D> graph = std::move(builder).build();
    EXPECT_EQ(lines_of(graph).size(), 3U);
    ASSERT_EQ(graph.submaps.size(), 2U);
    EXPECT_EQ(graph.size(), 5U);
    EXPECT_EQ(graph.variables.size(), 8);
    // All of the information, block by block, and all of the values are somewhere.
    double sum = 0.0, found = 0.0;
    const Eigen::MatrixXd I = map.information.dense();
    sum = I.squaredNorm();
    for (const Line& l : lines_of(graph)) {
      for (const double v : l.info) found += v * v;
    }
    const auto& maps = graph.submaps;
    for (std::size_t m = 0; m < maps.size(); ++m) {
      for (auto b = static_cast<std::size_t>(maps.block_start[m]);
           b < static_cast<std::size_t>(maps.block_start[m + 1]); ++b) {
        ASSERT_GE(maps.block_row[b], maps.block_column[b]);
        const auto first = static_cast<std::size_t>(maps.term_start[m]);
        const int rows = graph.variables.dim(
            maps.term_variable[first + static_cast<std::size_t>(maps.block_row[b])]);
        const int columns = graph.variables.dim(
            maps.term_variable[first + static_cast<std::size_t>(maps.block_column[b])]);
        const Eigen::Map<const Eigen::MatrixXd> block(maps.information.data() + maps.block_value[b],
                                                      rows, columns);
        found += (maps.block_row[b] == maps.block_column[b] ? 1.0 : 2.0) * block.squaredNorm();
      }
      for (auto t = static_cast<std::size_t>(maps.term_start[m]) + 1;
           t < static_cast<std::size_t>(maps.term_start[m + 1]); ++t)
        EXPECT_LE(maps.term_variable[t - 1], maps.term_variable[t]) << "sorted by variable";
    }
    EXPECT_NEAR(found, sum, 1e-9 * sum);
  }
}

TYPED_TEST(Builder, ReportsALocalMapThatIsNotFinite) {
  constexpr int D = TypeParam::value;
  Dice dice(2);
  for (const bool value : {true, false}) {
    LocalMap<D> map = grouped<D>(dice, {{point_key(1), point_key(2)}});
    if (value) map.values[D] = std::numeric_limits<double>::quiet_NaN();
    if (!value) map.information.values()[0] = std::numeric_limits<double>::infinity();
    MeasurementGraphBuilder<D> builder;
    EXPECT_THAT(complaint_of<InputError>([&] { builder.add(map); }), HasSubstr("point:"));
  }
}

TYPED_TEST(Builder, ReportsALocalMapWhoseInformationIsOfAnotherSize) {
  constexpr int D = TypeParam::value;
  Dice dice(3);
  for (const int terms : {1, 3}) {
    LocalMap<D> map = grouped<D>(dice, {{point_key(1), point_key(2)}});
    map.information = SymmetricBlockMatrix::from_dense(
        terms == 1 ? std::vector<int>{0, D} : std::vector<int>{0, D, 2 * D, 3 * D},
        dice.definite(terms * D));
    MeasurementGraphBuilder<D> builder;
    EXPECT_THROW(builder.add(map), InputError) << terms;
  }
}

TYPED_TEST(Builder, AddsGraphsToGraphs) {
  constexpr int D = TypeParam::value;
  Dice dice(4);
  MeasurementGraphBuilder<D> one, two, both, again;
  for (int k = 0; k < 20; ++k) random_line<D>(dice, one, 20, 1);
  for (int k = 0; k < 20; ++k) random_line<D>(dice, two, 20, 2);
  const LocalMap<D> a = grouped<D>(dice, {{pose_key(1), point_key(50)}});
  const LocalMap<D> b = grouped<D>(dice, {{pose_key(40), point_key(3), pose_key(40)}});
  one.add(a);
  two.add(b);
  const MeasurementGraph<D> first = std::move(one).build();
  const MeasurementGraph<D> second = std::move(two).build();
  both.add(first);
  both.add(second);
  const MeasurementGraph<D> sum = std::move(both).build();
  std::vector<Line> expected = lines_of(first);
  const auto more = lines_of(second);
  expected.insert(expected.end(), more.begin(), more.end());
  std::sort(expected.begin(), expected.end());
  EXPECT_EQ(lines_of(sum), expected);
  ASSERT_EQ(sum.submaps.size(), 2U);
  // Taken apart again, the second submap is what it was.
  const std::int64_t last = static_cast<std::int64_t>(sum.size()) - 1;
  const MeasurementGraph<D> part = subgraph(sum, {&last, 1});
  again.add(b);
  const MeasurementGraph<D> alone = std::move(again).build();
  EXPECT_EQ(part.variables, alone.variables);
  EXPECT_EQ(part.submaps.values, alone.submaps.values);
  EXPECT_EQ(part.submaps.information, alone.submaps.information);
  EXPECT_EQ(part.submaps.term_variable, alone.submaps.term_variable);
  EXPECT_EQ(part.submaps.block_value, alone.submaps.block_value);
}

TYPED_TEST(Builder, SubgraphsHoldTheObservationsAndTheirVariablesOnly) {
  constexpr int D = TypeParam::value;
  Dice dice(5);
  const auto sample = random_graph<D>(dice, {.poses = 15, .points = 8});
  const MeasurementGraph<D>& graph = sample.graph;
  const auto n = static_cast<std::int64_t>(graph.size());
  std::vector<std::int64_t> odd;
  for (std::int64_t k = 1; k < n; k += 2) odd.push_back(k);
  const MeasurementGraph<D> part = subgraph(graph, std::span<const std::int64_t>(odd));
  EXPECT_EQ(part.size(), odd.size());
  std::set<Key> keys;
  for (const Line& l : lines_of(part)) keys.insert({l.from, l.to});
  EXPECT_EQ(static_cast<std::size_t>(part.variables.size()), keys.size());
  std::vector<Line> all = lines_of(graph);
  for (const Line& l : lines_of(part)) EXPECT_TRUE(std::binary_search(all.begin(), all.end(), l));
}

TYPED_TEST(Builder, CliquesNameAnchorFirstAndEveryVariableOnce) {
  constexpr int D = TypeParam::value;
  Dice dice(6);
  MeasurementGraphBuilder<D> builder;
  builder.add(grouped<D>(dice, {{pose_key(3), point_key(1), pose_key(3), point_key(2)}}));
  random_line<D>(dice, builder, 20, 1);
  const MeasurementGraph<D> graph = std::move(builder).build();
  const CliqueList list = cliques(graph);
  ASSERT_EQ(list.size(), 2U);
  std::vector<Key> submap;
  for (auto k = list.start[1]; k < list.start[2]; ++k)
    submap.push_back(graph.variables.key(list.variables[static_cast<std::size_t>(k)]));
  EXPECT_EQ(submap[0], pose_key(0));
  EXPECT_THAT(submap, ::testing::UnorderedElementsAre(pose_key(0), pose_key(3), point_key(1),
                                                      point_key(2)));
}

TYPED_TEST(Builder, ComponentsShareNoVariableAndComeInOrderOfTheirLowestKey) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 15; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    MeasurementGraphBuilder<D> builder;
    for (int k = 0; k < 25; ++k) random_line<D>(dice, builder, 25, 1);
    const MeasurementGraph<D> graph = std::move(builder).build();
    // Components by relabelling until nothing changes.
    std::map<Key, Key> label;
    for (const Line& l : lines_of(graph)) label[l.from] = l.from, label[l.to] = l.to;
    for (bool changed = true; changed;) {
      changed = false;
      for (const Line& l : lines_of(graph)) {
        const Key low = std::min(label[l.from], label[l.to]);
        changed = changed || label[l.from] != low || label[l.to] != low;
        label[l.from] = label[l.to] = low;
      }
    }
    std::map<Key, std::set<Key>> expected;
    for (const auto& [key, low] : label) expected[low].insert(key);
    const auto parts = connected_components(graph);
    ASSERT_EQ(parts.size(), expected.size());
    std::size_t at = 0, observations = 0;
    for (const auto& [low, keys] : expected) {
      const auto& part = parts[at++];
      observations += part.size();
      ASSERT_EQ(static_cast<std::size_t>(part.variables.size()), keys.size());
      for (const Key& key : keys) EXPECT_TRUE(part.variables.find(key).has_value());
    }
    EXPECT_EQ(observations, graph.size());
  }
}

}  // namespace
}  // namespace mapjoin
