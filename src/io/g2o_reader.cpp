#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "mapjoin/graph/world.h"
#include "mapjoin/io/g2o.h"
#include "mapjoin/io/g2o_records.h"
#include "mapjoin/io/read_file.h"

namespace mapjoin {

namespace {

using detail::G2oDimension;
using detail::G2oId;
using detail::G2oRecord;
using detail::G2oTag;
using detail::G2oText;
using detail::G2oVertices;

/// Reads files of one dimension into one builder.
template <int D>
class GraphReader {
 public:
  GraphReader(const G2oOptions& options, const G2oDimension& dimension)
      : options_(options), dimension_(dimension) {}

  void reserve(const std::vector<G2oText>& files);
  void read(const G2oText& file);
  G2oGraph finish(const std::vector<G2oText>& files) &&;

 private:
  static constexpr int kPoseDim = kGauge<D>;
  static constexpr std::array<int, 2> kPoseParts{D, kRotation<D>};
  static constexpr std::array<int, 1> kPointParts{D};

  struct Fix {
    Key key;
    std::string where;
  };

  void read_record(TextScanner& scan, const G2oTag& tag, const G2oText& file);
  void read_pose_edge(TextScanner& scan, const G2oText& file);
  void read_point_edge(TextScanner& scan, const G2oText& file);
  void read_pose_prior(TextScanner& scan, const G2oTag& tag, const G2oText& file);
  void read_position_prior(TextScanner& scan, const G2oTag& tag, const G2oText& file);
  void read_offset(TextScanner& scan);
  Mat<kPoseDim, kPoseDim> read_pose_information(TextScanner& scan);
  void read_fix(TextScanner& scan, const G2oText& file);
  void skip(const TextScanner& scan, std::string_view tag);
  void check_kinds(const MeasurementGraph<D>& graph, const std::vector<G2oText>& files) const;
  void check_vertices(const MeasurementGraph<D>& graph);
  void check_fix(const MeasurementGraph<D>& graph) const;
  const Rigid<3>& offset(const TextScanner& scan, std::int64_t number) const;

  const G2oOptions& options_;
  const G2oDimension& dimension_;
  MeasurementGraphBuilder<D> builder_;
  G2oVertices<D> vertices_;
  InformationGate gate_{options_.indefinite};
  std::vector<std::pair<std::int64_t, Rigid<3>>> offsets_;  // of the current file
  std::optional<Fix> fix_of_file_;                          // of the current file
  std::optional<Fix> fix_;                                  // the first of all
  std::int64_t pose_edges_ = 0;
  std::int64_t point_edges_ = 0;
  std::int64_t priors_ = 0;
  G2oCounts counts_;
};

/// Room for all edges: arrays that grow touch three times the memory, and fresh pages cost more
/// than reading what goes there.
template <int D>
void GraphReader<D>::reserve(const std::vector<G2oText>& files) {
  constexpr std::size_t kShortestEdge = 24;  // bytes; lines that are shorter will be refused
  std::size_t poses = 0, points = 0;
  for (const G2oText& file : files) {
    TextScanner scan(file.name, file.text);
    while (scan.next_line()) {
      const std::string_view tag = scan.word();
      if (scan.line_text().size() < kShortestEdge) continue;
      const G2oRecord record = detail::g2o_tag(tag).record;
      if (record == G2oRecord::kPoseEdge || record == G2oRecord::kPosePrior) ++poses;
      if (record == G2oRecord::kPointEdge) ++points;
    }
  }
  builder_.reserve(kind_of<PoseType<D>>(), poses);
  builder_.reserve(kind_of<PointType<D>>(), points);
}

template <int D>
void GraphReader<D>::read(const G2oText& file) {
  const std::int64_t edges_before = pose_edges_ + point_edges_ + priors_;
  offsets_.clear();
  fix_of_file_.reset();
  gate_ = InformationGate(options_.indefinite);
  TextScanner scan(file.name, file.text);
  while (scan.next_line()) {
    const std::string_view word = scan.word();
    const G2oTag& tag = detail::g2o_tag(word);
    if (tag.record == G2oRecord::kUnknown) {
      skip(scan, word);
      continue;
    }
    require_dimension(scan, tag, dimension_);
    scan.expect(tag.format);
    read_record(scan, tag, file);
  }
  gate_.finish();
  counts_.repaired += gate_.repaired();
  if (!fix_) fix_ = fix_of_file_;
  if (pose_edges_ + point_edges_ + priors_ == edges_before) {
    throw InputError(fmt::format(
        "{}: there is no measurement in this file; a graph needs at least one EDGE_ line "
        "(vertices alone are a solution, not a graph)",
        file.name));
  }
}

template <int D>
void GraphReader<D>::read_record(TextScanner& scan, const G2oTag& tag, const G2oText& file) {
  switch (tag.record) {
    case G2oRecord::kPoseEdge:
      return read_pose_edge(scan, file);
    case G2oRecord::kPointEdge:
      return read_point_edge(scan, file);
    case G2oRecord::kPosePrior:
      return read_pose_prior(scan, tag, file);
    case G2oRecord::kPositionPrior:
      return read_position_prior(scan, tag, file);
    case G2oRecord::kOffset:
      return read_offset(scan);
    case G2oRecord::kFix:
      return read_fix(scan, file);
    default:
      return vertices_.read(scan, tag, file);
  }
}

void refuse_self_loop(const TextScanner& scan, const G2oId& from, const G2oId& to) {
  if (from == to) {
    scan.fail(fmt::format("this edge leads from vertex {} to itself, which says nothing", from.id),
              "remove it or correct the ids");
  }
}

template <int D>
void GraphReader<D>::read_pose_edge(TextScanner& scan, const G2oText& file) {
  const G2oId from = detail::read_g2o_id(scan, file.session);
  const G2oId to = detail::read_g2o_id(scan, file.session);
  refuse_self_loop(scan, from, to);
  const Rigid<D> z = detail::read_g2o_pose<D>(scan);
  const Mat<kPoseDim, kPoseDim> information = read_pose_information(scan);
  builder_.template add<PoseType<D>>(g2o_pose_key(from), g2o_pose_key(to), z, information);
  ++pose_edges_;
}

/// Of a relative pose: in the library's tangent.
template <int D>
Mat<GraphReader<D>::kPoseDim, GraphReader<D>::kPoseDim> GraphReader<D>::read_pose_information(
    TextScanner& scan) {
  Mat<kPoseDim, kPoseDim> information = detail::read_g2o_information<kPoseDim>(scan);
  scan.expect_end_of_line("the information matrix");
  if (D == 3 && options_.quaternion_information) {
    information.template bottomRows<kRotation<D>>() *= 0.5;
    information.template rightCols<kRotation<D>>() *= 0.5;
  }
  gate_.check(information, kPoseParts, scan.place());
  return information;
}

template <int D>
void GraphReader<D>::read_pose_prior(TextScanner& scan, const G2oTag& tag, const G2oText& file) {
  const G2oId id = detail::read_g2o_id(scan, file.session);
  const Rigid<3>* sensor = nullptr;
  if (D == 3 && (!offsets_.empty() || scan.words_left() != 28)) {
    sensor = &offset(scan, scan.integer("the parameter's number"));
  }
  Rigid<D> z = detail::read_g2o_pose<D>(scan);
  Mat<kPoseDim, kPoseDim> information = read_pose_information(scan);
  if constexpr (D == 3) {
    if (sensor != nullptr) {
      // The sensor's pose is known: x o = z, so x = z o^-1. Tangents at z o^-1 and at z, to first
      // order: d_z = J d.
      z = z * sensor->inverse();
      Mat<6, 6> J = Mat<6, 6>::Zero();
      J.topLeftCorner<3, 3>() = sensor->R.transpose();
      J.topRightCorner<3, 3>() = -(sensor->R.transpose() * skew(sensor->t));
      J.bottomRightCorner<3, 3>() = sensor->R.transpose();
      information = Mat<6, 6>(J.transpose() * information * J);
      information = Mat<6, 6>(0.5 * (information + information.transpose()));
    }
  }
  builder_.template add<PoseType<D>>(world_key(), g2o_pose_key(id), z, information);
  ++priors_;
  ++counts_.edges[std::string(tag.text)];
}

template <int D>
void GraphReader<D>::read_position_prior(TextScanner& scan, const G2oTag& tag,
                                         const G2oText& file) {
  const G2oId id = detail::read_g2o_id(scan, file.session);
  const Vec<D> position = detail::read_g2o_point<D>(scan);
  Mat<D, D> information = detail::read_g2o_information<D>(scan);
  scan.expect_end_of_line("the information matrix");
  gate_.check(information, kPointParts, scan.place());
  const PoseMeasurement<D> fix = position_fix<D>(position, information);
  builder_.template add<PoseType<D>>(world_key(), g2o_pose_key(id), fix.z, fix.information);
  ++priors_;
  ++counts_.edges[std::string(tag.text)];
}

template <int D>
void GraphReader<D>::read_point_edge(TextScanner& scan, const G2oText& file) {
  const G2oId from = detail::read_g2o_id(scan, file.session);
  const G2oId to = detail::read_g2o_id(scan, file.session);
  refuse_self_loop(scan, from, to);
  // Without parameters in the file the number may be left out; with them a missing number is a
  // truncated line.
  const Rigid<3>* sensor = nullptr;
  if (D == 3 && (!offsets_.empty() || scan.words_left() != 9)) {
    sensor = &offset(scan, scan.integer("the parameter's number"));
  }
  Vec<D> z = detail::read_g2o_point<D>(scan);
  Mat<D, D> information = detail::read_g2o_information<D>(scan);
  scan.expect_end_of_line("the information matrix");
  if constexpr (D == 3) {
    if (sensor != nullptr) {
      z = *sensor * z;
      information = Mat<3, 3>(sensor->R * information * sensor->R.transpose());
      information = Mat<3, 3>(0.5 * (information + information.transpose()));
    }
  }
  gate_.check(information, kPointParts, scan.place());
  builder_.template add<PointType<D>>(
      g2o_pose_key(from), g2o_point_key(scan, to, options_.feature_offset), z, information);
  ++point_edges_;
}

template <int D>
void GraphReader<D>::read_offset(TextScanner& scan) {
  const std::int64_t number = scan.integer("the parameter's number");
  const Rigid<3> sensor = detail::read_g2o_pose<3>(scan);
  scan.expect_end_of_line("the offset");
  for (const auto& [known, pose] : offsets_) {
    if (known == number)
      scan.fail(fmt::format("parameter {} is given twice", number), "keep one of the two");
  }
  offsets_.emplace_back(number, sensor);
}

template <int D>
const Rigid<3>& GraphReader<D>::offset(const TextScanner& scan, std::int64_t number) const {
  for (const auto& [known, pose] : offsets_) {
    if (known == number) return pose;
  }
  scan.fail(fmt::format("parameter {} is not given above", number),
            fmt::format("add the line PARAMS_SE3OFFSET {} x y z qx qy qz qw before it (0 0 0 0 0 0 "
                        "1 for a sensor at the pose)",
                        number));
}

template <int D>
void GraphReader<D>::read_fix(TextScanner& scan, const G2oText& file) {
  while (!scan.at_end_of_line()) {
    const Fix fix{g2o_pose_key(detail::read_g2o_id(scan, file.session)), scan.where()};
    if (!fix_of_file_) {
      fix_of_file_ = fix;
    } else if (fix_of_file_->key != fix.key) {
      if (!options_.skip_unknown) {
        scan.fail(
            fmt::format("a second vertex is fixed (the first is {} at {})", fix_of_file_->key.id,
                        fix_of_file_->where),
            "a frame is fixed by one pose: keep one FIX, or skip the others with --skip-unknown; "
            "a known position is a measurement from a vertex that stands for the world");
      }
      ++counts_.skipped["FIX"];
    }
  }
}

template <int D>
void GraphReader<D>::skip(const TextScanner& scan, std::string_view tag) {
  if (options_.skip_unknown) {
    ++counts_.skipped[std::string(tag)];
  } else if (tag.find("PRIOR") != std::string_view::npos) {
    scan.fail(fmt::format("{} is a prior, and mapjoin's graphs are relative", tag),
              "write it as a measurement from a vertex that stands for the world, or skip such "
              "lines with "
              "--skip-unknown");
  } else {
    scan.fail(fmt::format("unknown record {}", tag),
              "remove it, or skip such lines with --skip-unknown");
  }
}

/// Where an id is first used as what an edge makes of it.
struct FirstUses {
  std::string as_pose, as_point;
};

FirstUses first_uses(const std::vector<G2oText>& files, const G2oId& wanted) {
  FirstUses out;
  for (const G2oText& file : files) {
    TextScanner scan(file.name, file.text);
    while (scan.next_line()) {
      const G2oTag& tag = detail::g2o_tag(scan.word());
      const bool prior =
          tag.record == G2oRecord::kPosePrior || tag.record == G2oRecord::kPositionPrior;
      if (!prior && tag.record != G2oRecord::kPoseEdge && tag.record != G2oRecord::kPointEdge)
        continue;
      const bool from = detail::read_g2o_id(scan, file.session) == wanted;
      const bool to = !prior && detail::read_g2o_id(scan, file.session) == wanted;
      const bool point = to && tag.record == G2oRecord::kPointEdge;
      std::string& use = point ? out.as_point : out.as_pose;
      if ((from || to) && use.empty()) use = scan.where();
    }
  }
  return out;
}

template <int D>
std::span<const Key> keys_of(const MeasurementGraph<D>& graph, Tag tag) {
  const int c = graph.variables.find_column(tag);
  if (c < 0) return {};
  return graph.variables.column(c).keys;
}

template <int D>
void GraphReader<D>::check_kinds(const MeasurementGraph<D>& graph,
                                 const std::vector<G2oText>& files) const {
  const auto poses = keys_of(graph, Tag("pose"));
  auto pose = poses.begin();
  for (const Key& point : keys_of(graph, Tag("point"))) {
    const G2oId id{point.session, point.id + options_.feature_offset};
    const Key key = g2o_pose_key(id);
    while (pose != poses.end() && *pose < key) ++pose;
    if (pose == poses.end() || *pose != key) continue;
    const FirstUses uses = first_uses(files, id);
    throw InputError(
        fmt::format("{}: vertex {} is a point here, but a pose at {}; renumber one of the two",
                    uses.as_point, id.id, uses.as_pose));
  }
}

template <int D>
void GraphReader<D>::check_vertices(const MeasurementGraph<D>& graph) {
  const auto& variables = graph.variables;
  for (const auto& v : vertices_.sorted()) {
    const bool pose = variables.find(g2o_pose_key(v.id)).has_value();
    const bool point =
        v.id.id >= options_.feature_offset &&
        variables.find(point_key(v.id.id - options_.feature_offset, v.id.session)).has_value();
    if (!pose && !point) ++counts_.isolated_vertices;
    if (v.is_pose ? point : pose) {
      throw InputError(fmt::format(
          "{}:{}: vertex {} is a {} here, but the edges use it as a {}; correct the tag or the ids",
          v.file->name, v.line, v.id.id, v.is_pose ? "pose" : "point",
          v.is_pose ? "point" : "pose"));
    }
  }
}

template <int D>
void GraphReader<D>::check_fix(const MeasurementGraph<D>& graph) const {
  if (!fix_ || graph.variables.find(fix_->key)) return;
  throw InputError(fmt::format(
      "{}: FIX names vertex {}, which is not a pose of any measurement; fix a pose that "
      "an edge starts from",
      fix_->where, fix_->key.id));
}

template <int D>
G2oGraph GraphReader<D>::finish(const std::vector<G2oText>& files) && {
  MeasurementGraph<D> graph = std::move(builder_).build();
  check_kinds(graph, files);
  check_vertices(graph);
  check_fix(graph);
  counts_.poses = std::ssize(keys_of(graph, Tag("pose")));
  if (graph.variables.find(world_key())) --counts_.poses;
  counts_.points = std::ssize(keys_of(graph, Tag("point")));
  if (pose_edges_ > 0) counts_.edges[D == 2 ? "EDGE_SE2" : "EDGE_SE3:QUAT"] = pose_edges_;
  if (point_edges_ > 0) counts_.edges[D == 2 ? "EDGE_SE2_XY" : "EDGE_SE3_TRACKXYZ"] = point_edges_;
  G2oGraph out;
  out.dimension = D;
  out.graph = std::move(graph);
  if (fix_) out.fixed = fix_->key;
  out.counts = std::move(counts_);
  return out;
}

template <int D>
G2oGraph read_files(const std::vector<G2oText>& files, const G2oOptions& options,
                    const G2oDimension& dimension) {
  GraphReader<D> reader(options, dimension);
  reader.reserve(files);
  for (const G2oText& file : files) reader.read(file);
  return std::move(reader).finish(files);
}

}  // namespace

G2oGraph read_g2o(std::span<const G2oSource> files, const G2oOptions& options) {
  std::vector<G2oText> texts;
  for (const G2oSource& file : files) {
    texts.push_back({file.path.string(), file.session, read_file(file.path)});
  }
  const G2oDimension dimension = detail::g2o_dimension(texts);
  return dimension.dimension == 2 ? read_files<2>(texts, options, dimension)
                                  : read_files<3>(texts, options, dimension);
}

G2oGraph read_g2o(const std::filesystem::path& file, const G2oOptions& options) {
  const G2oSource source{file, options.session};
  return read_g2o(std::span(&source, 1), options);
}

}  // namespace mapjoin
