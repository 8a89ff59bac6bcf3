#include "mapjoin/cli/truth.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "mapjoin/cli/input.h"
#include "mapjoin/frames/anchors.h"
#include "mapjoin/io/read_file.h"
#include "mapjoin/io/text_scanner.h"

namespace mapjoin::cli {

namespace {

/// The session of a map's points, if they have one.
template <int D>
std::uint32_t session_of_points(const VariableSet<D>& variables) {
  const int c = variables.find_column(Tag("point"));
  return c < 0 ? 0 : variables.column(c).keys.front().session;
}

template <int D>
Values<D> read_features(const std::filesystem::path& path, const Map<D>& map) {
  std::string content = read_file(path);
  std::replace(content.begin(), content.end(), ',', ' ');
  TextScanner scan(path.string(), content);
  scan.expect(D == 2 ? "id,x,y" : "id,x,y,z");
  ValuesBuilder<D> builder;
  const std::uint32_t session = session_of_points(map.variables());
  for (bool first = true; scan.next_line(); first = false) {
    const char begin = scan.line_text().front();
    if (first && (std::isalpha(static_cast<unsigned char>(begin)) != 0 || begin == '"')) continue;
    const std::int64_t id = scan.integer("id");
    if (id < 0) scan.fail("a feature's id is negative", "number features from 0");
    Vec<D> position;
    for (int k = 0; k < D; ++k) position(k) = scan.number(std::string_view("xyz").substr(k, 1));
    scan.expect_end_of_line("coordinates");
    builder.template add<PointType<D>>(point_key(static_cast<std::uint64_t>(id), session),
                                       position);
  }
  if (map.anchor.kind == &pose_anchor_kind<D>())
    builder.template add<PoseType<D>>(map.anchor.keys[0], Rigid<D>::identity());
  return std::move(builder).build();
}

}  // namespace

template <int D>
Values<D> read_truth(const std::filesystem::path& path, const Map<D>& map) {
  if (path.extension() == ".csv") return read_features(path, map);
  return std::get<Values<D>>(
      read_solution(path, session_of_points(map.variables()), map.variables()));
}

template Values<2> read_truth<2>(const std::filesystem::path&, const Map<2>&);
template Values<3> read_truth<3>(const std::filesystem::path&, const Map<3>&);

}  // namespace mapjoin::cli
