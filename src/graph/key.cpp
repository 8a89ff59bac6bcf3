#include "mapjoin/graph/key.h"

#include <fmt/format.h>

#include <charconv>
#include <limits>

#include "mapjoin/graph/error.h"
#include "mapjoin/graph/world.h"

namespace mapjoin {

std::string Tag::text() const {
  std::string out;
  for (int shift = 56; shift >= 0; shift -= 8) {
    const char c = static_cast<char>((bits_ >> shift) & 0xFFU);
    if (c == '\0') break;
    out.push_back(c);
  }
  return out;
}

void Tag::throw_bad_tag(std::string_view text) {
  throw InputError(
      fmt::format("'{}' cannot name a variable type or an anchor: use 1 to 8 characters", text));
}

std::string to_string(const Key& key) {
  if (key == world_key()) return std::string(kWorldName);
  return key.session == 0 ? fmt::format("{}:{}", key.type.text(), key.id)
                          : fmt::format("{}/{}:{}", key.session, key.type.text(), key.id);
}

namespace {

template <class Integer>
bool parse_whole(std::string_view text, Integer& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() && !text.empty();
}

}  // namespace

Key parse_key(std::string_view text) {
  const std::string_view whole = text;
  const auto fail = [&]() -> InputError {
    return InputError(fmt::format(
        "'{}' is not a key: write TYPE:ID or SESSION/TYPE:ID, for example pose:12 or 2/point:84",
        whole));
  };
  if (text == kWorldName) return world_key();
  Key key;
  if (const auto slash = text.find('/'); slash != std::string_view::npos) {
    if (!parse_whole(text.substr(0, slash), key.session)) throw fail();
    text.remove_prefix(slash + 1);
  }
  const auto colon = text.find(':');
  if (colon == std::string_view::npos || colon == 0 || colon > 8) throw fail();
  if (text.substr(0, colon).find('/') != std::string_view::npos) throw fail();
  key.type = Tag(text.substr(0, colon));
  if (!parse_whole(text.substr(colon + 1), key.id)) throw fail();
  return key;
}

}  // namespace mapjoin
