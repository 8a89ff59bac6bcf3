#pragma once

#include <filesystem>
#include <variant>
#include <vector>

#include "mapjoin/graph/anchor.h"
#include "mapjoin/graph/map.h"
#include "mapjoin/graph/variable_kind.h"

/// \file
/// Maps in mapjoin's own format, extension .map: everything a Map is, bit for bit. Values of all
/// types, a user's own included, information, both anchors, and the observations a map carries.
/// Binary, little-endian, versioned, checksummed; the layout is in docs/native_map_format.md. Later
/// releases read the files of earlier ones.

namespace mapjoin {

/// The types that a file may hold. In files types are names; here is what the names mean.
///
///     auto types = builtin_types<2>();
///     types.add<Wall>();
///     const Map<2> map = read_map<2>("house.map", types);
template <int D>
struct KnownTypes {
  std::vector<const VariableKind<D>*> variables;
  std::vector<const AnchorKind<D>*> anchors;

  template <VariableType T>
  KnownTypes& add() {
    static_assert(T::ambient == D, "the type lives in a space of another dimension");
    variables.push_back(&kind_of<T>());
    return *this;
  }
  KnownTypes& add(const AnchorKind<D>& kind) {
    anchors.push_back(&kind);
    return *this;
  }
};

/// Poses, points, and all anchors that come with mapjoin.
template <int D>
KnownTypes<D> builtin_types();

using AnyMap = std::variant<Map<2>, Map<3>>;

/// Writes a map. Maps that share observations each write them. The file appears complete or not at
/// all. \throws FileError.
template <int D>
void write_map(const std::filesystem::path& file, const Map<D>& map);

/// Reads a map of known dimension.
/// \throws InputError when the file is no native map, of a later format, of the other dimension,
/// truncated or damaged (checksum and structure are verified before anything is believed), or holds
/// a type that is not among `types`; FileError.
template <int D>
Map<D> read_map(const std::filesystem::path& file, const KnownTypes<D>& types = builtin_types<D>());

/// Reads a map of whichever dimension it is. Errors as above.
AnyMap read_any_map(const std::filesystem::path& file,
                    const KnownTypes<2>& types2 = builtin_types<2>(),
                    const KnownTypes<3>& types3 = builtin_types<3>());

}  // namespace mapjoin
