#include "mapjoin/cli/demo_picture.h"

#include <fmt/format.h>

#include <map>

#include "mapjoin/evaluation/svg.h"

namespace mapjoin::cli {

namespace {

const SvgStyle kTruth{"#c3cad1", 5.0, 0.8};
const SvgStyle kTrueFeature{"#c3cad1", 7.0, 0.8};
const SvgStyle kLink{"#e0523c", 0.7, 0.45};
constexpr double kTrack = 1.8;
constexpr double kFeature = 3.4;

Points2 moved(const Rigid2& T, Points2 points) {
  for (Eigen::Vector2d& p : points) p = T * Vec<2>(p);
  return points;
}

void draw_truth(SvgPanel& panel, const Values<2>& truth) {
  panel.polyline(positions<Pose2>(truth), kTruth);
  panel.dots(positions<Point2>(truth), kTrueFeature);
}

/// Each map where it is put, and lines between its features' places and theirs in earlier maps.
void draw_local_maps(SvgPanel& panel, const std::vector<Map<2>>& maps,
                     const std::vector<Rigid2>& places) {
  std::map<Key, Eigen::Vector2d> last_seen;
  Points2 links;
  for (std::size_t k = 0; k < maps.size(); ++k) {
    const int column = maps[k].variables().find_column(Tag("point"));
    const Points2 points = moved(places[k], positions<Point2>(maps[k].values));
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Key& key = maps[k].variables().column(column).keys[i];
      const auto [at, first] = last_seen.try_emplace(key, points[i]);
      if (!first) links.insert(links.end(), {at->second, points[i]});
      at->second = points[i];
    }
  }
  panel.segments(links, kLink);
  for (std::size_t k = 0; k < maps.size(); ++k) {
    const std::string colour =
        colour_along(static_cast<double>(k) / static_cast<double>(maps.size()));
    panel.polyline(moved(places[k], positions<Pose2>(maps[k].values)), {colour, kTrack, 1.0});
    panel.dots(moved(places[k], positions<Point2>(maps[k].values)), {colour, kFeature, 0.9});
  }
}

/// The joined map in the colours of the local maps it came from.
void draw_joined(SvgPanel& panel, const Map<2>& joined, const std::vector<Map<2>>& maps) {
  for (std::size_t k = 0; k < maps.size(); ++k) {
    const std::string colour =
        colour_along(static_cast<double>(k) / static_cast<double>(maps.size()));
    Points2 track;
    for (const Key& key :
         maps[k].variables().column(maps[k].variables().find_column(Tag("pose"))).keys) {
      track.push_back(joined.values.pose(key).t);
    }
    panel.polyline(track, {colour, kTrack, 1.0});
  }
  panel.dots(positions<Point2>(joined.values), {"#1f2933", kFeature, 1.0});
}

}  // namespace

std::string demo_picture(const DemoMaps& maps) {
  SvgPanel before("Before", fmt::format("{} local maps laid end to end: the error of each heading "
                                        "moves all that follow",
                                        maps.local_maps.size()));
  draw_truth(before, maps.truth);
  draw_local_maps(before, maps.local_maps, maps.laid_end_to_end);
  before.legend("truth", kTruth);
  before.legend("local maps, by time", {colour_along(0.5), kTrack});
  before.legend("features", {colour_along(0.2), kFeature}, true);
  before.legend("one feature in two maps", kLink);

  SvgPanel after("After", "joined by linear least squares, without an initial guess");
  draw_truth(after, maps.truth);
  draw_joined(after, maps.joined, maps.local_maps);
  after.legend("truth", kTruth);
  after.legend("joined map, by time", {colour_along(0.5), kTrack});
  after.legend("features", {"#1f2933", kFeature}, true);

  const SvgPanel panels[] = {std::move(before), std::move(after)};
  SvgOptions options;
  options.title = "mapjoin: SLAM by joining submaps";
  return svg(panels, options);
}

}  // namespace mapjoin::cli
