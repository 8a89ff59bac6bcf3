// Frames fixed by features: through every pair of kinds of anchors and back, what they drop, and
// when they are degenerate.

#include "mapjoin/frames/points_anchor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "examples/level_anchor.h"
#include "examples/line_anchor.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/frames/gauge.h"
#include "mapjoin/frames/local_map.h"
#include "mapjoin/frames/parse_anchor.h"
#include "mapjoin/graph/dense.h"
#include "tests/support/dense.h"
#include "tests/support/random_maps.h"
#include "tests/support/user_types.h"

namespace mapjoin {
namespace {

using namespace test;  // NOLINT
using ::testing::AllOf;
using ::testing::HasSubstr;

template <class T>
class PointsAnchor : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(PointsAnchor, Dimensions);

/// Frames of all built-in kinds for a map of poses 0-4 and points 0-4: some share variables.
template <int D>
std::vector<Anchor<D>> frames() {
  return {pose_anchor<D>(pose_key(1)), pose_anchor<D>(pose_key(4)), points_of<D>({2, 0, 3}),
          points_of<D>({0, 2, 4}), points_of<D>({1, 4, 2})};
}

template <int D>
void expect_same_blocks(const Map<D>& a, const Map<D>& b) {
  ASSERT_EQ(a.information.blocks(), b.information.blocks());
  for (int j = 0; j < a.information.size(); ++j) {
    for (auto s = a.information.begin(j); s < a.information.end(j); ++s)
      ASSERT_EQ(a.information.row(s), b.information.row(s));
  }
}

template <int D>
void expect_same_anchored_map(const Map<D>& a, const Map<D>& b) {
  EXPECT_LT(distance(a.values, b.values), 1e-10);
  ASSERT_EQ(a.anchor, b.anchor);
  const AnchoredInformation of_a = anchored_information(a), of_b = anchored_information(b);
  EXPECT_EQ(of_a.scalars, of_b.scalars);
  EXPECT_LT(relative_distance(of_a.dense(), of_b.dense()), 1e-8);
  expect_same_blocks(a, b);
}

TYPED_TEST(PointsAnchor, ThereAndBackIsTheSameMapThroughEveryPairOfKinds) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    Dice dice(seed);
    const Values<D> values = random_values<D>(dice, ids(5), ids(5));
    for (const Anchor<D>& a : frames<D>()) {
      const Map<D> map = map_of(dice, values, a);
      for (const Anchor<D>& b : frames<D>()) {
        SCOPED_TRACE(to_string(a) + " " + to_string(b));
        const Map<D> there = change_frame(map, b);
        expect_same_blocks(map, there);
        expect_same_anchored_map(change_frame(there, a), map);
      }
    }
  }
}

TYPED_TEST(PointsAnchor, ViaAThirdFrameIsTheSameMapForAllKinds) {
  constexpr int D = TypeParam::value;
  Dice dice(6);
  const Map<D> map = map_of(dice, random_values<D>(dice, ids(5), ids(5)), frames<D>()[0]);
  for (const Anchor<D>& via : frames<D>()) {
    for (const Anchor<D>& end : frames<D>()) {
      SCOPED_TRACE(to_string(via) + " " + to_string(end));
      expect_same_anchored_map(change_frame(change_frame(map, via), end), change_frame(map, end));
    }
  }
}

TEST(PointsAnchorOf, ThePlanePinsThreeCoordinates) {
  Dice dice(7);
  const Map<2> map = change_frame(random_map<2>(dice, ids(3), ids(6), 0), two_points(4, 1));
  EXPECT_EQ(map.values.point(point_key(4)), Vec<2>(0.0, 0.0));
  EXPECT_GT(map.values.point(point_key(1))(0), 0.0);
  EXPECT_EQ(map.values.point(point_key(1))(1), 0.0);
  const int origin = map.variables().offset(map.variables().require(point_key(4), "test"));
  const int on_x = map.variables().offset(map.variables().require(point_key(1), "test"));
  EXPECT_EQ(anchor_rows(map.anchor, map.values).pinned,
            (std::vector<int>{on_x + 1, origin, origin + 1}));
}

TEST(PointsAnchorOf, SpacePinsSixCoordinates) {
  Dice dice(8);
  const Map<3> map = change_frame(random_map<3>(dice, ids(3), ids(6), 0), three_points(4, 1, 2));
  EXPECT_EQ(map.values.point(point_key(4)), Vec<3>(0.0, 0.0, 0.0));
  const Vec<3> on_x = map.values.point(point_key(1));
  const Vec<3> at_y = map.values.point(point_key(2));
  EXPECT_GT(on_x(0), 0.0);
  EXPECT_EQ(on_x.tail<2>(), Vec<2>(0.0, 0.0));
  EXPECT_GT(at_y(1), 0.0);
  EXPECT_EQ(at_y(2), 0.0);
  const auto offset = [&](std::uint64_t id) {
    return map.variables().offset(map.variables().require(point_key(id), "test"));
  };
  EXPECT_EQ(anchor_rows(map.anchor, map.values).pinned,
            (std::vector<int>{offset(1) + 1, offset(1) + 2, offset(2) + 2, offset(4), offset(4) + 1,
                              offset(4) + 2}));
  const AnchorRows rows = anchor_rows(map.anchor, map.values);
  EXPECT_NEAR(std::abs(test::dense_determinant(rows.C)), on_x(0) * on_x(0) * at_y(1), 1e-9);
  const AnchoredInformation anchored = anchored_information(map);
  EXPECT_EQ(static_cast<int>(anchored.scalars.size()), map.variables().scalars() - 6);
}

TEST(PointsAnchorOf, CoincidentPointsAreRefusedWithTheirDistance) {
  ValuesBuilder<2> builder;
  builder.add<Point2>(point_key(84), {1000.0, 2.0});
  builder.add<Point2>(point_key(85), {1000.0, 2.0 + 1e-9});
  builder.add<Point2>(point_key(86), {1000.0, 2.1});
  const Values<2> values = std::move(builder).build();
  EXPECT_THAT(
      complaint_of<DegenerateFrameError>([&] { (void)motion_into(two_points(84, 85), values); }),
      AllOf(HasSubstr("point:84"), HasSubstr("point:85"), HasSubstr("1e-09 apart"),
            HasSubstr("1e+03")));
  EXPECT_NO_THROW((void)motion_into(two_points(84, 86), values));
}

TEST(PointsAnchorOf, CollinearPointsAreRefusedWithTheirHeightAndSine) {
  Dice dice(9);
  const Vec<3> origin = random_point<3>(dice), step = random_point<3>(dice);
  ValuesBuilder<3> builder;
  builder.add<Point3>(point_key(1), origin);
  builder.add<Point3>(point_key(2), origin + step);
  builder.add<Point3>(point_key(3), origin - 1.7 * step);
  builder.add<Point3>(point_key(4), origin + 3.0 * step + 1e-4 * Vec<3>(step(1), -step(0), 0.0));
  builder.add<Point3>(point_key(5), origin);
  const Values<3> values = std::move(builder).build();
  EXPECT_THAT(
      complaint_of<DegenerateFrameError>([&] { (void)motion_into(three_points(1, 2, 3), values); }),
      AllOf(HasSubstr("point:1, point:2 and point:3"), HasSubstr("sine")));
  EXPECT_THAT(
      complaint_of<DegenerateFrameError>([&] { (void)motion_into(three_points(1, 5, 2), values); }),
      AllOf(HasSubstr("point:1 and point:5"), HasSubstr("0 apart")));
  EXPECT_THROW((void)motion_into(three_points(1, 2, 5), values), DegenerateFrameError);
  const Rigid<3> into = motion_into(three_points(1, 2, 4), values);
  EXPECT_LT(distance(into.R * into.R.transpose(), Mat<3, 3>::Identity()), 1e-15);
}

TYPED_TEST(PointsAnchor, SaysWhichPointIsMissingTwiceOrNone) {
  constexpr int D = TypeParam::value;
  Dice dice(10);
  const Map<D> map = random_map<D>(dice, ids(3), ids(5), 0);
  const auto complaint = [&](const Anchor<D>& anchor) {
    return complaint_of<InputError>([&] { (void)change_frame(map, anchor); });
  };
  EXPECT_THAT(complaint(points_of<D>({0, 77, 1})), HasSubstr("point:77"));
  EXPECT_THAT(complaint(points_of<D>({3, 3, 3})), AllOf(HasSubstr("point:3"), HasSubstr("twice")));
  Anchor<D> wrong = points_of<D>({0, 1, 2});
  wrong.keys[1] = pose_key(1);
  EXPECT_THAT(complaint(wrong), AllOf(HasSubstr("pose:1"), HasSubstr("'point'")));
  wrong.keys.pop_back();
  EXPECT_THAT(complaint(wrong), HasSubstr(D == 2 ? "2 keys, not 1" : "3 keys, not 2"));
}

/// The joint covariance of an anchor's points in the frame a map is in.
template <int D>
Eigen::MatrixXd covariance_of(const Map<D>& map, const Anchor<D>& anchor) {
  const AnchoredInformation I = anchored_information(map);
  const Eigen::MatrixXd all =
      embedded(test::dense_inverse(I.dense()), I.scalars, map.variables().scalars());
  std::vector<int> scalars;
  for (const int i : anchor_variables(anchor, map.variables())) {
    for (int s = 0; s < D; ++s) scalars.push_back(map.variables().offset(i) + s);
  }
  return picked(all, scalars);
}

TYPED_TEST(PointsAnchor, IsAsCertainInWhateverFrameTheMapIs) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    Dice dice(seed);
    const Anchor<D> points = points_of<D>({0, 1, 2});
    const Map<D> map = random_map<D>(dice, ids(5), ids(5), 0);
    const Map<D> in_points = change_frame(map, points);
    const PointsCertainty known =
        certainty(points, in_points.values, covariance_of(in_points, points));
    // In its own frame the coordinates that are left are these very lengths.
    const Eigen::MatrixXd own = covariance_of(in_points, points);
    EXPECT_NEAR(known.distance, in_points.values.point(point_key(1))(0), 1e-12);
    EXPECT_NEAR(known.distance_sigma, std::sqrt(own(D, D)), 1e-9 * known.distance_sigma);
    if constexpr (D == 3) {
      EXPECT_NEAR(known.height, in_points.values.point(point_key(2))(1), 1e-12);
      EXPECT_NEAR(known.height_sigma, std::sqrt(own(7, 7)), 1e-9 * known.height_sigma);
    }
    for (const Anchor<D>& frame : frames<D>()) {
      SCOPED_TRACE(to_string(frame));
      const Map<D> there = change_frame(map, frame);
      const PointsCertainty other = certainty(points, there.values, covariance_of(there, points));
      EXPECT_NEAR(other.distance, known.distance, 1e-10);
      EXPECT_NEAR(other.height, known.height, 1e-10);
      EXPECT_NEAR(other.distance_sigma, known.distance_sigma, 1e-7 * known.distance_sigma);
      EXPECT_NEAR(other.height_sigma, known.height_sigma, 1e-7 * (1e-12 + known.height_sigma));
    }
  }
}

TYPED_TEST(PointsAnchor, IsRefusedWhereTheMapCannotTellItsPointsApart) {
  constexpr int D = TypeParam::value;
  Dice dice(12);
  const Anchor<D> points = points_of<D>({0, 1, 2});
  const Map<D> map = random_map<D>(dice, ids(5), ids(5), 0);
  const Eigen::MatrixXd covariance = covariance_of(map, points);
  const PointsCertainty known = certainty(points, map.values, covariance);
  const auto sigmas = [&](double scale) {
    return scale * scale * covariance;  // deviations `scale` times as large
  };
  const double distance = known.distance / known.distance_sigma;
  const double height = D == 2 ? 1e300 : known.height / known.height_sigma;
  const double limit = std::min(distance, height) / 3.0;
  EXPECT_NO_THROW(expect_distinct(points, map.values, sigmas(0.99 * limit)));
  EXPECT_THAT(complaint_of<DegenerateFrameError>(
                  [&] { expect_distinct(points, map.values, sigmas(1.01 * limit)); }),
              AllOf(HasSubstr("points:"), HasSubstr("standard deviation"),
                    HasSubstr(height < distance ? "point:2 is" : "point:0 and point:1 are")));
  EXPECT_THROW(expect_distinct(points, map.values, Eigen::MatrixXd::Identity(3, 3)), InputError);
  EXPECT_THROW(expect_distinct(pose_anchor<D>(pose_key(0)), map.values, covariance), InputError);
}

TYPED_TEST(PointsAnchor, OfPointsFarApartIsTheSameInEveryFrame) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    Values<D> values = random_values<D>(dice, ids(2), ids(40));
    const auto anchor = farthest_points(values);
    ASSERT_TRUE(anchor.has_value());
    const auto points = values.template column<PointType<D>>();
    double largest = 0.0;
    for (const auto& a : points) {
      for (const auto& b : points) largest = std::max(largest, (a - b).norm());
    }
    const auto at = [&](std::size_t k) { return values.point(anchor->keys[k]); };
    EXPECT_GE((at(0) - at(1)).norm(), 0.5 * largest);
    EXPECT_LT(anchor->keys[0], anchor->keys[1]);
    if constexpr (D == 3) {
      const Vec<3> line = (at(1) - at(0)).normalized();
      const auto height = [&](const Vec<3>& p) { return line.cross(Vec<3>(p - at(0))).norm(); };
      for (const auto& p : points) EXPECT_LE(height(p), height(at(2)) * (1.0 + 1e-12));
    }
    values.transform(random_pose<D>(dice));
    EXPECT_EQ(farthest_points(values), anchor);
  }
}

TEST(PointsAnchorOf, NothingWhereNoPointsFixAFrame) {
  const auto chosen = [](const std::vector<Vec<3>>& points) {
    ValuesBuilder<3> builder;
    builder.add<Pose3>(pose_key(0), Rigid3());
    for (std::size_t k = 0; k < points.size(); ++k) builder.add<Point3>(point_key(k), points[k]);
    return farthest_points(std::move(builder).build());
  };
  const Vec<3> a(1, 2, 3), b(-1, 0, 4), c(0.3, 0.7, 0);
  EXPECT_FALSE(chosen({}).has_value());
  EXPECT_FALSE(chosen({a, b}).has_value());
  EXPECT_FALSE(chosen({a, a, a, a}).has_value());
  EXPECT_FALSE(chosen({a, b, 0.5 * (a + b), 0.1 * a + 0.9 * b}).has_value());
  EXPECT_TRUE(chosen({a, b, c}).has_value());
}

TEST(PointsAnchorText, IsReadAsItIsPrinted) {
  const auto key = [](std::uint64_t id, std::uint32_t session) { return point_key(id, session); };
  for (const Anchor<2>& anchor :
       {pose_anchor<2>(pose_key(12)), pose_anchor<2>(pose_key(12, 3)), two_points(84, 85),
        points_anchor(key(84, 1), key(85, 1)), points_anchor(key(7, 0), key(7, 2))}) {
    EXPECT_EQ(parse_anchor<2>(to_string(anchor)), anchor) << to_string(anchor);
  }
  EXPECT_EQ(to_string(points_anchor(key(84, 1), key(85, 1))), "points:1/84,1/85");
  EXPECT_EQ(to_string(own::level_anchor(3, 0)), "level:pose:3,up:0");
  EXPECT_EQ(parse_anchor<3>("points:1758,1757,1359"), three_points(1758, 1757, 1359));
  EXPECT_EQ(parse_anchor<2>("points:84,2/85", 4), points_anchor(key(84, 4), key(85, 2)));
  EXPECT_EQ(parse_anchor<3>("pose:1", 4), pose_anchor<3>(pose_key(1, 4)));
}

TEST(PointsAnchorText, SaysWhatIsWrongWithIt) {
  const auto complaint = [](const std::string& text) {
    return complaint_of<InputError>([&] { (void)parse_anchor<2>(text); });
  };
  EXPECT_THAT(complaint("points:84"), AllOf(HasSubstr("2 points"), HasSubstr("not 1")));
  EXPECT_THAT(complaint("points:84,85,86"), AllOf(HasSubstr("the plane"), HasSubstr("not 3")));
  EXPECT_THAT(complaint("points:84,84"), HasSubstr("twice"));
  for (const char* text : {"point:84", "points:", "points:84,", "points:84,,85", "points:a,b",
                           "points:1/2/3,4", "84", "", "1/points:84,85", "wall:3"}) {
    EXPECT_THAT(complaint(text), HasSubstr("points:84,85")) << text;
  }
  EXPECT_THAT(complaint_of<InputError>([] { (void)parse_anchor<3>("points:84,85"); }),
              AllOf(HasSubstr("space"), HasSubstr("3 points")));
}

// Anchors that users add: those of examples/.

Map<2> map_with_a_line(Dice& dice, const Anchor<2>& anchor) {
  ValuesBuilder<2> builder;
  for (std::uint64_t k = 0; k < 3; ++k) {
    builder.add<Pose2>(pose_key(k), random_pose<2>(dice));
    builder.add<Point2>(point_key(k), random_point<2>(dice));
    builder.add<own::Line>(own::line_key(k), {dice.uniform(-3, 3), dice.uniform(-9, 9)});
  }
  return map_of(dice, std::move(builder).build(), anchor);
}

TEST(AnchorOfAUser, LineAndPointGoesThereAndBackFromEveryKind) {
  Dice dice(14);
  for (const Anchor<2>& a : {own::line_anchor(1, 2), own::line_anchor(0, 0), two_points(2, 0),
                             pose_anchor<2>(pose_key(1))}) {
    const Map<2> map = map_with_a_line(dice, a);
    for (const Anchor<2>& b : {own::line_anchor(2, 1), own::line_anchor(1, 0), two_points(0, 1),
                               pose_anchor<2>(pose_key(2))}) {
      SCOPED_TRACE(to_string(a) + " " + to_string(b));
      const Map<2> there = change_frame(map, b);
      expect_same_blocks(map, there);
      expect_same_anchored_map(change_frame(there, a), map);
    }
  }
  const Map<2> map = map_with_a_line(dice, own::line_anchor(1, 2));
  EXPECT_EQ(anchored_information(map).scalars.size(), 18U);
  EXPECT_EQ(as_local_map(map).keys.size(), 9U) << "the line, too: nothing else says what it is";
}

TEST(AnchorOfAUser, LevelFrameKeepsTheMapAndShowsUp) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Dice dice(seed);
    ValuesBuilder<3> builder;
    for (std::uint64_t k = 0; k < 3; ++k) {
      builder.add<Pose3>(pose_key(k), random_pose<3>(dice));
      builder.add<Point3>(point_key(k), random_point<3>(dice));
    }
    builder.add<own::Direction>(own::up_key(0), random_point<3>(dice).normalized());
    const Map<3> map = map_of(dice, std::move(builder).build(), pose_anchor<3>(pose_key(0)));
    const Map<3> level = change_frame(map, own::level_anchor(1, 0));
    EXPECT_EQ(level.values.at<own::Direction>(own::up_key(0)), Vec<3>(0.0, 0.0, 1.0));
    EXPECT_EQ(level.values.pose(pose_key(1)).t, Vec<3>::Zero());
    EXPECT_EQ(level.values.pose(pose_key(1)).R(1, 0), 0.0);
    EXPECT_GT(level.values.pose(pose_key(1)).R(0, 0), 0.0);
    expect_same_blocks(map, level);
    expect_same_anchored_map(change_frame(level, map.anchor), map);
    // Heading mixes rotations: no row stands for it, so none can be dropped.
    EXPECT_THAT(complaint_of<InputError>([&] { (void)anchored_information(level); }),
                HasSubstr("level:pose:1,up:0"));
    // As an observation it is the same: all information in the level frame, complete again.
    Map<3> solved = level;
    solved.solved_in = level.anchor;
    const LocalMap<3> local = as_local_map(solved);
    EXPECT_EQ(local.information, level.information);
    EXPECT_LT(
        relative_distance(complete_gauge(level.values, level.anchor, local.information).dense(),
                          level.information.dense()),
        1e-10);
  }
}

TEST(AnchorOfAUser, APoseThatLooksUpHasNoHeading) {
  ValuesBuilder<3> builder;
  Rigid3 pose;
  pose.R = rotation_exp<3, double>(Vec<3>(0.0, -1.5707963267948966, 0.0));
  builder.add<Pose3>(pose_key(0), pose);
  builder.add<own::Direction>(own::up_key(0), Vec<3>(0.0, 0.0, 1.0));
  const Values<3> values = std::move(builder).build();
  EXPECT_THAT(complaint_of<DegenerateFrameError>(
                  [&] { (void)motion_into(own::level_anchor(0, 0), values); }),
              AllOf(HasSubstr("pose:0"), HasSubstr("heading")));
}

}  // namespace
}  // namespace mapjoin
