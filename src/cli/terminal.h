#pragma once

#include <string>

namespace mapjoin::cli {

enum class Stream { kOut, kErr };

/// Is a person looking? Only then are there progress bars.
bool is_terminal(Stream stream);

/// The text, emphasised where a terminal shows it: never in a file, and never where the environment
/// variable NO_COLOR is set (https://no-color.org).
std::string bold(const std::string& text, Stream stream = Stream::kOut);
std::string red(const std::string& text, Stream stream = Stream::kErr);

}  // namespace mapjoin::cli
