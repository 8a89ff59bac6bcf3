#include "mapjoin/graph/values.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "tests/support/random_maps.h"
#include "tests/support/user_types.h"

namespace mapjoin {
namespace {

using test::complaint_of;
using test::Dice;
using ::testing::HasSubstr;

/// Random keys of poses, points and walls, in random order, some of them twice.
std::vector<Key> random_keys(Dice& dice, int n, int range) {
  std::vector<Key> out;
  for (int k = 0; k < n; ++k) {
    const auto id = static_cast<std::uint64_t>(dice.below(range));
    const auto session = static_cast<std::uint32_t>(dice.below(2));
    const char* const names[] = {"pose", "point", "wall"};
    out.push_back({Tag(names[dice.below(3)]), session, id});
  }
  return out;
}

VariableSet<2> set_of(const std::vector<Key>& keys) {
  std::vector<VariableSet<2>::Column> columns(3);
  columns[0].kind = &kind_of<test::Wall>();
  columns[1].kind = &kind_of<Pose2>();
  columns[2].kind = &kind_of<Point2>();
  for (const Key& key : keys) {
    for (auto& c : columns) {
      if (c.kind->tag == key.type) c.keys.push_back(key);
    }
  }
  return VariableSet<2>(std::move(columns));
}

std::vector<Key> keys_of(const VariableSet<2>& set) {
  std::vector<Key> out;
  for (int i = 0; i < set.size(); ++i) out.push_back(set.key(i));
  return out;
}

TEST(VariableSet, NumbersItsKeysInOrderOnce) {
  Dice dice(1);
  for (int round = 0; round < 50; ++round) {
    const std::vector<Key> keys = random_keys(dice, dice.below(60), 30);
    const VariableSet<2> set = set_of(keys);
    const std::set<Key> expected(keys.begin(), keys.end());
    ASSERT_EQ(keys_of(set), std::vector<Key>(expected.begin(), expected.end()));
    int scalar = 0;
    const auto offsets = set.offsets();
    const auto dims = set.dims();
    for (int i = 0; i < set.size(); ++i) {
      const int dim = set.key(i).type == Tag("pose") ? 3 : 2;
      EXPECT_EQ(set.offset(i), scalar);
      EXPECT_EQ(offsets[static_cast<std::size_t>(i)], scalar);
      EXPECT_EQ(set.dim(i), dim);
      EXPECT_EQ(dims[static_cast<std::size_t>(i)], dim);
      EXPECT_EQ(set.find(set.key(i)), i);
      scalar += dim;
    }
    EXPECT_EQ(set.scalars(), scalar);
    EXPECT_EQ(offsets.back(), scalar);
    EXPECT_FALSE(set.find(pose_key(1000)).has_value());
    EXPECT_FALSE(set.find(pose_key(1, 7)).has_value());
  }
}

TEST(VariableSet, UnitesLikeSets) {
  Dice dice(2);
  for (int round = 0; round < 50; ++round) {
    std::vector<VariableSet<2>> sets;
    std::set<Key> expected;
    for (int k = 0; k < 1 + dice.below(4); ++k) {
      const auto keys = random_keys(dice, dice.below(40), 50);
      expected.insert(keys.begin(), keys.end());
      sets.push_back(set_of(keys));
    }
    std::vector<const VariableSet<2>*> pointers;
    for (const auto& set : sets) pointers.push_back(&set);
    const VariableSet<2> all = unite<2>(pointers);
    EXPECT_EQ(keys_of(all), std::vector<Key>(expected.begin(), expected.end()));
    for (const auto& set : sets) {
      const std::vector<int> numbers = numbers_in(set, all);
      for (int i = 0; i < set.size(); ++i)
        EXPECT_EQ(all.key(numbers[static_cast<std::size_t>(i)]), set.key(i));
    }
  }
}

TEST(VariableSet, FindsTheNumbersOfASetInAnother) {
  Dice dice(3);
  for (int round = 0; round < 80; ++round) {
    // Also sets of very different size, where the sweep becomes a search.
    const VariableSet<2> a = set_of(random_keys(dice, dice.below(20), 400));
    const VariableSet<2> b = set_of(random_keys(dice, dice.below(1500), 400));
    for (const auto& [from, to] : {std::pair(&a, &b), std::pair(&b, &a)}) {
      const std::vector<int> numbers = numbers_in(*from, *to);
      for (int i = 0; i < from->size(); ++i)
        EXPECT_EQ(numbers[static_cast<std::size_t>(i)], to->find(from->key(i)).value_or(-1));
    }
  }
}

TEST(VariableSet, TakesSubsets) {
  Dice dice(4);
  for (int round = 0; round < 50; ++round) {
    const VariableSet<2> all = set_of(random_keys(dice, 60, 40));
    std::vector<int> numbers;
    std::vector<Key> expected;
    for (int i = 0; i < all.size(); ++i) {
      if (dice.below(3) > 0) continue;
      numbers.push_back(i);
      expected.push_back(all.key(i));
    }
    const VariableSet<2> part = subset(all, numbers);
    EXPECT_EQ(keys_of(part), expected);
    EXPECT_EQ(part, set_of(expected));
  }
}

TEST(VariableSet, RefusesKeysOfAnotherType) {
  std::vector<VariableSet<2>::Column> columns(1);
  columns[0].kind = &kind_of<Pose2>();
  columns[0].keys = {pose_key(1), point_key(2)};
  EXPECT_THAT(complaint_of<InputError>([&] { VariableSet<2> set(columns); }), HasSubstr("pose"));
  columns[0].keys = {pose_key(1)};
  columns.push_back(columns[0]);
  EXPECT_THAT(complaint_of<InputError>([&] { VariableSet<2> set(columns); }), HasSubstr("pose"));
}

TEST(VariableSet, SaysWhichKeyIsMissing) {
  const VariableSet<2> set = set_of({pose_key(3), pose_key(9)});
  const auto message = complaint_of<InputError>([&] { (void)set.require(point_key(4, 1), "why"); });
  EXPECT_THAT(message, HasSubstr("1/point:4"));
  EXPECT_THAT(message, HasSubstr("why"));
  EXPECT_THAT(message, HasSubstr("pose:3"));
}

TEST(VariableSet, RefusesToUniteDifferentTypesOfOneName) {
  VariableKind<2> other = kind_of<test::Wall>();
  other.dim = 1;
  std::vector<VariableSet<2>::Column> columns(1);
  columns[0].kind = &other;
  columns[0].keys = {Key{Tag("wall"), 0, 1}};
  const VariableSet<2> a(columns);
  const VariableSet<2> b = set_of({Key{Tag("wall"), 0, 2}});
  const VariableSet<2>* const sets[2] = {&a, &b};
  EXPECT_THAT(complaint_of<InputError>([&] { (void)unite<2>(sets); }), HasSubstr("wall"));
}

template <class T>
class ValuesIn : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(ValuesIn, Dimensions);

TYPED_TEST(ValuesIn, AreWhatWasAddedInAnyOrder) {
  constexpr int D = TypeParam::value;
  Dice dice(5);
  std::map<std::uint64_t, Rigid<D>> poses;
  std::map<std::uint64_t, Vec<D>> points;
  ValuesBuilder<D> builder;
  for (int k = 0; k < 100; ++k) {
    const auto id = dice.generator()() % 1000;
    if (dice.below(2) == 0) {
      if (points.emplace(id, test::random_point<D>(dice)).second)
        builder.template add<PointType<D>>(point_key(id), points[id]);
    } else if (poses.emplace(id, test::random_pose<D>(dice)).second) {
      builder.template add<PoseType<D>>(pose_key(id), poses[id]);
    }
  }
  const Values<D> values = std::move(builder).build();
  ASSERT_EQ(static_cast<std::size_t>(values.size()), poses.size() + points.size());
  for (const auto& [id, x] : poses) {
    EXPECT_EQ(values.pose(pose_key(id)).t, x.t);
    EXPECT_EQ(values.pose(pose_key(id)).R, x.R);
  }
  for (const auto& [id, x] : points) EXPECT_EQ(values.point(point_key(id)), x);
  EXPECT_EQ(values.template column<PoseType<D>>().size(), poses.size());
  EXPECT_EQ(values.template column<PoseType<D>>()[0].t, poses.begin()->second.t);
  EXPECT_THROW((void)values.pose(pose_key(5000)), InputError);
  EXPECT_THROW((void)values.point(pose_key(poses.begin()->first)), InputError);
}

TYPED_TEST(ValuesIn, AreRefusedTwiceOrNotFinite) {
  constexpr int D = TypeParam::value;
  const Rigid<D> x;
  ValuesBuilder<D> twice;
  twice.template add<PoseType<D>>(pose_key(5), x);
  twice.template add<PoseType<D>>(pose_key(4), x);
  twice.template add<PoseType<D>>(pose_key(5), x);
  EXPECT_THAT(complaint_of<InputError>([&] { (void)std::move(twice).build(); }),
              HasSubstr("pose:5"));
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    ValuesBuilder<D> builder;
    Vec<D> p = Vec<D>::Zero();
    builder.template add<PointType<D>>(point_key(1), p);
    p(1) = bad;
    builder.template add<PointType<D>>(point_key(77), p);
    EXPECT_THAT(complaint_of<InputError>([&] { (void)std::move(builder).build(); }),
                HasSubstr("point:77"));
  }
}

TYPED_TEST(ValuesIn, LocalUndoesRetract) {
  constexpr int D = TypeParam::value;
  Dice dice(6);
  const Values<D> x = test::random_values<D>(dice, test::ids(8), test::ids(9));
  Eigen::VectorXd d(x.variables().scalars());
  for (double& v : d) v = dice.uniform(-0.5, 0.5);
  Values<D> y = x;
  y.retract({d.data(), static_cast<std::size_t>(d.size())});
  EXPECT_LT(test::distance(x.local(y), d), 1e-12);
  const Values<D> other = test::random_values<D>(dice, test::ids(8), test::ids(8));
  EXPECT_THROW((void)x.local(other), InputError);
}

TYPED_TEST(ValuesIn, GaugeIsHowTheyMoveWithTheirMap) {
  constexpr int D = TypeParam::value;
  Dice dice(7);
  const Values<D> x = test::random_values<D>(dice, test::ids(5), test::ids(4));
  const Eigen::MatrixXd g = x.gauge();
  constexpr double h = 1e-6;
  for (int k = 0; k < kGauge<D>; ++k) {
    Eigen::VectorXd slope[2];
    for (const int side : {0, 1}) {
      Eigen::Matrix<double, kGauge<D>, 1> xi = Eigen::Matrix<double, kGauge<D>, 1>::Zero();
      xi(k) = side == 0 ? h : -h;
      Rigid<D> T;
      T.R = rotation_exp<D, double>(Vec<kRotation<D>>(xi.template tail<kRotation<D>>()));
      T.t = xi.template head<D>();
      Values<D> moved = x;
      moved.transform(T);
      slope[side] = x.local(moved);
    }
    EXPECT_LT(test::distance(g.col(k), (slope[0] - slope[1]) / (2 * h)), 1e-6);
  }
}

TYPED_TEST(ValuesIn, SubsetsKeepTheirValues) {
  constexpr int D = TypeParam::value;
  Dice dice(8);
  const Values<D> x = test::random_values<D>(dice, test::ids(8), test::ids(9));
  const std::vector<int> numbers{0, 3, 8, 9, 16};
  const Values<D> part = subset(x, numbers);
  ASSERT_EQ(part.size(), 5);
  for (int k = 0; k < part.size(); ++k) {
    const int from = numbers[static_cast<std::size_t>(k)];
    EXPECT_EQ(part.variables().key(k), x.variables().key(from));
    for (int s = 0; s < x.variables().kind(from).value_size; ++s)
      EXPECT_EQ(part.value(k)[s], x.value(from)[s]);
  }
}

}  // namespace
}  // namespace mapjoin
