#include "mapjoin/io/plain_ids.h"

#include <fmt/format.h>

#include <algorithm>

#include "mapjoin/graph/error.h"
#include "mapjoin/graph/world.h"

namespace mapjoin {

namespace {

constexpr std::uint64_t kLargest = std::uint64_t{1} << 63U;

/// The smallest power of ten that is at least `floor` and larger than `id`.
std::uint64_t power_above(std::uint64_t id, std::uint64_t floor) {
  std::uint64_t power = floor;
  while (power <= id) {
    if (power > kLargest / 10) {
      throw InputError(
          fmt::format("id {} is too large to be combined with others in one number; renumber", id));
    }
    power *= 10;
  }
  return power;
}

std::uint64_t largest_id(std::span<const Key> keys) {
  std::uint64_t out = 0;
  for (const Key& key : keys) out = std::max(out, key.id);
  return out;
}

/// Whether a pose and a point have the same session and id. Both columns ascend.
bool collide(std::span<const Key> poses, std::span<const Key> points) {
  auto pose = poses.begin();
  for (const Key& point : points) {
    const Key key = pose_key(point.id, point.session);
    while (pose != poses.end() && *pose < key) ++pose;
    if (pose != poses.end() && *pose == key) return true;
  }
  return false;
}

template <int D>
std::span<const Key> keys_of(const VariableSet<D>& set, Tag tag) {
  const int c = set.find_column(tag);
  if (c < 0) return {};
  return set.column(c).keys;
}

}  // namespace

template <int D>
PlainIds<D>::PlainIds(std::span<const VariableSet<D>* const> sets, bool offset_features,
                      const std::string& format) {
  const VariableSet<D> all = unite<D>(sets);
  auto poses = keys_of(all, Tag("pose"));
  const auto points = keys_of(all, Tag("point"));
  if (static_cast<std::size_t>(all.size()) != poses.size() + points.size()) {
    const auto other = std::ranges::find_if(all.columns(), [](const auto& c) {
      return c.kind->tag != Tag("pose") && c.kind->tag != Tag("point");
    });
    throw InputError(fmt::format("{} has no word for {}; write a native map instead", format,
                                 to_string(other->keys.front())));
  }
  if (!poses.empty() && poses.back() == world_key()) poses = poses.first(poses.size() - 1);
  if (!points.empty() && (offset_features || collide(poses, points))) {
    feature_offset_ = power_above(largest_id(poses), 100000);
  }
  const auto one_session = [](std::span<const Key> keys) {
    return keys.empty() || keys.front().session == keys.back().session;
  };
  const bool apart =
      poses.empty() || points.empty() || poses.front().session == points.front().session;
  if (!one_session(poses) || !one_session(points) || !apart) {
    const std::uint64_t largest =
        std::max(largest_id(poses), points.empty() ? 0 : largest_id(points) + feature_offset_);
    session_factor_ = power_above(largest, 10);
    std::uint64_t sessions = 0;
    if (!poses.empty()) sessions = poses.back().session;
    if (!points.empty()) sessions = std::max<std::uint64_t>(sessions, points.back().session);
    if (sessions >= kLargest / session_factor_) {
      throw InputError(fmt::format("session {} and id {} do not fit into one number; renumber",
                                   sessions, largest));
    }
  }
}

template <int D>
std::vector<std::string> PlainIds<D>::notes() const {
  std::vector<std::string> out;
  if (feature_offset_ > 0)
    out.push_back(fmt::format("features are written with {} added to their ids", feature_offset_));
  if (session_factor_ > 0) out.push_back(fmt::format("ids are session * {} + id", session_factor_));
  return out;
}

template class PlainIds<2>;
template class PlainIds<3>;

}  // namespace mapjoin
