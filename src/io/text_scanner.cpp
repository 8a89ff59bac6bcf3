#include "mapjoin/io/text_scanner.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <system_error>

namespace mapjoin {

namespace {

/// Text as it may stand in a message: of limited length, without control characters.
std::string quoted(std::string_view text) {
  constexpr std::size_t kLongest = 120;
  std::string out(text.substr(0, kLongest));
  for (char& c : out) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  }
  return text.size() > kLongest ? "'" + out + "...'" : "'" + out + "'";
}

}  // namespace

std::string FileLine::text() const { return fmt::format("{}:{}", file, line); }

TextScanner::TextScanner(std::string name, std::string_view text)
    : name_(std::move(name)),
      next_(text.data()),
      text_end_(text.data() + text.size()),
      line_begin_(text.data()),
      line_end_(text.data()),
      at_(text.data()) {}

bool TextScanner::next_line() {
  while (next_ != text_end_) {
    ++line_;
    format_ = {};
    const auto left = static_cast<std::size_t>(text_end_ - next_);
    const auto* const end = static_cast<const char*>(std::memchr(next_, '\n', left));
    line_begin_ = at_ = next_;
    line_end_ = end == nullptr ? text_end_ : end;
    next_ = end == nullptr ? text_end_ : end + 1;
    skip_spaces();
    if (at_ != line_end_ && *at_ != '#') return true;
  }
  return false;
}

std::string_view TextScanner::line_text() const {
  const char* first = line_begin_;
  const char* last = line_end_;
  while (first != last && is_space(*first)) ++first;
  while (first != last && is_space(last[-1])) --last;
  return {first, static_cast<std::size_t>(last - first)};
}

int TextScanner::words_left() const {
  int count = 0;
  bool in_word = false;
  for (const char* c = at_; c != line_end_; ++c) {
    count += !is_space(*c) && !in_word;
    in_word = !is_space(*c);
  }
  return count;
}

double TextScanner::number(std::string_view what) {
  skip_spaces();
  double value = 0.0;
  const auto [end, error] = std::from_chars(at_, line_end_, value);
  const bool usual = error == std::errc() && (end == line_end_ || is_space(*end));
  if (!usual || !std::isfinite(value)) return unusual_number(what);
  at_ = end;
  return value;
}

// What from_chars does not take (a plus sign, a number too small for a double), and everything that
// is wrong.
double TextScanner::unusual_number(std::string_view what) {
  const char* const first = at_;
  const std::string_view text = word();
  at_ = first;
  if (text.empty()) fail_word(what, "a number");
  const std::string copy(text);
  char* end = nullptr;
  const double value = std::strtod(copy.c_str(), &end);
  const bool whole = end == copy.c_str() + copy.size();
  const bool decimal = text.find_first_of("xXpP") == std::string_view::npos;
  if (whole && !std::isfinite(value)) fail_word(what, "a finite number");
  const bool plus = text.front() == '+';
  const bool tiny = std::abs(value) < 1e-300;
  if (!whole || !decimal || !(plus || tiny)) fail_word(what, "a number");
  at_ = first + text.size();
  return value;
}

std::int64_t TextScanner::integer(std::string_view what) {
  skip_spaces();
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(at_, line_end_, value);
  if (error != std::errc() || (end != line_end_ && !is_space(*end)))
    fail_word(what, "a whole number");
  at_ = end;
  return value;
}

void TextScanner::fail_word(std::string_view what, std::string_view expected) {
  const std::string_view text = word();
  if (text.empty()) {
    fail(fmt::format("the line ends where {} was expected", what),
         "complete the line or remove it");
  }
  fail(fmt::format("{} is {}, but {} was expected", what, quoted(text), expected),
       "correct the number or remove the line");
}

void TextScanner::fail_trailing(std::string_view what) const {
  const std::string_view rest(at_, static_cast<std::size_t>(line_end_ - at_));
  fail(fmt::format("the line goes on with {} after {}", quoted(rest.substr(0, 40)), what),
       "remove what is too much");
}

void TextScanner::fail(std::string_view problem, std::string_view remedy) const {
  const std::string format = format_.empty() ? "" : fmt::format(" (expected: {})", format_);
  throw InputError(
      fmt::format("{}: {}: {}; {}{}", where(), problem, quoted(line_text()), remedy, format));
}

}  // namespace mapjoin
