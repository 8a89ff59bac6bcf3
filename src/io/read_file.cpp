#include "mapjoin/io/read_file.h"

#include <fmt/format.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <system_error>

#include "mapjoin/graph/error.h"

namespace mapjoin {

std::string read_file(const std::filesystem::path& path) {
  const auto fail = [&](const char* why) {
    return FileError(fmt::format("cannot read '{}': {}", path.string(), why));
  };
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) throw fail("it is a directory");
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"),
                                                             &std::fclose);
  if (file == nullptr) throw fail(std::strerror(errno));

  // The size is a hint only: a pipe has none, and a file may grow while it is read.
  const auto size = std::filesystem::file_size(path, ignored);
  std::string text;
  text.resize(ignored || size == 0 ? std::size_t{1} << 16 : static_cast<std::size_t>(size) + 1);
  std::size_t have = 0;
  while (true) {
    const std::size_t got = std::fread(text.data() + have, 1, text.size() - have, file.get());
    have += got;
    if (have < text.size()) break;
    text.resize(2 * text.size());
  }
  if (std::ferror(file.get()) != 0) throw fail(std::strerror(errno));
  text.resize(have);
  return text;
}

}  // namespace mapjoin
