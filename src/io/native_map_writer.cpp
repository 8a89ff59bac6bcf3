#include <algorithm>
#include <string>
#include <vector>

#include "mapjoin/io/atomic_file.h"
#include "mapjoin/io/native_layout.h"
#include "mapjoin/io/native_map.h"

namespace mapjoin {

namespace {

/// Numbers the types of a file in the order they are first used.
template <int D>
class TypeNumbers {
 public:
  std::uint32_t operator()(const VariableKind<D>& kind) { return number_in(variables_, &kind); }
  std::uint32_t operator()(const AnchorKind<D>& kind) { return number_in(anchors_, &kind); }

  void write(ByteWriter& out) const {
    out.number(std::uint64_t{variables_.size()});
    for (const VariableKind<D>* kind : variables_) {
      out.tag(kind->tag.text());
      out.number(static_cast<std::uint64_t>(kind->dim));
      out.number(static_cast<std::uint64_t>(kind->value_size));
    }
    out.number(std::uint64_t{anchors_.size()});
    for (const AnchorKind<D>* kind : anchors_) {
      out.tag(kind->tag.text());
      out.number(static_cast<std::uint64_t>(kind->arity));
    }
  }

 private:
  template <class Kind>
  static std::uint32_t number_in(std::vector<const Kind*>& known, const Kind* kind) {
    const auto at = std::find_if(known.begin(), known.end(),
                                 [&](const Kind* k) { return k->tag == kind->tag; });
    const auto number = static_cast<std::uint32_t>(at - known.begin());
    if (at == known.end()) known.push_back(kind);
    return number;
  }

  std::vector<const VariableKind<D>*> variables_;
  std::vector<const AnchorKind<D>*> anchors_;
};

template <int D>
void write_variables(ByteWriter& out, const VariableSet<D>& set, TypeNumbers<D>& types) {
  out.number(std::uint64_t{set.columns().size()});
  for (const auto& c : set.columns()) {
    std::vector<std::uint32_t> sessions;
    std::vector<std::uint64_t> ids;
    for (const Key& key : c.keys) {
      sessions.push_back(key.session);
      ids.push_back(key.id);
    }
    out.number(types(*c.kind));
    out.array(sessions);
    out.array(ids);
  }
}

template <int D>
std::string values_section(const Values<D>& values, TypeNumbers<D>& types) {
  ByteWriter out;
  write_variables(out, values.variables(), types);
  int column = 0;
  for (const auto& c : values.variables().columns()) {
    const auto size = c.keys.size() * static_cast<std::size_t>(c.kind->value_size);
    out.array(std::span<const double>(values.data(column++), size));
  }
  return out.bytes();
}

template <int D>
void write_anchor(ByteWriter& out, const Anchor<D>& anchor, TypeNumbers<D>& types) {
  out.number(std::uint64_t{anchor.kind != nullptr});
  if (anchor.kind == nullptr) return;
  out.number(types(*anchor.kind));
  out.number(std::uint64_t{anchor.keys.size()});
  for (const Key& key : anchor.keys) {
    out.tag(key.type.text());
    out.number(std::uint64_t{key.session});
    out.number(key.id);
  }
}

template <int D>
std::string observations_section(const MeasurementGraph<D>& graph, TypeNumbers<D>& types) {
  ByteWriter out;
  write_variables(out, graph.variables, types);
  out.number(std::uint64_t{graph.relative.size()});
  for (const RelativeMeasurements<D>& m : graph.relative) {
    out.number(types(*m.kind));
    out.array(m.from);
    out.array(m.to);
    out.array(m.z);
    out.array(m.info);
  }
  std::vector<std::uint32_t> anchors;
  for (const AnchorKind<D>* kind : graph.submaps.anchors) anchors.push_back(types(*kind));
  out.array(anchors);
  detail::for_each_submap_array(graph.submaps,
                                [&](const auto& array, const char*) { out.array(array); });
  return out.bytes();
}

struct Section {
  std::string_view tag;
  std::string bytes;
  std::uint64_t flags = detail::kRequired;
};

std::string assembled(int dimension, const std::vector<Section>& sections) {
  ByteWriter table;
  table.number(std::uint64_t{sections.size()});
  std::uint64_t at = detail::kHeaderSize + 8 + 32 * sections.size();
  for (const Section& section : sections) {
    table.tag(section.tag);
    table.number(section.flags);
    table.number(at);
    table.number(std::uint64_t{section.bytes.size()});
    at += section.bytes.size();
  }
  std::string file(detail::kHeaderSize, '\0');
  const auto put = [&file](std::size_t place, auto value) {
    std::memcpy(file.data() + place, &value, sizeof(value));
  };
  file.reserve(at);
  file.replace(0, 8, detail::kMapMagic);
  put(8, detail::kMapVersion);
  put(12, static_cast<std::uint32_t>(dimension));
  put(16, at);
  file += table.bytes();
  for (const Section& section : sections) file += section.bytes;
  put(detail::kChecksumAt, detail::map_checksum(file));
  return file;
}

}  // namespace

template <int D>
void write_map(const std::filesystem::path& file, const Map<D>& map) {
  TypeNumbers<D> types;
  std::vector<Section> sections;
  sections.push_back({detail::kValuesSection, values_section(map.values, types)});
  ByteWriter information;
  BlockMatrixFile::write(information, map.information);
  sections.push_back({detail::kInformationSection, information.bytes()});
  ByteWriter anchors;
  write_anchor(anchors, map.anchor, types);
  write_anchor(anchors, map.solved_in, types);
  sections.push_back({detail::kAnchorsSection, anchors.bytes()});
  if (map.observations != nullptr) {
    sections.push_back(
        {detail::kObservationsSection, observations_section(*map.observations, types), 0});
  }
  ByteWriter table;
  types.write(table);
  sections.insert(sections.begin(), {detail::kTypesSection, table.bytes()});
  write_atomically(file, assembled(D, sections));
}

template void write_map<2>(const std::filesystem::path&, const Map<2>&);
template void write_map<3>(const std::filesystem::path&, const Map<3>&);

}  // namespace mapjoin
