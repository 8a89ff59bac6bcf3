// Map joining by an extended Kalman filter: the covariance form of what SLSJF does in information
// form.

#include <gtest/gtest.h>

#include "mapjoin/filtering/ekf_join.h"
#include "mapjoin/joining/join.h"
#include "mapjoin/solvers/covariance.h"
#include "tests/support/local_map_chain.h"

namespace mapjoin {
namespace {

using namespace test;  // NOLINT

template <class T>
class EkfFilter : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(EkfFilter, Dimensions);

template <int D>
EkfJoin<D> fused(const std::vector<LocalMap<D>>& maps) {
  EkfJoin<D> filter;
  for (const LocalMap<D>& map : maps) filter.fuse(map);
  return filter;
}

template <int D>
std::vector<Key> without_anchor(const EkfJoin<D>& filter) {
  std::vector<Key> keys = keys_of(filter.values());
  std::erase(keys, pose_key(0));
  return keys;
}

TYPED_TEST(EkfFilter, OfOneLocalMapIsThatMap) {
  constexpr int D = TypeParam::value;
  const auto chain = random_chain<D>(1);
  const EkfJoin<D> filter = fused<D>({chain.maps[0]});
  const Map<D> local = to_map(chain.maps[0]);
  EXPECT_LT(distance(filter.values(), local.values), 1e-12);
  const std::vector<Key> keys = keys_of(local.values);
  EXPECT_LT(relative_distance(filter.covariance(keys), Covariance<D>(local).of(keys)), 1e-8);
}

TYPED_TEST(EkfFilter, KeepsTheLastPoseAndTheFeatures) {
  constexpr int D = TypeParam::value;
  const auto chain = random_chain<D>(2);
  const EkfJoin<D> filter = fused<D>(chain.maps);
  for (const Key& key : without_anchor(filter))
    EXPECT_TRUE(key.type == Tag("point") || key == pose_key(12)) << to_string(key);
  EXPECT_EQ(filter.scalars() + kGauge<D>, filter.values().variables().scalars());
}

/// Where estimates agree with what is measured, both linearise at the same place: then a filter
/// that drops poses and one that keeps them know the rest equally well.
TYPED_TEST(EkfFilter, IsAsCertainAsSlsjfOnExactLocalMaps) {
  constexpr int D = TypeParam::value;
  const auto chain = random_chain<D>(3, {.noise = 0.0});
  const EkfJoin<D> filter = fused<D>(chain.maps);
  EXPECT_LT(common_distance(filter.values(), chain.truth), 1e-7);
  Slsjf<D> information;
  for (const LocalMap<D>& map : chain.maps) information.fuse(map);
  const std::vector<Key> keys = without_anchor(filter);
  EXPECT_LT(relative_distance(filter.covariance(keys), information.covariance(keys)), 1e-6);
}

TYPED_TEST(EkfFilter, EstimatesWithinATenthOfASigmaOfSlsjf) {
  constexpr int D = TypeParam::value;
  // Consistent local maps: noise of 0.01 and information about 100 / 0.01^2 would be overconfident.
  const auto chain = random_chain<D>(4, {.noise = 0.005});
  const EkfJoin<D> filter = fused<D>(chain.maps);
  Slsjf<D> information;
  for (const LocalMap<D>& map : chain.maps) information.fuse(map);
  for (const Key& key : without_anchor(filter)) {
    if (key.type != Tag("point")) continue;
    const Eigen::MatrixXd P = filter.covariance(std::span(&key, 1));
    const Vec<D> error = filter.values().point(key) - information.values().point(key);
    for (int s = 0; s < D; ++s) EXPECT_LT(std::abs(error(s)), 0.1 * std::sqrt(P(s, s)));
  }
}

TYPED_TEST(EkfFilter, GivesAMapOfTheSameCovariance) {
  constexpr int D = TypeParam::value;
  const auto chain = random_chain<D>(5, {.noise = 0.02});
  const EkfJoin<D> filter = fused<D>(chain.maps);
  const std::vector<Key> keys = keys_of(filter.values());
  EXPECT_LT(relative_distance(Covariance<D>(filter.map()).of(keys), filter.covariance(keys)), 1e-6);
  EXPECT_EQ(filter.map().anchor, pose_anchor<D>(pose_key(0)));
}

TYPED_TEST(EkfFilter, RefusesAMapThatBeginsElsewhere) {
  constexpr int D = TypeParam::value;
  const auto chain = random_chain<D>(6);
  EkfJoin<D> filter = fused<D>({chain.maps[0]});
  const std::string message = complaint_of<DisconnectedError>([&] { filter.fuse(chain.maps[2]); });
  EXPECT_NE(message.find("pose:2 does not begin where the one before it ends"), std::string::npos)
      << message;
  EXPECT_EQ(filter.fused(), 1);
  EXPECT_THROW(EkfJoin<D>().map(), InputError);
}

}  // namespace
}  // namespace mapjoin
