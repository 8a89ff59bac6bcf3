#pragma once

#include <compare>
#include <cstdint>
#include <string>
#include <string_view>

namespace mapjoin {

/// Short name of a variable type or of an anchor kind: up to eight ASCII characters packed in one
/// integer.
///
/// Tags compare as their text does, hash as an integer, print without any registry, and are the
/// same in every process, so they can stand in files.
class Tag {
 public:
  constexpr Tag() = default;
  /// \throws InputError (at compile time: no constant) when `text` is empty or longer than eight
  /// characters.
  constexpr Tag(std::string_view text)
      : bits_(pack(text)) {}  // NOLINT(google-explicit-constructor)
  constexpr Tag(const char* text) : Tag(std::string_view(text)) {}  // NOLINT

  constexpr std::uint64_t bits() const { return bits_; }
  static constexpr Tag from_bits(std::uint64_t bits) {
    Tag tag;
    tag.bits_ = bits;
    return tag;
  }
  std::string text() const;

  friend constexpr auto operator<=>(Tag, Tag) = default;

 private:
  static constexpr std::uint64_t pack(std::string_view text) {
    if (text.empty() || text.size() > 8) throw_bad_tag(text);
    std::uint64_t bits = 0;
    for (std::size_t k = 0; k < 8; ++k) {
      bits = (bits << 8) | (k < text.size() ? static_cast<unsigned char>(text[k]) : 0U);
    }
    return bits;
  }
  [[noreturn]] static void throw_bad_tag(std::string_view text);

  std::uint64_t bits_ = 0;
};

/// Identity of a variable. Equal keys are the same variable, in whatever map they stand.
///
/// Two recordings that both count their poses from 0 are read under different sessions, so that
/// they never fuse by accident. Ordered by type, then session, then id.
struct Key {
  Tag type;
  std::uint32_t session = 0;
  std::uint64_t id = 0;

  friend constexpr auto operator<=>(const Key&, const Key&) = default;
};

/// `pose:id` in the given session.
constexpr Key pose_key(std::uint64_t id, std::uint32_t session = 0) {
  return {Tag("pose"), session, id};
}
/// `point:id` in the given session.
constexpr Key point_key(std::uint64_t id, std::uint32_t session = 0) {
  return {Tag("point"), session, id};
}

/// "pose:12", or "2/pose:12" when the session is not 0.
std::string to_string(const Key& key);

/// Inverse of to_string. \throws InputError that says what a key looks like.
Key parse_key(std::string_view text);

}  // namespace mapjoin
