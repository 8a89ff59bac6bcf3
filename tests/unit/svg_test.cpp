#include "mapjoin/evaluation/svg.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

namespace mapjoin {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(Svg, DrawsToOneScaleWithYUp) {
  SvgPanel small("small");
  small.polyline({{0, 0}, {1, 1}}, {"#112233", 2.0});
  SvgPanel large("large");
  large.segments({{0, 0}, {10, 0}, {0, 10}, {10, 10}}, {"#445566", 1.0});
  const SvgPanel panels[] = {small, large};
  SvgOptions options;
  options.panel_width = 336;   // 300 of them for the map
  options.panel_height = 432;  // likewise
  const std::string text = svg(panels, options);
  // One metre is 30 pixels in both. The first panel's middle is at (28 + 168, 28 + 52 + 168).
  EXPECT_THAT(text, HasSubstr("stroke=\"#112233\""));
  EXPECT_THAT(text, HasSubstr("d=\"M181.0 263.0L211.0 233.0\""));
  EXPECT_THAT(text, HasSubstr("M410.0 398.0L710.0 398.0M410.0 98.0L710.0 98.0"));
}

TEST(Svg, EscapesText) {
  const SvgPanel panel("a < b & \"c\"");
  const std::string text = svg({&panel, 1});
  EXPECT_THAT(text, HasSubstr("a &lt; b &amp; &quot;c&quot;"));
  EXPECT_THAT(text, Not(HasSubstr("nan")));  // a panel with nothing in it
  EXPECT_THAT(text, Not(HasSubstr("inf")));
}

TEST(Svg, ColoursDifferAlongTheWay) {
  std::set<std::string> colours;
  for (int k = 0; k <= 20; ++k) colours.insert(colour_along(k / 20.0));
  EXPECT_EQ(colours.size(), 21U);
  EXPECT_EQ(colour_along(-1), colour_along(0));
  EXPECT_EQ(colour_along(2), colour_along(1));
}

TEST(Svg, SeesTheWorldFromAbove) {
  ValuesBuilder<2> values;
  values.add<Pose2>(pose_key(2), rigid2(3, 4, 1));
  values.add<Pose2>(pose_key(1), rigid2(1, 2, 0));
  const Points2 points = positions<Pose2>(std::move(values).build());
  ASSERT_EQ(points.size(), 2U);
  EXPECT_EQ(points[0], Eigen::Vector2d(1, 2));
  EXPECT_EQ(points[1], Eigen::Vector2d(3, 4));
}

}  // namespace
}  // namespace mapjoin
