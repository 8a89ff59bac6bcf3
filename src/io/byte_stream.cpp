#include "mapjoin/io/byte_stream.h"

#include <fmt/format.h>

#include <algorithm>

#include "mapjoin/graph/error.h"

namespace mapjoin {

const char* ByteReader::take(std::size_t size, std::string_view what) {
  const std::size_t left = bytes_.size() - at_;
  if (size > left) fail(fmt::format("{} takes {} bytes, but {} are left", what, size, left));
  const char* const out = bytes_.data() + at_;
  at_ += std::min(left, (size + 7) & ~std::size_t{7});
  return out;
}

std::size_t ByteReader::count(std::string_view what, std::size_t size) {
  const auto count = number<std::uint64_t>(what);
  const std::size_t left = bytes_.size() - at_;
  if (count > left / size) {
    fail(fmt::format("{} is said to have {} entries, but {} bytes are left", what, count, left));
  }
  return static_cast<std::size_t>(count);
}

std::string ByteReader::tag(std::string_view what) {
  const char* const from = take(8, what);
  return {from, static_cast<std::size_t>(std::find(from, from + 8, '\0') - from)};
}

void ByteReader::expect_end() const {
  if (at_ != bytes_.size()) fail(fmt::format("{} bytes are left over", bytes_.size() - at_));
}

void ByteReader::fail(std::string_view problem) const {
  throw InputError(fmt::format(
      "{}, byte {}: {}; the file is damaged or was not written by mapjoin: write it again", name_,
      at_, problem));
}

std::uint64_t checksum(std::string_view bytes, std::uint64_t seed) {
  constexpr std::uint64_t kFactor = 0xd6e8feb86659fd93U;
  constexpr std::uint64_t kStep = 0x9e3779b97f4a7c15U;
  std::uint64_t hash = seed ^ (kStep * (bytes.size() + 1));
  const auto mix = [&hash](std::uint64_t word) {
    hash = std::rotl(hash ^ word, 27) * kFactor + kStep;
  };
  std::size_t at = 0;
  for (; at + 8 <= bytes.size(); at += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes.data() + at, 8);
    mix(word);
  }
  if (at < bytes.size()) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes.data() + at, bytes.size() - at);
    mix(word);
  }
  return hash ^ (hash >> 32U);
}

}  // namespace mapjoin
