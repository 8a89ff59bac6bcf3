#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace mapjoin {

static_assert(std::endian::native == std::endian::little,
              "native maps are little-endian, and so has to be the machine");

/// A number that stands in files as it stands in memory.
template <class T>
concept FileNumber = std::is_arithmetic_v<T>;

/// Puts numbers and arrays one after another. Everything begins at a multiple of 8 bytes.
class ByteWriter {
 public:
  template <FileNumber T>
  void number(T value) {
    append(&value, sizeof(T));
    pad();
  }
  /// The count, then the elements.
  template <FileNumber T>
  void array(std::span<const T> values) {
    number(static_cast<std::uint64_t>(values.size()));
    append(values.data(), values.size_bytes());
    pad();
  }
  template <FileNumber T>
  void array(const std::vector<T>& values) {
    array(std::span<const T>(values));
  }
  /// Up to eight characters, filled up with zero bytes.
  void tag(std::string_view text) {
    append(text.data(), text.size());
    pad();
  }
  const std::string& bytes() const { return bytes_; }

 private:
  void append(const void* data, std::size_t size) {
    if (size > 0) bytes_.append(static_cast<const char*>(data), size);
  }
  void pad() { bytes_.resize((bytes_.size() + 7) & ~std::size_t{7}, '\0'); }

  std::string bytes_;
};

/// Takes out what ByteWriter put in. Never reads beyond the end and never allocates more than there
/// is to read.
class ByteReader {
 public:
  /// `name` is what messages call the place: "a.map: section values".
  ByteReader(std::string name, std::string_view bytes) : name_(std::move(name)), bytes_(bytes) {}

  template <FileNumber T>
  T number(std::string_view what) {
    T out;
    std::memcpy(&out, take(sizeof(T), what), sizeof(T));
    return out;
  }
  template <FileNumber T>
  std::vector<T> array(std::string_view what) {
    const std::size_t count = this->count(what, sizeof(T));
    std::vector<T> out(count);
    const char* const from = take(count * sizeof(T), what);
    if (count > 0) std::memcpy(out.data(), from, count * sizeof(T));
    return out;
  }
  /// A number of things that take at least `size` bytes each.
  std::size_t count(std::string_view what, std::size_t size);
  std::string tag(std::string_view what);
  /// \throws InputError unless everything was read.
  void expect_end() const;

  /// \throws InputError "name, byte 12: problem; ...".
  [[noreturn]] void fail(std::string_view problem) const;
  void require(bool condition, std::string_view problem) const {
    if (!condition) fail(problem);
  }

 private:
  const char* take(std::size_t size, std::string_view what);

  std::string name_;
  std::string_view bytes_;
  std::size_t at_ = 0;
};

/// A 64-bit checksum of a row of bytes: for every 8 of them (the last filled up with zeros) h =
/// rotl(h ^ word, 27) * k + c. Each step is one-to-one in h and in the word, so no change of a
/// single word goes unseen; others do once in 2^64.
std::uint64_t checksum(std::string_view bytes, std::uint64_t seed = 0);

}  // namespace mapjoin
