#include "mapjoin/cli/input.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <fstream>
#include <system_error>

#include "mapjoin/graph/error.h"
#include "mapjoin/io/native_map.h"

namespace mapjoin::cli {

namespace {

constexpr std::string_view kNativeMagic = "\x89MJMAP";
constexpr std::uint64_t kLeastOffset = 100000;

template <int D>
bool has_all_points(const VariableSet<D>& known, const VariableSet<D>& solution) {
  const int c = known.find_column(Tag("point"));
  if (c < 0) return true;
  const auto& keys = known.column(c).keys;
  return std::all_of(keys.begin(), keys.end(),
                     [&](const Key& key) { return solution.find(key).has_value(); });
}

/// What a writer of g2o adds to the ids of points: a power of ten above all poses.
template <int D>
std::uint64_t feature_offset(const VariableSet<D>& solution) {
  std::uint64_t offset = kLeastOffset;
  const int c = solution.find_column(Tag("pose"));
  if (c < 0) return offset;
  for (const Key& key : solution.column(c).keys) {
    while (offset <= key.id) offset *= 10;
  }
  return offset;
}

/// Subtracts the offset from the ids of points that have it.
template <int D>
Values<D> without_offset(const Values<D>& values, std::uint64_t offset) {
  ValuesBuilder<D> out;
  for (int i = 0; i < values.size(); ++i) {
    Key key = values.variables().key(i);
    if (key.type == Tag("point") && key.id >= offset) key.id -= offset;
    out.add(values.variables().kind(i), key, values.value(i));
  }
  return std::move(out).build();
}

}  // namespace

InputFormat input_format(const std::filesystem::path& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) return InputFormat::kLocalMaps;
  if (!std::filesystem::exists(path, ignored)) {
    throw FileError(fmt::format("there is no file {}", path.string()));
  }
  std::ifstream stream(path, std::ios::binary);
  std::string head(kNativeMagic.size(), '\0');
  stream.read(head.data(), static_cast<std::streamsize>(head.size()));
  if (head == kNativeMagic || path.extension() == ".map") return InputFormat::kNative;
  return InputFormat::kG2o;
}

std::string list_of(const std::map<std::string, std::int64_t>& counts) {
  std::vector<std::string> parts;
  for (const auto& [tag, count] : counts) parts.push_back(fmt::format("{} {}", count, tag));
  return fmt::format("{}", fmt::join(parts, ", "));
}

std::vector<std::string> notes_of(const G2oCounts& counts) {
  std::vector<std::string> out;
  if (counts.repaired > 0) {
    out.push_back(
        fmt::format("{} information matrices were not positive semidefinite and have "
                    "been repaired",
                    counts.repaired));
  }
  if (!counts.skipped.empty()) {
    out.push_back(fmt::format("records passed over: {}", list_of(counts.skipped)));
  }
  if (counts.isolated_vertices > 0) {
    out.push_back(fmt::format("{} vertices without any measurement are not part of the result",
                              counts.isolated_vertices));
  }
  return out;
}

AnyValues read_solution(const std::filesystem::path& path, std::uint32_t session) {
  if (input_format(path) == InputFormat::kNative) {
    return std::visit([](auto&& map) -> AnyValues { return std::move(map.values); },
                      read_any_map(path));
  }
  if (input_format(path) == InputFormat::kLocalMaps) {
    throw InputError(
        fmt::format("{} is a folder; a solution is a .g2o or .map file", path.string()));
  }
  G2oOptions options;
  options.session = session;
  options.skip_unknown = true;
  return read_g2o_values(path, options);
}

AnyValues read_solution(const std::filesystem::path& path, std::uint32_t session,
                        const std::variant<VariableSet<2>, VariableSet<3>>& known) {
  return std::visit(
      [&]<int D>(const Values<D>& values) -> AnyValues {
        const auto* wanted = std::get_if<VariableSet<D>>(&known);
        if (wanted == nullptr) {
          throw InputError(fmt::format("{} is {}D but what it is compared with is {}D",
                                       path.string(), D, 5 - D));
        }
        if (has_all_points(*wanted, values.variables())) return values;
        return without_offset(values, feature_offset(values.variables()));
      },
      read_solution(path, session));
}

}  // namespace mapjoin::cli
