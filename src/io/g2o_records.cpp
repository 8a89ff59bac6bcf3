#include "mapjoin/io/g2o_records.h"

#include "mapjoin/graph/world.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <limits>

namespace mapjoin::detail {

namespace {

using enum G2oRecord;

constexpr std::array<G2oTag, 15> kTags{{
    {"EDGE_SE2", kPoseEdge, 2, "EDGE_SE2 i j x y theta I11 I12 I13 I22 I23 I33"},
    {"EDGE_SE2_XY", kPointEdge, 2, "EDGE_SE2_XY i j x y I11 I12 I22"},
    {"EDGE_SE3:QUAT", kPoseEdge, 3,
     "EDGE_SE3:QUAT i j x y z qx qy qz qw and the 21 numbers I11 I12 ... I66"},
    {"EDGE_SE3_TRACKXYZ", kPointEdge, 3,
     "EDGE_SE3_TRACKXYZ i j p x y z I11 I12 I13 I22 I23 I33, p being the parameter's number, or "
     "left out"},
    {"EDGE_PRIOR_SE2", kPosePrior, 2, "EDGE_PRIOR_SE2 i x y theta I11 I12 I13 I22 I23 I33"},
    {"EDGE_SE2_PRIOR", kPosePrior, 2, "EDGE_SE2_PRIOR i x y theta I11 I12 I13 I22 I23 I33"},
    {"EDGE_PRIOR_SE2_XY", kPositionPrior, 2, "EDGE_PRIOR_SE2_XY i x y I11 I12 I22"},
    {"EDGE_SE3_PRIOR", kPosePrior, 3,
     "EDGE_SE3_PRIOR i p x y z qx qy qz qw and the 21 numbers I11 I12 ... I66, p being the "
     "parameter's number, or left out"},
    {"EDGE_SE3_PRIORXYZ", kPositionPrior, 3, "EDGE_SE3_PRIORXYZ i x y z I11 I12 I13 I22 I23 I33"},
    {"VERTEX_SE2", kPoseVertex, 2, "VERTEX_SE2 id x y theta"},
    {"VERTEX_XY", kPointVertex, 2, "VERTEX_XY id x y"},
    {"VERTEX_SE3:QUAT", kPoseVertex, 3, "VERTEX_SE3:QUAT id x y z qx qy qz qw"},
    {"VERTEX_TRACKXYZ", kPointVertex, 3, "VERTEX_TRACKXYZ id x y z"},
    {"PARAMS_SE3OFFSET", kOffset, 3, "PARAMS_SE3OFFSET p x y z qx qy qz qw"},
    {"FIX", kFix, 0, "FIX id"},
}};
constexpr G2oTag kNoTag{};

std::string written(const G2oId& id, const G2oText& file) {
  return id.session == file.session ? fmt::format("{}", id.id)
                                    : fmt::format("{}/{}", id.session, id.id);
}

}  // namespace

const G2oTag& g2o_tag(std::string_view text) {
  for (const G2oTag& tag : kTags) {
    if (tag.text == text) return tag;
  }
  return kNoTag;
}

G2oDimension g2o_dimension(const std::vector<G2oText>& files) {
  for (const G2oText& file : files) {
    TextScanner scan(file.name, file.text);
    while (scan.next_line()) {
      const G2oTag& tag = g2o_tag(scan.word());
      if (tag.dimension != 0) return {tag.dimension, std::string(tag.text), scan.where()};
    }
  }
  return {};
}

void require_dimension(const TextScanner& scan, const G2oTag& tag, const G2oDimension& first) {
  if (tag.dimension == 0 || tag.dimension == first.dimension) return;
  scan.fail(fmt::format("{} is {}D, but {} at {} is {}D", tag.text, tag.dimension, first.tag,
                        first.where, first.dimension),
            "a graph is either of the plane or of space: split the data");
}

G2oId read_g2o_id(TextScanner& scan, std::uint32_t session) {
  const std::string_view word = scan.word();
  if (word == kWorldName) return {world_key().session, world_key().id};
  const auto fail = [&](std::string_view problem) {
    scan.fail(fmt::format("vertex id '{}' {}", word, problem),
              "ids are whole numbers from 0, SESSION/ID such as 2/17, or world");
  };
  const char* at = word.data();
  const char* const end = word.data() + word.size();
  if (at == end) fail("is missing: the line ends before it");
  if (*at == '-') fail("is negative");
  G2oId out{session, 0};
  auto result = std::from_chars(at, end, out.id);
  if (result.ec == std::errc() && result.ptr != end && *result.ptr == '/') {
    if (out.id > std::numeric_limits<std::uint32_t>::max())
      fail("has a session that is out of range");
    out.session = static_cast<std::uint32_t>(out.id);
    result = std::from_chars(result.ptr + 1, end, out.id);
  }
  if (result.ec == std::errc::result_out_of_range || out.id > std::uint64_t{1} << 63U) {
    fail("is out of range");
  }
  if (result.ec != std::errc() || result.ptr != end) fail("is not an id");
  return out;
}

Key g2o_point_key(const TextScanner& scan, const G2oId& id, std::uint64_t feature_offset) {
  if (id.id < feature_offset) {
    scan.fail(fmt::format("point {} has an id below the feature offset {}", id.id, feature_offset),
              "read this file without a feature offset");
  }
  return point_key(id.id - feature_offset, id.session);
}

template <int D>
void G2oVertices<D>::read(TextScanner& scan, const G2oTag& tag, const G2oText& file) {
  Vertex v;
  v.id = read_g2o_id(scan, file.session);
  v.is_pose = tag.record == kPoseVertex;
  if (v.is_pose) {
    v.pose = read_g2o_pose<D>(scan);
  } else {
    v.pose.t = read_g2o_point<D>(scan);
  }
  scan.expect_end_of_line(v.is_pose ? "the pose" : "the point");
  v.file = &file;
  v.line = scan.line();
  vertices_.push_back(v);
}

template <int D>
auto G2oVertices<D>::sorted() -> const std::vector<Vertex>& {
  const auto less = [](const Vertex& a, const Vertex& b) { return a.id < b.id; };
  if (!std::is_sorted(vertices_.begin(), vertices_.end(), less)) {
    std::stable_sort(vertices_.begin(), vertices_.end(), less);
  }
  for (std::size_t k = 1; k < vertices_.size(); ++k) {
    const Vertex& a = vertices_[k - 1];
    const Vertex& b = vertices_[k];
    if (a.id != b.id) continue;
    const bool same = a.is_pose == b.is_pose && a.pose.t == b.pose.t && a.pose.R == b.pose.R;
    if (same) continue;
    throw InputError(
        fmt::format("{}:{}: conflicting vertices: {} stands here with another {} than at {}:{}; "
                    "keep one of the two",
                    b.file->name, b.line, written(b.id, *b.file),
                    a.is_pose == b.is_pose ? "value" : "type", a.file->name, a.line));
  }
  const auto repeated = [](const Vertex& a, const Vertex& b) { return a.id == b.id; };
  vertices_.erase(std::unique(vertices_.begin(), vertices_.end(), repeated), vertices_.end());
  return vertices_;
}

template class G2oVertices<2>;
template class G2oVertices<3>;

}  // namespace mapjoin::detail
