#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "mapjoin/graph/error.h"

namespace mapjoin {

/// A place in a file, as messages name it.
struct FileLine {
  std::string_view file;
  std::int64_t line = 0;

  std::string text() const;  ///< "file:line"
};

/// Reads numbers from lines of text in memory, and knows where it is when something is wrong.
///
///     TextScanner scan("graph.g2o", text);
///     while (scan.next_line()) {
///       const std::string_view tag = scan.word();
///       const double x = scan.number("x");
///       scan.expect_end_of_line("x");
///     }
///
/// Blank lines and lines that begin with '#' are passed over; lines may end in LF or CR LF. Numbers
/// are read as in the C locale, whatever the locale of the program. Every error is an InputError
/// `file:line: problem: 'the line'; remedy`.
class TextScanner {
 public:
  /// `name` is what messages call the file. The text must outlive the scanner.
  TextScanner(std::string name, std::string_view text);

  /// Goes to the next line that holds anything. False at the end of the text.
  bool next_line();
  /// Number of the current line, from 1. After the last line: the number of that line.
  std::int64_t line() const { return line_; }
  /// What the current line should look like; messages about this line end with it.
  void expect(std::string_view format) { format_ = format; }
  /// The current line, without spaces at its ends.
  std::string_view line_text() const;
  /// "file:line".
  std::string where() const { return place().text(); }
  FileLine place() const { return {name_, line_}; }
  const std::string& name() const { return name_; }

  /// The next word of the line; empty at its end.
  std::string_view word() {
    skip_spaces();
    const char* const first = at_;
    while (at_ != line_end_ && !is_space(*at_)) ++at_;
    return {first, static_cast<std::size_t>(at_ - first)};
  }
  bool at_end_of_line() {
    skip_spaces();
    return at_ == line_end_;
  }
  /// How many words the rest of the line has.
  int words_left() const;
  /// A finite number. `what` names it in messages: "information (row 1, column 2)" or "x".
  double number(std::string_view what);
  /// A whole number.
  std::int64_t integer(std::string_view what);
  /// \throws InputError when there is more on the line than `what`.
  void expect_end_of_line(std::string_view what) {
    if (!at_end_of_line()) fail_trailing(what);
  }

  /// \throws InputError "file:line: problem: 'line'; remedy (expected: format)".
  [[noreturn]] void fail(std::string_view problem, std::string_view remedy) const;

 private:
  static bool is_space(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }
  void skip_spaces() {
    while (at_ != line_end_ && is_space(*at_)) ++at_;
  }
  [[noreturn]] void fail_trailing(std::string_view what) const;
  [[noreturn]] void fail_word(std::string_view what, std::string_view expected);
  double unusual_number(std::string_view what);

  std::string name_;
  std::string_view format_;
  const char* next_;  // first character of the next line
  const char* text_end_;
  const char* line_begin_;
  const char* line_end_;
  const char* at_;
  std::int64_t line_ = 0;
};

}  // namespace mapjoin
