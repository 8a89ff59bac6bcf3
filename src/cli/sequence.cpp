#include "mapjoin/cli/sequence.h"

#include <fmt/format.h>

#include <utility>

#include "mapjoin/frames/local_map.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/io/local_map_files.h"
#include "mapjoin/io/native_map.h"

namespace mapjoin::cli {

namespace {

/// The maps of the given files, the first of which has been read.
template <int D>
AnyLocalMapSet as_sequence(const std::vector<detail::LocalMapFile>& files, AnyMap any) {
  LocalMapSet<D> set;
  set.first_number = static_cast<int>(files[0].number);
  for (std::size_t k = 0; k < files.size(); ++k) {
    const std::string path = files[k].path.string();
    if (k > 0) any = read_any_map(path);
    const auto* const map = std::get_if<Map<D>>(&any);
    if (map == nullptr)
      throw InputError(
          fmt::format("{} is {}D but {} is {}D: maps of the plane and of space cannot be joined",
                      files[0].path.string(), D, path, 5 - D));
    if (map->information.size() != map->variables().size())
      throw InputError(fmt::format(
          "{} has no information matrix, so it cannot stand as an observation of its variables",
          path));
    set.pose_feature = set.pose_feature || map->variables().find_column(Tag("point")) >= 0;
    set.maps.push_back(as_local_map(*map));
  }
  return set;
}

}  // namespace

std::vector<std::string> native_maps_in(const std::filesystem::path& folder) {
  std::vector<std::string> out;
  for (const detail::LocalMapFile& file : detail::local_map_files(folder, ".map"))
    out.push_back(file.path.string());
  return out;
}

AnyLocalMapSet read_sequence(const std::filesystem::path& folder, const LocalMapOptions& options) {
  const auto native = detail::local_map_files(folder, ".map");
  if (native.empty() || !detail::local_map_files(folder).empty())
    return read_local_maps(folder, options);
  AnyMap first = read_any_map(native[0].path);
  return std::holds_alternative<Map<2>>(first) ? as_sequence<2>(native, std::move(first))
                                               : as_sequence<3>(native, std::move(first));
}

}  // namespace mapjoin::cli
