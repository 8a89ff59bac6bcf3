#include "mapjoin/joining/features_only.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "mapjoin/frames/change_frame.h"
#include "mapjoin/joining/common_points.h"
#include "mapjoin/joining/join.h"
#include "mapjoin/joining/join_all.h"
#include "mapjoin/solvers/marginalize.h"

namespace mapjoin {

namespace {

const char* enough_points(int dimension) {
  return dimension == 2 ? "two points" : "three points that are not on one line";
}

std::string numbers(int first, int end) {
  return end - first == 1 ? fmt::format("local map {}", first + 1)
                          : fmt::format("local maps {} to {}", first + 1, end);
}

/// The local maps first .. end - 1 of a sequence as one map, poses and all.
template <int D>
Map<D> joined(std::span<const LocalMap<D>> all, int first, int end) {
  const auto part =
      all.subspan(static_cast<std::size_t>(first), static_cast<std::size_t>(end - first));
  if (part.size() == 1) return to_map(part[0]);
  JoinOptions options;
  options.mode = Mode::kObserve;
  options.tree = TreeShape::kOrder;
  JoinResult<D> result = join_all(part, options);
  if (result.maps.size() > 1) {
    throw DisconnectedError(
        fmt::format("{} share too little to be one map: {} and its neighbours have neither a pose "
                    "nor {} in common",
                    numbers(first, end), to_string(result.maps.back().anchor), enough_points(D)));
  }
  return std::move(result.maps[0]);
}

template <int D>
Map<D> without_poses(const Map<D>& map, const std::string& name) {
  const std::vector<int> features = features_of(map.variables());
  const Map<D>* const alone[] = {&map};
  const auto chosen = common_points<D>(alone);
  if (!chosen) {
    throw DegenerateFrameError(
        fmt::format("{} cannot be a map of features alone: of its {} features no {} are apart by "
                    "more than three standard deviations; join with the poses, or build larger "
                    "local maps",
                    name, features.size(), enough_points(D)));
  }
  Map<D> out = change_frame(marginalize(map, std::span<const int>(features), chosen->anchor),
                            chosen->anchor);
  out.solved_in = out.anchor;  // gauge-free to rounding: any frame is as good
  return out;
}

template <int D>
std::vector<Key> points_of(const LocalMap<D>& map) {
  std::vector<Key> out;
  for (const Key& key : map.keys) {
    if (key.type == Tag("point")) out.push_back(key);
  }
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

bool share_points(const std::vector<Key>& a, const std::vector<Key>& b, int least) {
  int count = 0;
  for (const Key& key : b) count += std::binary_search(a.begin(), a.end(), key) ? 1 : 0;
  return count >= least;
}

}  // namespace

template <int D>
FeatureOnlyMaps<D> features_only(std::span<const LocalMap<D>> local_maps) {
  if (local_maps.empty()) throw InputError("there are no local maps: nothing to join");
  FeatureOnlyMaps<D> out;
  const auto count = static_cast<int>(local_maps.size());
  std::vector<Key> points = points_of(local_maps[0]);
  std::optional<Map<D>> map;  // of the local maps out.first.back() .. k - 1, once it is asked for
  for (int k = 1; k <= count; ++k) {
    const int first = out.first.back();
    std::optional<Map<D>> next;
    if (k < count) {
      const LocalMap<D>& local_map = local_maps[static_cast<std::size_t>(k)];
      const std::vector<Key> theirs = points_of(local_map);
      bool enough = share_points(points, theirs, D);
      if (enough) {
        next = to_map(local_map);
        if (!map) map = joined(local_maps, first, k);
        const Map<D>* const both[] = {&*map, &*next};
        enough = common_points<D>(both).has_value();
      }
      if (!enough) {
        points.insert(points.end(), theirs.begin(), theirs.end());
        std::sort(points.begin(), points.end());
        map.reset();
        continue;
      }
      points = theirs;
    }
    if (!map) map = joined(local_maps, first, k);
    out.maps.push_back(without_poses(*map, numbers(first, k)));
    out.first.push_back(k);
    map = std::move(next);
  }
  return out;
}

template FeatureOnlyMaps<2> features_only<2>(std::span<const LocalMap<2>>);
template FeatureOnlyMaps<3> features_only<3>(std::span<const LocalMap<3>>);

}  // namespace mapjoin
