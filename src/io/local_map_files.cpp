#include "mapjoin/io/local_map_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <string>
#include <string_view>
#include <system_error>

#include "mapjoin/graph/error.h"

namespace mapjoin::detail {

namespace {

/// K of "localmap_K.txt", or with another tail; -1 for other names.
std::int64_t number_of(std::string_view name, std::string_view tail) {
  constexpr std::string_view kHead = "localmap_";
  if (!name.starts_with(kHead) || !name.ends_with(tail)) return -1;
  if (name.size() <= kHead.size() + tail.size()) return -1;
  const std::string_view digits =
      name.substr(kHead.size(), name.size() - kHead.size() - tail.size());
  std::int32_t number = -1;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
  return error == std::errc() && end == digits.data() + digits.size() ? number : -1;
}

}  // namespace

std::vector<LocalMapFile> local_map_files(const std::filesystem::path& folder,
                                          std::string_view ending) {
  std::error_code error;
  std::filesystem::directory_iterator entries(folder, error);
  if (error)
    throw FileError(fmt::format("cannot read folder '{}': {}", folder.string(), error.message()));
  std::vector<LocalMapFile> files, matlab;
  for (const auto& entry : entries) {
    const std::string name = entry.path().filename().native();
    const std::int64_t number = number_of(name, ending);
    if (number >= 0) files.push_back({number, entry.path()});
    const std::int64_t of_matlab = number_of(name, ".mat");
    if (of_matlab >= 0) matlab.push_back({of_matlab, entry.path()});
  }
  if (files.empty() && ending == ".txt") files = std::move(matlab);
  std::sort(files.begin(), files.end(), [](const LocalMapFile& a, const LocalMapFile& b) {
    return a.number != b.number ? a.number < b.number : a.path < b.path;
  });
  return files;
}

}  // namespace mapjoin::detail
