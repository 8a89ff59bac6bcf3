#include "mapjoin/frames/align.h"

#include <gtest/gtest.h>

#include <optional>
#include <vector>

#include "tests/support/random_maps.h"
#include "tests/support/user_types.h"

namespace mapjoin {
namespace {

using namespace test;  // NOLINT

template <class T>
class Align : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(Align, Dimensions);

template <int D>
void expect_same(const Rigid<D>& a, const Rigid<D>& b, double tolerance = 1e-11) {
  EXPECT_LT(distance(a.R, b.R), tolerance);
  EXPECT_LT(distance(a.t, b.t), tolerance * (1.0 + b.t.norm()));
}
template <int D>
Values<D> moved(Values<D> x, const Rigid<D>& T) {
  x.transform(T);
  return x;
}
template <int D>
Values<D> points(const std::vector<Vec<D>>& at) {
  ValuesBuilder<D> builder;
  for (std::size_t k = 0; k < at.size(); ++k)
    builder.template add<PointType<D>>(point_key(k), at[k]);
  return std::move(builder).build();
}

TYPED_TEST(Align, FindsTheMotionFromAnyMixThatFixesIt) {
  constexpr int D = TypeParam::value;
  for (const auto& [poses, features] : {std::pair(1, 0), {1, 1}, {0, D}, {2, 0}, {0, 9}, {5, 7}}) {
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      SCOPED_TRACE(testing::Message() << poses << " poses, " << features << " points, " << seed);
      Dice dice(seed);
      // Each map also holds variables that the other does not know.
      const Values<D> all = random_values<D>(dice, ids(poses + 6), ids(features + 6));
      std::vector<std::uint64_t> pose_a = ids(poses), pose_b = ids(poses);
      std::vector<std::uint64_t> point_a = ids(features), point_b = ids(features);
      for (int k = 0; k < 3; ++k) {
        pose_a.push_back(static_cast<std::uint64_t>(poses + k));
        pose_b.push_back(static_cast<std::uint64_t>(poses + 3 + k));
        point_a.push_back(static_cast<std::uint64_t>(features + k));
        point_b.push_back(static_cast<std::uint64_t>(features + 3 + k));
      }
      const Rigid<D> T = random_pose<D>(dice, 100.0);
      const auto found =
          align(part_of(all, pose_a, point_a), moved(part_of(all, pose_b, point_b), T.inverse()));
      ASSERT_TRUE(found.has_value());
      expect_same(*found, T);
    }
  }
}

TYPED_TEST(Align, FindsAHalfTurn) {
  constexpr int D = TypeParam::value;
  Dice dice(3);
  for (int k = 0; k < 20; ++k) {
    Rigid<D> T;
    if constexpr (D == 2) {
      T.R = -Mat<2, 2>::Identity();
    } else {
      const Eigen::Vector3d axis(dice.normal(), dice.normal(), dice.normal());
      T.R = Eigen::AngleAxisd(3.141592653589793, axis.normalized()).toRotationMatrix();
    }
    const Values<D> x = random_values<D>(dice, ids(2), ids(4));
    expect_same(align(x, moved(x, T)).value(), T.inverse());
  }
}

TYPED_TEST(Align, RefusesWhatDoesNotFixTheMotion) {
  constexpr int D = TypeParam::value;
  Dice dice(4);
  for (int round = 0; round < 20; ++round) {
    const Rigid<D> T = random_pose<D>(dice, 1000.0);
    const auto refuses = [&](const std::vector<Vec<D>>& at) {
      return !align(points<D>(at), moved(points<D>(at), T)).has_value();
    };
    const Vec<D> p = random_point<D>(dice), q = random_point<D>(dice);
    EXPECT_TRUE(refuses({}));
    EXPECT_TRUE(refuses({p}));
    EXPECT_TRUE(refuses({p, p, p}));
    if constexpr (D == 3) {
      EXPECT_TRUE(refuses({p, q}));
      EXPECT_TRUE(refuses({p, q, Vec<D>(0.3 * p + 0.7 * q)}));
      EXPECT_TRUE(refuses({p, q, Vec<D>(2.0 * p - q), Vec<D>(5.0 * q - 4.0 * p)}));
      EXPECT_FALSE(refuses({p, q, random_point<D>(dice)}));
    } else {
      EXPECT_FALSE(refuses({p, q}));
    }
  }
}

TYPED_TEST(Align, RefusesMapsThatShareNothing) {
  constexpr int D = TypeParam::value;
  Dice dice(5);
  EXPECT_FALSE(
      align(random_values<D>(dice, ids(4), ids(4)), random_values<D>(dice, ids(4, 10), ids(4, 10)))
          .has_value());
  EXPECT_FALSE(align(Values<D>(), Values<D>()).has_value());
}

TYPED_TEST(Align, DoesNotJoinBySharedBiases) {
  constexpr int D = TypeParam::value;
  Dice dice(6);
  const auto make = [&](int features) {
    ValuesBuilder<D> builder;
    for (std::uint64_t k = 0; k < 5; ++k)
      builder.template add<BiasType<D>>({Tag("bias"), 0, k}, Vec<1>(1.0));
    for (int k = 0; k < features; ++k)
      builder.template add<PointType<D>>(point_key(static_cast<std::uint64_t>(k)),
                                         random_point<D>(dice));
    return std::move(builder).build();
  };
  EXPECT_FALSE(align(make(0), make(0)).has_value());
  EXPECT_FALSE(align(make(D - 1), make(D - 1)).has_value());
}

TEST(AlignByWalls, ReturnsNoGuess) {
  // Two walls and a point fix a frame, but walls that offer no direction take no part in the fit.
  Dice dice(7);
  for (int round = 0; round < 10; ++round) {
    ValuesBuilder<2> builder;
    builder.add<Point2>(point_key(0), random_point<2>(dice));
    builder.add<Wall>({Tag("wall"), 0, 0}, {dice.uniform(-3, 3), 2.0});
    builder.add<Wall>({Tag("wall"), 0, 1}, {dice.uniform(-3, 3), 5.0});
    const Values<2> x = std::move(builder).build();
    EXPECT_FALSE(align(x, moved(x, random_pose<2>(dice).inverse())).has_value());
  }
}

Values<2> lines_and_points(const std::vector<own::Line::Value<double>>& lines,
                           const std::vector<Vec<2>>& at) {
  ValuesBuilder<2> builder;
  for (std::size_t k = 0; k < lines.size(); ++k) builder.add<own::Line>(own::line_key(k), lines[k]);
  for (std::size_t k = 0; k < at.size(); ++k) builder.add<Point2>(point_key(k), at[k]);
  return std::move(builder).build();
}

TEST(AlignByLines, FindsTheMotionWhereLinesCrossOrAPointIsThere) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    const double a = dice.uniform(-3, 3);
    const own::Line::Value<double> wall{a, dice.uniform(-9, 9)};
    const own::Line::Value<double> across{a + dice.uniform(0.3, 2.8), dice.uniform(-9, 9)};
    const Vec<2> p = random_point<2>(dice);
    const Rigid2 T = random_pose<2>(dice, 100.0);
    for (const Values<2>& x :
         {lines_and_points({wall, across}, {}), lines_and_points({wall}, {p}),
          lines_and_points({wall, {a, 20.0}, across}, {p, Vec<2>(p + Vec<2>(1, 2))})}) {
      const auto found = align(x, moved(x, T.inverse()));
      ASSERT_TRUE(found.has_value());
      expect_same(*found, T);
    }
  }
}

TEST(AlignByLines, RefusesParallelOnes) {
  Dice dice(3);
  for (const double noise : {0.0, 1e-9, 0.01}) {
    const Values<2> x = lines_and_points({{0.5, 1.0}, {0.5 + noise, 4.0}, {0.5, -7.0}}, {});
    EXPECT_FALSE(align(x, moved(x, random_pose<2>(dice))).has_value()) << noise;
  }
  EXPECT_FALSE(align(lines_and_points({{0.5, 1.0}}, {}), lines_and_points({{0.1, 1.0}}, {})));
}

TEST(AlignByLines, FindsTheLeastSquaresTranslation) {
  // Lines measured with noise: no other translation leaves the offsets and points less to say.
  Dice dice(11);
  std::vector<own::Line::Value<double>> in_a, in_b;
  for (int k = 0; k < 6; ++k) {
    in_a.push_back({dice.uniform(-3, 3), dice.uniform(-5, 5)});
    in_b.push_back({in_a.back().a, in_a.back().d + dice.uniform(-0.3, 0.3)});
  }
  const std::vector<Vec<2>> points_a{Vec<2>(1, 2)}, points_b{Vec<2>(1.2, 1.7)};
  const Rigid2 T =
      align(lines_and_points(in_a, points_a), lines_and_points(in_b, points_b)).value();
  const auto left = [&](const Vec<2>& t) {
    double sum = (points_a[0] - T.R * points_b[0] - t).squaredNorm();
    for (std::size_t k = 0; k < in_a.size(); ++k) {
      const double r = in_a[k].d - in_b[k].d - own::Line::direction(in_a[k]).dot(t);
      sum += r * r;
    }
    return sum;
  };
  for (int k = 0; k < 100; ++k) EXPECT_GT(left(T.t + 1e-3 * random_point<2>(dice)), left(T.t));
}

TEST(AlignByPlanes, NeedsThreeThatMeetInAPointOrWhatStandsForThem) {
  Dice dice(5);
  const auto make = [](const std::vector<Vec<3>>& normals, const std::vector<Vec<3>>& at) {
    ValuesBuilder<3> builder;
    for (std::size_t k = 0; k < normals.size(); ++k)
      builder.add<own::Plane>(own::plane_key(k),
                              {normals[k].normalized(), 1.0 + static_cast<double>(k)});
    for (std::size_t k = 0; k < at.size(); ++k) builder.add<Point3>(point_key(k), at[k]);
    return std::move(builder).build();
  };
  const Vec<3> p = random_point<3>(dice), q = random_point<3>(dice);
  const Vec<3> x(1, 0, 0), y(0.2, 1, 0), z(0, 0.3, 1), xy(1, 1, 0);
  for (int round = 0; round < 5; ++round) {
    const Rigid3 T = random_pose<3>(dice, 50.0);
    const auto finds = [&](const Values<3>& there) {
      const auto found = align(there, moved(there, T.inverse()));
      if (found) expect_same(*found, T);
      return found.has_value();
    };
    EXPECT_TRUE(finds(make({x, y, z}, {})));
    EXPECT_TRUE(finds(make({x, y}, {p})));
    EXPECT_TRUE(finds(make({x}, {p, q})));
    EXPECT_FALSE(finds(make({x, y}, {})));
    EXPECT_FALSE(finds(make({x, y, xy}, {}))) << "the walls of a prism";
    EXPECT_FALSE(finds(make({x, x, x}, {p}))) << "turning about a normal through the point";
    EXPECT_FALSE(finds(make({Vec<3>(q - p)}, {p, q}))) << "turning about the points' line";
  }
}

/// What align minimises: positions, and orientations weighted by the mean squared spread of the
/// positions in both maps.
template <int D>
double cost(const Values<D>& a, const Values<D>& b, const Rigid<D>& T) {
  std::vector<Vec<D>> pa, pb;
  double turn = 0.0;
  for (int i = 0; i < a.size(); ++i) {
    const Key key = a.variables().key(i);
    if (key.type == Tag("pose")) {
      pa.push_back(a.pose(key).t);
      pb.push_back(b.pose(key).t);
      turn += (a.pose(key).R - T.R * b.pose(key).R).squaredNorm();
    } else {
      pa.push_back(a.point(key));
      pb.push_back(b.point(key));
    }
  }
  double spread = 0.0, sum = 0.0;
  for (const auto* points : {&pa, &pb}) {
    Vec<D> mean = Vec<D>::Zero();
    for (const auto& p : *points) mean += p / static_cast<double>(points->size());
    for (const auto& p : *points) spread += (p - mean).squaredNorm();
  }
  spread /= static_cast<double>(pa.size());
  for (std::size_t k = 0; k < pa.size(); ++k) sum += (pa[k] - T * pb[k]).squaredNorm();
  return sum + (spread > 0.0 ? spread : 1.0) * turn;
}

TYPED_TEST(Align, IsTheBestFit) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    const double noise = seed % 3 == 0 ? 3.0 : 0.2;  // also where nothing really fits
    const Values<D> a = random_values<D>(dice, ids(dice.below(4)), ids(D + dice.below(6)));
    const Values<D> b = noisy(dice, moved(a, random_pose<D>(dice)), noise);
    const auto found = align(a, b);
    ASSERT_TRUE(found.has_value());
    const double best = cost(a, b, *found);
    EXPECT_NEAR(found->R.determinant(), 1.0, 1e-12) << "a rotation, not a reflection";
    for (int k = 0; k < 200; ++k) {
      const double size = std::pow(10.0, -dice.uniform(0, 6));
      const Rigid<D> other = noisy<PoseType<D>>(dice, *found, size);
      EXPECT_GE(cost(a, b, other), best * (1.0 - 1e-12));
    }
  }
}

// Nearest means: of all rotations the one whose trace of R' M is largest.
TYPED_TEST(Align, TheNearestRotationIsNearerThanOthers) {
  constexpr int D = TypeParam::value;
  Dice dice(5);
  for (int trial = 0; trial < 50; ++trial) {
    Mat<D, D> M;
    for (int k = 0; k < D * D; ++k) M(k / D, k % D) = dice.normal();
    if (trial % 5 == 0) M.col(D - 1) = M.col(0);  // of lower rank
    const Mat<D, D> R = nearest_rotation<D>(M);
    EXPECT_LT(distance(R * R.transpose(), Mat<D, D>::Identity()), 1e-14);
    EXPECT_NEAR(R.determinant(), 1.0, 1e-14) << "a rotation, not a reflection";
    const double best = (R.transpose() * M).trace();
    for (int k = 0; k < 100; ++k)
      EXPECT_LE((random_rotation<D>(dice).transpose() * M).trace(), best + 1e-12);
  }
}

TYPED_TEST(Align, DoesNotDependOnUnits) {
  constexpr int D = TypeParam::value;
  const auto scaled = [](Values<D> x, double scale) {
    for (int i = 0; i < x.size(); ++i) {
      const Key key = x.variables().key(i);
      if (key.type == Tag("pose")) {
        Rigid<D> pose = x.pose(key);
        pose.t *= scale;
        x.template set<PoseType<D>>(i, pose);
      } else {
        x.template set<PointType<D>>(i, Vec<D>(scale * x.point(key)));
      }
    }
    return x;
  };
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Dice dice(seed);
    const Values<D> a = random_values<D>(dice, ids(3), ids(5));
    const Values<D> b = noisy(dice, moved(a, random_pose<D>(dice)), 0.3);
    const Rigid<D> metres = align(a, b).value();
    for (const double scale : {1e-6, 1e-3, 1e3, 1e6}) {
      const auto found = align(scaled(a, scale), scaled(b, scale));
      ASSERT_TRUE(found.has_value()) << scale;
      EXPECT_LT(distance(found->R, metres.R), 1e-10) << scale;
      EXPECT_LT(distance(Vec<D>(found->t / scale), metres.t), 1e-9) << scale;
    }
  }
}

TYPED_TEST(Align, RefusesTheSameShapesInAnyUnit) {
  constexpr int D = TypeParam::value;
  Dice dice(8);
  for (const double scale : {1e-6, 1e-3, 1.0, 1e3, 1e6}) {
    std::vector<Vec<D>> line;
    const Vec<D> p = random_point<D>(dice, scale), q = random_point<D>(dice, scale);
    if constexpr (D == 3) line = {p, q, Vec<D>(0.5 * (p + q)), Vec<D>(2.0 * p - q)};
    if constexpr (D == 2) line = {p, p};
    EXPECT_FALSE(align(points<D>(line), points<D>(line)).has_value()) << scale;
    if constexpr (D == 2) line = {p, q};
    if constexpr (D == 3) line.push_back(random_point<D>(dice, scale));
    EXPECT_TRUE(align(points<D>(line), points<D>(line)).has_value()) << scale;
  }
}

TYPED_TEST(Align, IsUndisturbedByGreatDistances) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Dice dice(seed);
    const Values<D> near = random_values<D>(dice, {}, ids(D + 3));
    Rigid<D> far;
    far.t.setConstant(1e6);
    const Rigid<D> T = random_pose<D>(dice);
    const auto found = align(moved(near, far), moved(near, T));
    ASSERT_TRUE(found.has_value());
    EXPECT_LT(distance(found->R, (far * T.inverse()).R), 1e-9);
  }
}

}  // namespace
}  // namespace mapjoin
