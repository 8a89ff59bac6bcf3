#include <fmt/format.h>

#include <utility>
#include <variant>
#include <vector>

#include "mapjoin/io/g2o.h"
#include "mapjoin/io/g2o_records.h"
#include "mapjoin/io/read_file.h"

namespace mapjoin {

namespace {

using detail::G2oDimension;
using detail::G2oRecord;
using detail::G2oTag;
using detail::G2oText;
using detail::G2oVertices;

template <int D>
Values<D> read_values(const G2oText& file, const G2oOptions& options,
                      const G2oDimension& dimension) {
  G2oVertices<D> vertices;
  TextScanner scan(file.name, file.text);
  while (scan.next_line()) {
    const std::string_view word = scan.word();
    if (!word.starts_with("VERTEX_")) continue;
    const G2oTag& tag = detail::g2o_tag(word);
    if (tag.record == G2oRecord::kUnknown) {
      if (options.skip_unknown) continue;
      scan.fail(fmt::format("unknown record {}", word),
                "remove it, or skip such lines with --skip-unknown");
    }
    require_dimension(scan, tag, dimension);
    scan.expect(tag.format);
    vertices.read(scan, tag, file);
    if (tag.record == G2oRecord::kPointVertex) {
      // Checked here, while the line is at hand.
      const auto& last = vertices.last();
      g2o_point_key(scan, last.id, options.feature_offset);
    }
  }
  ValuesBuilder<D> builder;
  for (const auto& v : vertices.sorted()) {
    if (v.is_pose) {
      builder.template add<PoseType<D>>(g2o_pose_key(v.id), v.pose);
    } else {
      builder.template add<PointType<D>>(point_key(v.id.id - options.feature_offset, v.id.session),
                                         v.pose.t);
    }
  }
  Values<D> out = std::move(builder).build();
  if (out.size() == 0) {
    throw InputError(fmt::format(
        "{}: there is no vertex in this file; a solution needs VERTEX_ lines", file.name));
  }
  return out;
}

}  // namespace

std::variant<Values<2>, Values<3>> read_g2o_values(const std::filesystem::path& file,
                                                   const G2oOptions& options) {
  std::vector<G2oText> texts;
  texts.push_back({file.string(), options.session, read_file(file)});
  const G2oDimension dimension = detail::g2o_dimension(texts);
  if (dimension.dimension == 2) return read_values<2>(texts[0], options, dimension);
  return read_values<3>(texts[0], options, dimension);
}

}  // namespace mapjoin
