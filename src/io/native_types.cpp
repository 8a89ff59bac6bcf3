#include "mapjoin/io/native_types.h"

#include <fmt/format.h>

#include <algorithm>

#include "mapjoin/graph/error.h"

namespace mapjoin::detail {

namespace {

template <class Kind>
const Kind* find(const std::vector<const Kind*>& known, const std::string& tag) {
  const auto at =
      std::find_if(known.begin(), known.end(), [&](const Kind* k) { return k->tag.text() == tag; });
  return at == known.end() ? nullptr : *at;
}

template <class Kind>
const Kind& numbered(const std::vector<const Kind*>& kinds, ByteReader& in) {
  const auto number = in.number<std::uint32_t>("number of a type");
  in.require(number < kinds.size(), "the number of a type is not in the table of types");
  return *kinds[number];
}

}  // namespace

template <int D>
FileTypes<D>::FileTypes(ByteReader in, const KnownTypes<D>& known, const std::string& file) {
  const std::size_t variables = in.count("the table of types", 24);
  for (std::size_t k = 0; k < variables; ++k) {
    const std::string tag = in.tag("name of a type");
    const auto dim = in.number<std::uint64_t>("dimension of a type");
    const auto size = in.number<std::uint64_t>("size of a type");
    const VariableKind<D>* kind = find(known.variables, tag);
    if (kind == nullptr) {
      throw InputError(
          fmt::format("{}: the map holds variables of type '{}' (dimension {}), which is not "
                      "registered; add it to the known "
                      "types that are given to read_map: types.add<YourType>()",
                      file, tag, dim));
    }
    if (static_cast<std::uint64_t>(kind->dim) != dim ||
        static_cast<std::uint64_t>(kind->value_size) != size) {
      throw InputError(
          fmt::format("{}: in the file type '{}' has dimension {} and {} numbers a value, in this "
                      "program {} and {}; register "
                      "the type the file was written with",
                      file, tag, dim, size, kind->dim, kind->value_size));
    }
    variables_.push_back(kind);
  }
  const std::size_t anchors = in.count("the table of anchor kinds", 16);
  for (std::size_t k = 0; k < anchors; ++k) {
    const std::string tag = in.tag("name of an anchor kind");
    const auto arity = in.number<std::uint64_t>("arity of an anchor kind");
    const AnchorKind<D>* kind = find(known.anchors, tag);
    if (kind == nullptr || static_cast<std::uint64_t>(kind->arity) != arity) {
      throw InputError(
          fmt::format("{}: the map is anchored by '{}' with {} variables, which is not registered; "
                      "add it to the known types "
                      "that are given to read_map",
                      file, tag, arity));
    }
    anchors_.push_back(kind);
  }
  in.expect_end();
}

template <int D>
const VariableKind<D>& FileTypes<D>::variable(ByteReader& in) const {
  return numbered(variables_, in);
}

template <int D>
const AnchorKind<D>& FileTypes<D>::anchor(ByteReader& in) const {
  return numbered(anchors_, in);
}

template <int D>
VariableSet<D> read_variables(ByteReader& in, const FileTypes<D>& types) {
  const std::size_t count = in.count("columns of variables", 24);
  std::vector<typename VariableSet<D>::Column> columns;
  for (std::size_t c = 0; c < count; ++c) {
    const VariableKind<D>& kind = types.variable(in);
    const auto sessions = in.array<std::uint32_t>("sessions");
    const auto ids = in.array<std::uint64_t>("ids");
    in.require(sessions.size() == ids.size() && !ids.empty(),
               "there are not as many sessions as ids");
    in.require(columns.empty() || columns.back().kind->tag < kind.tag,
               "types do not stand in their order");
    columns.push_back({&kind, {}, 0, 0});
    std::vector<Key>& keys = columns.back().keys;
    keys.reserve(ids.size());
    for (std::size_t k = 0; k < ids.size(); ++k) {
      keys.push_back({kind.tag, sessions[k], ids[k]});
      in.require(k == 0 || keys[k - 1] < keys[k], "keys do not ascend");
    }
  }
  return VariableSet<D>(std::move(columns));
}

template class FileTypes<2>;
template class FileTypes<3>;
template VariableSet<2> read_variables<2>(ByteReader&, const FileTypes<2>&);
template VariableSet<3> read_variables<3>(ByteReader&, const FileTypes<3>&);

}  // namespace mapjoin::detail
