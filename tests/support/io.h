// What tests of readers and writers share.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "mapjoin/graph/error.h"
#include "tests/support/program.h"

namespace mapjoin::test {

inline void write_text(const std::filesystem::path& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

/// What f says when it throws an E; "nothing was thrown" otherwise.
template <class E, class F>
std::string message_of(F&& f) {
  try {
    f();
  } catch (const E& error) {
    return error.what();
  }
  return "nothing was thrown";
}

/// Expects an InputError whose message has all the parts, in any order.
template <class F>
void expect_input_error(F&& f, const std::vector<std::string>& parts) {
  const std::string message = message_of<InputError>(std::forward<F>(f));
  for (const std::string& part : parts) EXPECT_THAT(message, testing::HasSubstr(part));
}

inline int files_in(const std::filesystem::path& folder) {
  int count = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder)) ++count;
  return count;
}

}  // namespace mapjoin::test
