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
EkfJoin<D> ekf_joined(const std::vector<LocalMap<D>>& maps) {
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
  const EkfJoin<D> filter = ekf_joined<D>({chain.maps[0]});
  const Map<D> local = to_map(chain.maps[0]);
  EXPECT_LT(distance(filter.values(), local.values), 1e-12);
  const std::vector<Key> keys = keys_of(local.values);
  EXPECT_LT(relative_distance(filter.covariance(keys), Covariance<D>(local).of(keys)), 1e-8);
}

TYPED_TEST(EkfFilter, KeepsTheLastPoseAndTheFeatures) {
  constexpr int D = TypeParam::value;
  const auto chain = random_chain<D>(2);
  const EkfJoin<D> filter = ekf_joined<D>(chain.maps);
  for (const Key& key : without_anchor(filter))
    EXPECT_TRUE(key.type == Tag("point") || key == pose_key(12)) << to_string(key);
  EXPECT_EQ(filter.scalars() + kGauge<D>, filter.values().variables().scalars());
}

/// Where estimates agree with what is measured, both linearise at the same place: then a filter
/// that drops poses and one that keeps them know the rest equally well.
TYPED_TEST(EkfFilter, IsAsCertainAsSlsjfOnExactLocalMaps) {
  constexpr int D = TypeParam::value;
  const auto chain = random_chain<D>(3, {.noise = 0.0});
  const EkfJoin<D> filter = ekf_joined<D>(chain.maps);
  EXPECT_LT(common_distance(filter.values(), chain.truth), 1e-7);
  Slsjf<D> information;
  for (const LocalMap<D>& map : chain.maps) information.fuse(map);
  const std::vector<Key> keys = without_anchor(filter);
  EXPECT_LT(relative_distance(filter.covariance(keys), information.covariance(keys)), 1e-6);
}

/// And it linearises where SLSJF does, on noisy ones too.
TYPED_TEST(EkfFilter, IsTheCovarianceFormOfSlsjf) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const auto chain = random_chain<D>(seed, {.noise = 0.05, .turn = 1.0});
    EkfJoin<D> filter;
    Slsjf<D> information;
    for (const LocalMap<D>& map : chain.maps) {
      filter.fuse(map);
      information.fuse(map);
      EXPECT_LT(common_distance(filter.values(), information.values()), 1e-6);
    }
    const std::vector<Key> keys = without_anchor(filter);
    EXPECT_LT(relative_distance(filter.covariance(keys), information.covariance(keys)), 1e-6);
  }
}

TYPED_TEST(EkfFilter, GivesAMapOfTheSameCovariance) {
  constexpr int D = TypeParam::value;
  const auto chain = random_chain<D>(5, {.noise = 0.02});
  const EkfJoin<D> filter = ekf_joined<D>(chain.maps);
  const std::vector<Key> keys = keys_of(filter.values());
  EXPECT_LT(relative_distance(Covariance<D>(filter.map()).of(keys), filter.covariance(keys)), 1e-6);
  EXPECT_EQ(filter.map().anchor, pose_anchor<D>(pose_key(0)));
}

TYPED_TEST(EkfFilter, RefusesAMapThatBeginsElsewhere) {
  constexpr int D = TypeParam::value;
  const auto chain = random_chain<D>(6);
  EkfJoin<D> filter = ekf_joined<D>({chain.maps[0]});
  const std::string message = complaint_of<DisconnectedError>([&] { filter.fuse(chain.maps[2]); });
  EXPECT_NE(message.find("pose:2 does not begin where the one before it ends"), std::string::npos)
      << message;
  EXPECT_EQ(filter.fused(), 1);
  EXPECT_THROW(EkfJoin<D>().map(), InputError);
}

}  // namespace
}  // namespace mapjoin
