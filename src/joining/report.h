#pragma once

#include <fmt/format.h>

#include <chrono>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "mapjoin/frames/anchors.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/frames/points_anchor.h"
#include "mapjoin/graph/piece.h"
#include "mapjoin/graph/world.h"
#include "mapjoin/joining/options.h"

namespace mapjoin {

using Clock = std::chrono::steady_clock;
inline double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// How many maps a graph tree joins at once. Wide joins are quick; but what a join of summaries
/// moves is carried on with the old information, so there fewer at a time are better.
inline int arity_of(const JoinOptions& options) {
  if (options.arity > 0) return options.arity;
  return options.mode == Mode::kSummary ? 4 : 32;
}

/// Variables of a leaf, about, where nobody asks for another number.
inline int leaf_of(const JoinOptions& options) {
  if (options.leaf_variables > 0) return options.leaf_variables;
  return options.mode == Mode::kSummary ? 32 : 64;
}

/// Variables of the submaps that an elimination tree is cut into, ascending. Where nobody asks for
/// an arity, two sizes serve up to a million variables: what is joined last is laid out well enough
/// (place.h) to spare another solve of most of the map.
inline std::vector<std::int64_t> submap_sizes(const JoinOptions& options, std::int64_t variables) {
  constexpr std::int64_t kMostAtOnce = 1024;
  std::int64_t times = arity_of(options);
  std::vector<std::int64_t> sizes{leaf_of(options)};
  while (sizes.back() <= variables / times) {
    sizes.push_back(sizes.back() * times);
    if (options.arity == 0) times = kMostAtOnce;
  }
  return sizes;
}

/// Fills in what a report says of its input.
template <int D>
void count_variables(const MeasurementGraph<D>& graph, JoinReport& report) {
  for (const auto& column : graph.variables.columns()) {
    (column.kind->tag == Tag("pose") ? report.poses : report.features) += column.size();
  }
  if (graph.variables.find(world_key())) --report.poses;  // a frame, not where a robot was
  report.observations = static_cast<std::int64_t>(graph.size());
}

/// The anchor at a piece's lowest pose; without keys where it has no pose.
template <int D>
Anchor<D> lowest_pose_anchor(const VariableSet<D>& all, const Piece<D>& piece) {
  const int c = all.find_column(Tag("pose"));
  if (c < 0 || piece.column_size(static_cast<std::size_t>(c)) == 0) return {};
  const int first = piece.column_start[static_cast<std::size_t>(c)];
  return pose_anchor<D>(all.key(piece.variables[static_cast<std::size_t>(first)]));
}

/// Writes a map without poses in the frame of points that lie far apart, and has the report say
/// which. A map without such points either (walls alone) stays as it is: in no particular frame.
template <int D>
Map<D> into_points(Map<D> map, JoinReport& report) {
  const std::optional<Anchor<D>> anchor = farthest_points(map.values);
  if (!anchor) {
    report.notes.push_back(
        fmt::format("the piece of {} has neither a pose nor points that fix a frame: it is in no "
                    "particular one",
                    to_string(map.variables().key(0))));
    return map;
  }
  report.notes.push_back(fmt::format(
      "the piece of {} has no pose: it is in the frame of {}, points that are far apart",
      to_string(map.variables().key(0)), to_string(*anchor)));
  const bool informed = map.information.size() > 0;
  if (!informed) map.information = SymmetricBlockMatrix(map.variables().offsets(), {});
  map = change_frame(std::move(map), *anchor);
  if (!informed) map.information = {};
  return map;
}

/// The order of a result's maps.
template <int D>
bool lower_map_first(const Map<D>& a, const Map<D>& b) {
  const auto lowest = [](const Map<D>& m) {
    return m.anchor.keys.empty() ? m.variables().key(0) : m.anchor.keys[0];
  };
  return lowest(a) < lowest(b);
}

}  // namespace mapjoin
