#include "mapjoin/frames/parse_anchor.h"

#include <fmt/format.h>

#include "mapjoin/frames/anchors.h"
#include "mapjoin/frames/points_anchor.h"
#include "mapjoin/graph/check_local_map.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/graph/world.h"

namespace mapjoin {

namespace {

constexpr std::string_view kPointsHead = "points:";

template <int D>
InputError no_anchor(std::string_view text) {
  return InputError(
      fmt::format("'{}' is not an anchor: write a pose, as in pose:12, 1/pose:12 or world, or {} "
                  "points, as in {} (in "
                  "session 1: {})",
                  text, D == 2 ? "two" : "three", D == 2 ? "points:84,85" : "points:84,85,86",
                  D == 2 ? "points:1/84,1/85" : "points:1/84,1/85,1/86"));
}

/// A key of the given type, from "84" or "1/84".
Key parse_id(std::string_view type, std::string_view text, std::uint32_t session) {
  const std::size_t slash = text.find('/');
  if (slash == std::string_view::npos) {
    Key key = parse_key(fmt::format("{}:{}", type, text));
    key.session = session;
    return key;
  }
  return parse_key(fmt::format("{}/{}:{}", text.substr(0, slash), type, text.substr(slash + 1)));
}

}  // namespace

template <int D>
Anchor<D> parse_anchor(std::string_view text, std::uint32_t session) {
  Anchor<D> anchor;
  try {
    if (text.substr(0, kPointsHead.size()) == kPointsHead) {
      anchor.kind = &points_anchor_kind<D>();
      std::string_view rest = text.substr(kPointsHead.size());
      for (;;) {
        const std::size_t comma = rest.find(',');
        anchor.keys.push_back(parse_id("point", rest.substr(0, comma), session));
        if (comma == std::string_view::npos) break;
        rest.remove_prefix(comma + 1);
      }
    } else {
      anchor = pose_anchor<D>(parse_key(text));
      if (text != kWorldName && text.find('/') == std::string_view::npos)
        anchor.keys[0].session = session;
    }
  } catch (const InputError&) {
    throw no_anchor<D>(text);
  }
  if (is_pose_anchor(anchor) && anchor.keys[0].type != Tag("pose")) throw no_anchor<D>(text);
  if (static_cast<int>(anchor.keys.size()) != anchor.kind->arity) {
    throw InputError(fmt::format("anchor {}: a frame in {} takes {} points, not {}", text,
                                 D == 2 ? "the plane" : "space", D, anchor.keys.size()));
  }
  check_anchor(anchor);
  return anchor;
}

template Anchor<2> parse_anchor<2>(std::string_view, std::uint32_t);
template Anchor<3> parse_anchor<3>(std::string_view, std::uint32_t);

}  // namespace mapjoin
