// One map in three frames: Fig. 1 of the paper Linear SLAM. Three poses and three features, written
// in the frame of the first pose, of the last pose, and of two features; and the proof by numbers
// that the frame takes nothing away and adds nothing. docs/one_map_three_frames.md explains it.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numbers>

#include "mapjoin/evaluation/consistency.h"
#include "mapjoin/evaluation/svg.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/frames/gauge.h"
#include "mapjoin/frames/points_anchor.h"
#include "mapjoin/joining/join_all.h"
#include "mapjoin/solvers/relative.h"

using namespace mapjoin;

namespace {

// Fig. 1(a): what the robot measures, all of it relative.
MeasurementGraph<2> measurements() {
  const Mat<3, 3> step = Vec<3>(25.0, 25.0, 100.0).asDiagonal();  // 0.2 m, 0.1 rad
  const Mat<2, 2> sight = Vec<2>(25.0, 25.0).asDiagonal();        // 0.2 m
  MeasurementGraphBuilder<2> builder;
  builder.add<Pose2>(pose_key(0), pose_key(1), rigid2(4.0, 0.3, 0.35), step);
  builder.add<Pose2>(pose_key(1), pose_key(2), rigid2(4.1, -0.2, 0.30), step);
  builder.add<Point2>(pose_key(0), point_key(1), {2.0, 3.1}, sight);
  builder.add<Point2>(pose_key(0), point_key(2), {5.2, -1.9}, sight);
  builder.add<Point2>(pose_key(1), point_key(1), {-0.9, 3.4}, sight);
  builder.add<Point2>(pose_key(1), point_key(2), {0.4, -2.5}, sight);
  builder.add<Point2>(pose_key(1), point_key(3), {3.5, 3.0}, sight);
  builder.add<Point2>(pose_key(2), point_key(2), {-3.8, -1.1}, sight);
  builder.add<Point2>(pose_key(2), point_key(3), {0.6, 3.2}, sight);
  return std::move(builder).build();
}

void print_state(const Map<2>& map) {
  for (int i = 0; i < map.values.size(); ++i) {
    const Key key = map.variables().key(i);
    if (key.type == Tag("pose")) {
      const Rigid2& pose = map.values.pose(key);
      fmt::print("  {:8} {:7.3f} {:7.3f} {:7.3f}\n", to_string(key), pose.t(0), pose.t(1),
                 heading(pose));
    } else {
      const Vec<2>& p = map.values.point(key);
      fmt::print("  {:8} {:7.3f} {:7.3f}\n", to_string(key), p(0), p(1));
    }
  }
}

// The paper's I: over what the frame leaves free. A row is named by its variable.
void print_information(const Map<2>& map) {
  const AnchoredInformation I = anchored_information(map);
  const Eigen::MatrixXd dense = I.dense();
  for (std::size_t row = 0; row < I.scalars.size(); ++row) {
    int i = 0;
    while (map.information.offset(i + 1) <= I.scalars[row]) ++i;
    fmt::print("  {:8}", to_string(map.variables().key(i)));
    for (const double x : dense.row(static_cast<Eigen::Index>(row)))
      fmt::print(" {:>6}", std::abs(x) < 1e-9 ? "." : fmt::format("{:.1f}", x));
    fmt::print("\n");
  }
}

// The picture: positions with their 95% ellipses. What the frame pins has none.
SvgPanel picture(const std::string& title, const Map<2>& map, const Covariance<2>& covariance) {
  SvgPanel panel(title, "frame of " + to_string(map.anchor));
  const SvgStyle path{"#999999", 1.2}, pose{"#2060c0", 1.6}, feature{"#c05010", 1.6};
  panel.polyline(positions<Pose2>(map.values), path);
  const CovarianceBlocks blocks = covariance.blocks();
  for (std::size_t k = 0; k < blocks.size(); ++k) {
    const int i = blocks.variables[k];
    const Key key = map.variables().key(i);
    const bool is_pose = key.type == Tag("pose");
    const Vec<2> centre = is_pose ? map.values.pose(key).t : map.values.point(key);
    const auto region =
        confidence_region<2>(position_covariance(map.values, i, blocks.block(k)), 0.95);
    Points2 ellipse;
    for (int step = 0; step <= 72; ++step) {
      const double a = step * std::numbers::pi / 36.0;
      const Vec<2> on(region.semi_axes(0) * std::cos(a), region.semi_axes(1) * std::sin(a));
      ellipse.emplace_back(centre + region.axes * on);
    }
    panel.polyline(ellipse, is_pose ? pose : feature);
  }
  panel.dots(positions<Pose2>(map.values), {pose.colour, 6.0});
  panel.dots(positions<Point2>(map.values), {feature.colour, 6.0});
  panel.legend("poses, 95%", pose);
  panel.legend("features, 95%", feature);
  return panel;
}

}  // namespace

int main() {
  // 1. The map in three frames. Only the first is solved for; the others follow in closed form.
  const Map<2> first = join_all(measurements()).maps.at(0);
  const Map<2> maps[] = {first, change_frame(first, pose_anchor<2>(pose_key(2))),
                         change_frame(first, points_anchor(point_key(1), point_key(2)))};
  const std::string titles[] = {"First pose", "Last pose", "Two features"};
  std::vector<SvgPanel> panels;
  std::vector<Covariance<2>> covariances;
  for (std::size_t f = 0; f < 3; ++f) {
    fmt::print("In the frame of {}: the state\n", to_string(maps[f].anchor));
    print_state(maps[f]);
    fmt::print("and its information matrix\n");
    print_information(maps[f]);
    covariances.emplace_back(maps[f]);
    panels.push_back(picture(titles[f], maps[f], covariances.back()));
  }
  std::ofstream("one_map_three_frames.svg")
      << svg(panels, {"One map in three frames", 420.0, 420.0});

  // 2. Whatever is relative is the same in all: what each pose sees of all the others, and how far
  //    apart things are. Estimate, then standard deviation.
  double worst = 0.0;
  const auto compare = [&](double a, double b) { worst = std::max(worst, std::abs(a - b)); };
  fmt::print("Relative quantities, in the three frames\n");
  for (std::uint64_t from = 0; from < 3; ++from) {
    for (int i = 0; i < first.values.size(); ++i) {
      const Key to = first.variables().key(i);
      if (to == pose_key(from)) continue;
      fmt::print("  x of {:8} seen from {}", to_string(to), to_string(pose_key(from)));
      const Relative here = relative(first, covariances[0], pose_key(from), to);
      for (std::size_t f = 0; f < 3; ++f) {
        const Relative there = relative(maps[f], covariances[f], pose_key(from), to);
        for (std::size_t k = 0; k < here.value.size(); ++k) compare(here.value[k], there.value[k]);
        compare((here.covariance - there.covariance).cwiseAbs().maxCoeff(), 0.0);
        const bool is_pose = to.type == Tag("pose");
        const double x = is_pose ? there.as<Pose2>().t(0) : there.as<Point2>()(0);
        fmt::print("   {:8.5f} +- {:.5f}", x, std::sqrt(there.covariance(0, 0)));
      }
      fmt::print("\n");
    }
  }
  fmt::print("  from point:1 to point:3          ");
  for (std::size_t f = 0; f < 3; ++f) {
    const Distance d = distance(maps[f], covariances[f], point_key(1), point_key(3));
    const Distance here = distance(first, covariances[0], point_key(1), point_key(3));
    compare(d.value, here.value);
    compare(d.deviation, here.deviation);
    fmt::print("   {:8.5f} +- {:.5f}", d.value, d.deviation);
  }

  // 3. And back again: the information matrix is the one that we began with.
  const Map<2> back = change_frame(change_frame(maps[2], maps[1].anchor), first.anchor);
  const Eigen::MatrixXd before = anchored_information(first).dense();
  const double lost = (anchored_information(back).dense() - before).cwiseAbs().maxCoeff();
  fmt::print(
      "\nlargest difference of any of them {:.0e}; of the information after a round trip "
      "{:.0e}\nwritten: one_map_three_frames.svg\n",
      worst, lost);
  return worst < 1e-9 && lost < 1e-9 * before.maxCoeff() ? 0 : 1;
}
