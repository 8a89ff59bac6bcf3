#include "mapjoin/cli/terminal.h"

#include <unistd.h>

#include <cstdlib>

namespace mapjoin::cli {

namespace {

std::string with_style(const char* style, const std::string& text, Stream stream) {
  const char* refused = std::getenv("NO_COLOR");
  const char* terminal = std::getenv("TERM");
  const bool dumb = terminal != nullptr && std::string(terminal) == "dumb";
  if (!is_terminal(stream) || dumb || (refused != nullptr && *refused != '\0')) return text;
  return style + text + "\033[0m";
}

}  // namespace

bool is_terminal(Stream stream) {
  return isatty(stream == Stream::kOut ? STDOUT_FILENO : STDERR_FILENO) != 0;
}

std::string bold(const std::string& text, Stream stream) {
  return with_style("\033[1m", text, stream);
}
std::string red(const std::string& text, Stream stream) {
  return with_style("\033[1;31m", text, stream);
}

}  // namespace mapjoin::cli
