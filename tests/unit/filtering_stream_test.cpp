// Local maps that arrive one at a time: the same maps as all at once, by every method, and features
// that go by other names.

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "mapjoin/association/arrivals.h"
#include "mapjoin/filtering/map_stream.h"
#include "mapjoin/filtering/methods.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/joining/join_all.h"
#include "mapjoin/solvers/covariance.h"
#include "tests/support/local_map_chain.h"
#include "tests/support/wandering.h"

namespace mapjoin {
namespace {

using namespace test;  // NOLINT

template <class T>
class Stream : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(Stream, Dimensions);

template <int D>
StreamOptions<D> by(StreamMethod method, Mode mode = Mode::kSummary) {
  StreamOptions<D> options;
  options.method = method;
  options.join.mode = mode;
  return options;
}

constexpr StreamMethod kAll[] = {StreamMethod::kDivideAndConquer, StreamMethod::kSlsjf,
                                 StreamMethod::kDslam, StreamMethod::kEkf};

TYPED_TEST(Stream, ByDivideAndConquerIsTheOrderTreeAfterEveryMap) {
  constexpr int D = TypeParam::value;
  const auto chain = random_chain<D>(1, {.noise = 0.02});
  for (const Mode mode : {Mode::kSummary, Mode::kObserve}) {
    MapStream<D> stream(by<D>(StreamMethod::kDivideAndConquer, mode));
    for (std::size_t n = 1; n <= chain.maps.size(); ++n) {
      stream.add(chain.maps[n - 1]);
      JoinOptions options;
      options.mode = mode;
      options.tree = TreeShape::kOrder;
      const auto whole = join_all(std::span(chain.maps).first(n), options);
      EXPECT_LT(distance(stream.current().values, whole.maps.at(0).values), 1e-9) << n;
    }
  }
}

TYPED_TEST(Stream, OfAFilterIsTheFilter) {
  constexpr int D = TypeParam::value;
  const auto chain = random_chain<D>(2, {.features = 60});
  const std::span<const LocalMap<D>> maps(chain.maps);
  const std::pair<StreamMethod, Method> pairs[] = {{StreamMethod::kSlsjf, Method::kSlsjf},
                                                   {StreamMethod::kEkf, Method::kEkf}};
  for (const auto& [method, same] : pairs) {
    MapStream<D> stream(by<D>(method));
    for (const LocalMap<D>& map : chain.maps) stream.add(map);
    EXPECT_LT(distance(stream.current().values, join_by(same, maps).map.values), 1e-9);
  }
}

TYPED_TEST(Stream, AnswersAfterEveryMap) {
  constexpr int D = TypeParam::value;
  const auto chain = random_chain<D>(3, {.features = 80, .noise = 0.0});
  for (const StreamMethod method : kAll) {
    MapStream<D> stream(by<D>(method));
    EXPECT_THROW(stream.current(), InputError);
    for (const LocalMap<D>& map : chain.maps) {
      stream.add(map);
      const Map<D> now = stream.current();
      EXPECT_EQ(now.anchor, pose_anchor<D>(pose_key(0)));
      EXPECT_LT(common_distance(now.values, chain.truth), 1e-6);
      const std::vector<Key> keys{now.values.variables().column(0).keys[0]};
      EXPECT_LT(relative_distance(stream.covariance(keys), Covariance<D>(now).of(keys)), 1e-6);
    }
    EXPECT_EQ(stream.size(), 12);
  }
}

/// Every local map counts its features from 0.
template <int D>
LocalMap<D> with_own_ids(LocalMap<D> map) {
  std::uint64_t next = 0;
  for (Key& key : map.keys) {
    if (key.type == Tag("point")) key.id = next++;
  }
  return map;
}

/// Matches features that lie within a centimetre, once the local map is placed at its start pose.
template <int D>
std::vector<std::pair<Key, Key>> match_by_position(const Map<D>& global, const Map<D>& local) {
  std::vector<std::pair<Key, Key>> out;
  const Rigid<D> T = global.values.pose(local.anchor.keys[0]);
  const int c = global.variables().find_column(Tag("point"));
  for (const Key& ours :
       local.variables().column(local.variables().find_column(Tag("point"))).keys) {
    for (const Key& theirs : global.variables().column(c).keys) {
      if ((T * local.values.point(ours) - global.values.point(theirs)).norm() < 0.01)
        out.emplace_back(ours, theirs);
    }
  }
  return out;
}

TYPED_TEST(Stream, FindsFeaturesAgainByAssociation) {
  constexpr int D = TypeParam::value;
  const auto chain = random_chain<D>(4, {.features = 60, .noise = 0.0});
  std::set<Key> seen;
  for (const LocalMap<D>& map : chain.maps) seen.insert(map.keys.begin(), map.keys.end());
  for (const StreamMethod method : {StreamMethod::kSlsjf, StreamMethod::kDivideAndConquer}) {
    StreamOptions<D> options = by<D>(method);
    options.associate = match_by_position<D>;
    MapStream<D> stream(options);
    for (const LocalMap<D>& map : chain.maps) stream.add(with_own_ids(map));
    const Map<D> map = stream.current();
    EXPECT_EQ(map.variables().size(), static_cast<int>(seen.size()) + 1);
    EXPECT_LT(distance(map.values.pose(pose_key(12)).t, chain.truth.pose(pose_key(12)).t), 1e-6);
    EXPECT_FALSE(stream.renamed().empty());
  }
}

/// SLSJF with data association (Algorithm 2): what arrives under any names is found by what the
/// stream knows by then, with its covariance.
TYPED_TEST(Stream, FindsFeaturesAgainByTheirCovariances) {
  constexpr int D = TypeParam::value;
  Dice dice(4);
  const Wandering<D> walk = wander<D>(dice, {});
  std::set<Key> seen;
  for (const LocalMap<D>& map : walk.maps) seen.insert(map.keys.begin(), map.keys.end());
  for (const StreamMethod method :
       {StreamMethod::kSlsjf, StreamMethod::kEkf, StreamMethod::kDivideAndConquer}) {
    StreamOptions<D> options = by<D>(method);
    options.associate = associate_arrivals<D>();
    MapStream<D> stream(options);
    std::map<Key, Key> came_as;  // of every point of the map, its true name
    int wrong = 0, matched = 0;
    for (const LocalMap<D>& map : walk.maps) {
      const LocalMap<D> hidden = with_own_ids(map);
      stream.add(hidden);
      std::map<Key, Key> now;  // hidden name, name in the map
      for (const Key& key : hidden.keys) now[key] = key;
      for (const auto& [ours, theirs] : stream.renamed()) now[ours] = theirs;
      for (std::size_t k = 0; k < map.keys.size(); ++k) {
        if (map.keys[k].type != Tag("point")) continue;
        const auto [known, fresh] = came_as.emplace(now[hidden.keys[k]], map.keys[k]);
        wrong += known->second == map.keys[k] ? 0 : 1;
      }
      matched += static_cast<int>(stream.matched().size());
      for (const auto& [ours, theirs] : stream.matched())
        EXPECT_EQ(now[ours], theirs) << "as it is called in the map";
    }
    EXPECT_EQ(wrong, 0);
    EXPECT_GT(matched, 50);
    EXPECT_LE(stream.current().variables().size(), static_cast<int>(1.1 * seen.size()));
  }
}

TYPED_TEST(Stream, RefusesImpossibleMatches) {
  constexpr int D = TypeParam::value;
  const auto chain = random_chain<D>(5);
  const auto refused = [&](std::vector<std::pair<Key, Key>> matches) {
    StreamOptions<D> options = by<D>(StreamMethod::kSlsjf);
    options.associate = [&](const Map<D>&, const Map<D>&) { return matches; };
    MapStream<D> stream(options);
    stream.add(chain.maps[0]);
    return complaint_of<InputError>([&] { stream.add(chain.maps[1]); });
  };
  const Key known = chain.maps[0].keys[1], ours = chain.maps[1].keys[1],
            other = chain.maps[1].keys[2];
  EXPECT_NE(refused({{point_key(900), known}}).find("point:900"), std::string::npos);
  EXPECT_NE(refused({{ours, point_key(901)}}).find("point:901"), std::string::npos);
  EXPECT_NE(refused({{ours, pose_key(1)}}).find("different types"), std::string::npos);
  EXPECT_NE(refused({{ours, known}, {other, known}}).find("already"), std::string::npos);
}

TEST(Methods, HaveNames) {
  for (const Method method : kMethods) EXPECT_EQ(parse_method(name(method)), method);
  EXPECT_THROW(parse_method("kalman"), InputError);
}

TYPED_TEST(Stream, EveryMethodFindsTheTruthInExactLocalMaps) {
  constexpr int D = TypeParam::value;
  const auto chain = random_chain<D>(6, {.features = 60, .noise = 0.0});
  for (const Method method : kMethods) {
    const FilterResult<D> result = join_by(method, std::span<const LocalMap<D>>(chain.maps));
    EXPECT_LT(common_distance(result.map.values, chain.truth), 1e-6) << name(method);
    EXPECT_EQ(result.map.values.contains(pose_key(5)), keeps_poses(method)) << name(method);
    EXPECT_LT(result.report.chi2, 1e-6);
  }
}

}  // namespace
}  // namespace mapjoin
