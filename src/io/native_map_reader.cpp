#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "mapjoin/frames/anchors.h"
#include "mapjoin/frames/points_anchor.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/io/native_layout.h"
#include "mapjoin/io/native_map.h"
#include "mapjoin/io/native_observations.h"
#include "mapjoin/io/native_types.h"
#include "mapjoin/io/read_file.h"

namespace mapjoin {

namespace {

/// A file whose header, checksum and section table are in order.
class MapFile {
 public:
  explicit MapFile(const std::filesystem::path& path)
      : name_(path.string()), bytes_(read_file(path)) {
    check_header();
    read_table();
  }

  int dimension() const { return dimension_; }
  const std::string& name() const { return name_; }
  bool has(std::string_view tag) const { return find(tag) != nullptr; }
  ByteReader section(std::string_view tag) const {
    const Section* section = find(tag);
    if (section == nullptr) fail(fmt::format("the section '{}' is missing", tag), kDamaged);
    return {fmt::format("{}: section '{}'", name_, tag), section->bytes};
  }

 private:
  static constexpr std::string_view kDamaged = "the file is damaged: copy or write it again";

  struct Section {
    std::string tag;
    std::string_view bytes;
  };

  [[noreturn]] void fail(const std::string& problem, std::string_view remedy) const {
    throw InputError(fmt::format("{}: {}; {}", name_, problem, remedy));
  }
  template <class T>
  T header(std::size_t at) const {
    T out;
    std::memcpy(&out, bytes_.data() + at, sizeof(T));
    return out;
  }
  const Section* find(std::string_view tag) const {
    const auto at = std::find_if(sections_.begin(), sections_.end(),
                                 [&](const Section& s) { return s.tag == tag; });
    return at == sections_.end() ? nullptr : &*at;
  }

  void check_header() {
    if (!bytes_.starts_with(detail::kMapMagic.substr(0, std::min<std::size_t>(8, bytes_.size()))) ||
        bytes_.empty()) {
      fail("this is not a native map", "native maps are written by mapjoin, with extension .map");
    }
    if (bytes_.size() < detail::kHeaderSize) {
      fail(fmt::format("the file ends after {} bytes, within its header", bytes_.size()), kDamaged);
    }
    if (const auto version = header<std::uint32_t>(8); version != detail::kMapVersion) {
      fail(fmt::format("format version {}, but this mapjoin reads version {}", version,
                       detail::kMapVersion),
           "read it with the mapjoin that wrote it, or a later one");
    }
    if (const auto size = header<std::uint64_t>(16); size != bytes_.size()) {
      fail(fmt::format("the file has {} bytes, but its header says {}", bytes_.size(), size),
           kDamaged);
    }
    if (header<std::uint64_t>(detail::kChecksumAt) != detail::map_checksum(bytes_)) {
      fail("the checksum does not match the content", kDamaged);
    }
    dimension_ = static_cast<int>(header<std::uint32_t>(12));
    if (dimension_ != 2 && dimension_ != 3)
      fail(fmt::format("a map of dimension {}", dimension_), kDamaged);
  }

  void read_table() {
    const std::string_view all = bytes_;
    ByteReader table(name_ + ": section table", all.substr(detail::kHeaderSize));
    const std::size_t count = table.count("the section table", 32);
    for (std::size_t k = 0; k < count; ++k) {
      Section section{table.tag("tag"), {}};
      const auto flags = table.number<std::uint64_t>("flags");
      const auto at = table.number<std::uint64_t>("offset");
      const auto size = table.number<std::uint64_t>("size");
      table.require(at <= all.size() && size <= all.size() - at, "a section lies outside the file");
      section.bytes = all.substr(at, size);
      const bool known = std::find(kKnown.begin(), kKnown.end(), section.tag) != kKnown.end();
      if (!known && (flags & detail::kRequired) != 0) {
        fail(fmt::format("the section '{}' is needed to understand this map, and this mapjoin does "
                         "not know it",
                         section.tag),
             "read it with a later mapjoin");
      }
      sections_.push_back(std::move(section));
    }
  }

  static constexpr std::array<std::string_view, 5> kKnown{
      detail::kTypesSection, detail::kValuesSection, detail::kInformationSection,
      detail::kAnchorsSection, detail::kObservationsSection};
  std::string name_;
  std::string bytes_;
  int dimension_ = 0;
  std::vector<Section> sections_;
};

template <int D>
Values<D> read_values(ByteReader in, const detail::FileTypes<D>& types) {
  Values<D> values{detail::read_variables(in, types)};
  int column = 0;
  for (const auto& c : values.variables().columns()) {
    const std::vector<double> numbers = in.array<double>("values");
    in.require(numbers.size() == c.keys.size() * static_cast<std::size_t>(c.kind->value_size),
               "there is another number of values than of variables");
    std::copy(numbers.begin(), numbers.end(), values.data(column++));
  }
  in.expect_end();
  return values;
}

template <int D>
Anchor<D> read_anchor(ByteReader& in, const detail::FileTypes<D>& types) {
  Anchor<D> anchor;
  if (in.number<std::uint64_t>("anchor") == 0) return anchor;
  anchor.kind = &types.anchor(in);
  const std::size_t count = in.count("keys of an anchor", 24);
  in.require(static_cast<int>(count) == anchor.kind->arity,
             "an anchor has another number of keys than its kind");
  for (std::size_t k = 0; k < count; ++k) {
    Key key;
    const std::string type = in.tag("type of an anchor's key");
    in.require(!type.empty(), "an anchor's key has no type");
    key.type = Tag(type);
    key.session = in.number<std::uint32_t>("session of an anchor's key");
    key.id = in.number<std::uint64_t>("id of an anchor's key");
    in.require(key.type == anchor.kind->types[k],
               "an anchor's key is of another type than its kind asks for");
    anchor.keys.push_back(key);
  }
  return anchor;
}

template <int D>
Map<D> read(const MapFile& file, const KnownTypes<D>& known) {
  const detail::FileTypes<D> types(file.section(detail::kTypesSection), known, file.name());
  Map<D> map;
  map.values = read_values(file.section(detail::kValuesSection), types);
  ByteReader information = file.section(detail::kInformationSection);
  map.information = BlockMatrixFile::read(information);
  information.expect_end();
  information.require(map.information.offsets() == map.variables().offsets(),
                      "the information matrix is not over the variables of the map");
  ByteReader anchors = file.section(detail::kAnchorsSection);
  map.anchor = read_anchor(anchors, types);
  map.solved_in = read_anchor(anchors, types);
  anchors.expect_end();
  // The map may have been solved in the frame of a variable that was marginalised since.
  for (const Key& key : map.anchor.keys) {
    anchors.require(map.variables().find(key).has_value(),
                    "the anchor's variable is not in the map");
  }
  if (file.has(detail::kObservationsSection)) {
    map.observations = std::make_shared<const MeasurementGraph<D>>(
        detail::read_observations(file.section(detail::kObservationsSection), types));
  }
  return map;
}

}  // namespace

template <int D>
KnownTypes<D> builtin_types() {
  KnownTypes<D> types;
  types.template add<PoseType<D>>().template add<PointType<D>>();
  types.add(pose_anchor_kind<D>()).add(points_anchor_kind<D>());
  return types;
}

template <int D>
Map<D> read_map(const std::filesystem::path& path, const KnownTypes<D>& types) {
  const MapFile file(path);
  if (file.dimension() != D) {
    throw InputError(fmt::format(
        "{}: this map is {}D, but a {}D map is wanted; all maps of one task have to be of the same "
        "dimension",
        file.name(), file.dimension(), D));
  }
  return read<D>(file, types);
}

AnyMap read_any_map(const std::filesystem::path& path, const KnownTypes<2>& types2,
                    const KnownTypes<3>& types3) {
  const MapFile file(path);
  if (file.dimension() == 2) return read<2>(file, types2);
  return read<3>(file, types3);
}

template KnownTypes<2> builtin_types<2>();
template KnownTypes<3> builtin_types<3>();
template Map<2> read_map<2>(const std::filesystem::path&, const KnownTypes<2>&);
template Map<3> read_map<3>(const std::filesystem::path&, const KnownTypes<3>&);

}  // namespace mapjoin
