#include "mapjoin/graph/key.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <string>
#include <tuple>
#include <vector>

#include "mapjoin/graph/error.h"
#include "tests/support/random_maps.h"

namespace mapjoin {
namespace {

using test::complaint_of;
using test::Dice;

Key random_key(Dice& dice) {
  static const char* const kNames[] = {"a", "pose", "point", "wall", "eightlet"};
  Key key;
  key.type = Tag(kNames[dice.below(5)]);
  key.session = dice.below(2) == 0 ? 0 : static_cast<std::uint32_t>(dice.generator()());
  key.id = dice.below(2) == 0 ? dice.generator()() : static_cast<std::uint64_t>(dice.below(10));
  return key;
}

TEST(Key, PrintsAndParsesBack) {
  Dice dice(1);
  for (int k = 0; k < 500; ++k) {
    const Key key = random_key(dice);
    EXPECT_EQ(parse_key(to_string(key)), key) << to_string(key);
  }
  EXPECT_EQ(to_string(pose_key(12)), "pose:12");
  EXPECT_EQ(to_string(point_key(84, 2)), "2/point:84");
  const Key largest{Tag("pose"), std::numeric_limits<std::uint32_t>::max(),
                    std::numeric_limits<std::uint64_t>::max()};
  EXPECT_EQ(parse_key(to_string(largest)), largest);
}

TEST(Key, IsOrderedByTypeThenSessionThenId) {
  Dice dice(2);
  for (int k = 0; k < 500; ++k) {
    const Key a = random_key(dice);
    const Key b = random_key(dice);
    const auto tuple = [](const Key& key) {
      return std::tuple(key.type.text(), key.session, key.id);
    };
    EXPECT_EQ(a < b, tuple(a) < tuple(b)) << to_string(a) << " " << to_string(b);
    EXPECT_EQ(a == b, tuple(a) == tuple(b));
  }
}

TEST(Key, OfAnotherSessionIsAnotherVariable) {
  EXPECT_NE(pose_key(3, 0), pose_key(3, 1));
  EXPECT_NE(pose_key(3), point_key(3));
}

TEST(Key, SaysWhatAKeyLooksLike) {
  for (const char* text :
       {"", "pose", "pose:", ":5", "pose:x", "pose:5x", "pose: 5", "pose:-5", "/pose:5", "x/pose:5",
        "1/2/pose:5", "-1/pose:5", "ninechars:5", "pose:18446744073709551616", "4294967296/pose:1",
        "pose:+5", "1/", "pose:5 "}) {
    const std::string message = complaint_of<InputError>([&] { (void)parse_key(text); });
    EXPECT_THAT(message, ::testing::HasSubstr("TYPE:ID")) << text;
    EXPECT_THAT(message, ::testing::HasSubstr("'" + std::string(text) + "'"));
  }
}

TEST(Tag, ComparesAsItsTextDoes) {
  std::vector<std::string> words{"a", "ab", "abc", "b", "point", "pose", "posea", "wall", "z"};
  for (const auto& x : words) {
    for (const auto& y : words) {
      EXPECT_EQ(Tag(x) < Tag(y), x < y) << x << " " << y;
      EXPECT_EQ(Tag(x) == Tag(y), x == y);
    }
  }
}

TEST(Tag, GivesItsTextBack) {
  for (const char* text : {"a", "pose", "12345678"}) {
    EXPECT_EQ(Tag(text).text(), text);
    EXPECT_EQ(Tag::from_bits(Tag(text).bits()), Tag(text));
  }
  static_assert(Tag("pose") == Tag("pose"), "a constant");
}

TEST(Tag, HasOneToEightCharacters) {
  EXPECT_THROW(Tag{std::string()}, InputError);
  EXPECT_THROW(Tag(std::string("ninechars")), InputError);
}

}  // namespace
}  // namespace mapjoin
