#pragma once

// What reader and writer of native maps have to agree on. Explained in docs/native_map_format.md.
// Not for users.

#include <cstdint>
#include <string_view>

#include "mapjoin/graph/block_matrix.h"
#include "mapjoin/graph/measurement_graph.h"
#include "mapjoin/io/byte_stream.h"

namespace mapjoin {

namespace detail {

/// As in PNG: bytes that a transfer in text mode, or one that drops the eighth bit, would change.
inline constexpr std::string_view kMapMagic{"\x89MJMAP\r\n", 8};
inline constexpr std::uint32_t kMapVersion = 1;

// Header: magic, version (u32), dimension (u32), size of the file (u64), checksum (u64) of all
// other bytes.
inline constexpr std::size_t kChecksumAt = 24;
inline constexpr std::size_t kHeaderSize = 32;

inline constexpr std::uint64_t kRequired =
    1;  ///< flag: who does not know this section must not read the file

inline constexpr std::string_view kTypesSection = "types";
inline constexpr std::string_view kValuesSection = "values";
inline constexpr std::string_view kInformationSection = "inform";
inline constexpr std::string_view kAnchorsSection = "anchors";
inline constexpr std::string_view kObservationsSection = "observed";

/// The checksum of a whole file, leaving out where it stands itself.
inline std::uint64_t map_checksum(std::string_view file) {
  return checksum(file.substr(kHeaderSize), checksum(file.substr(0, kChecksumAt)));
}

/// Calls f for every array of SubmapObservations but `anchors`, in the order of the file.
template <class Maps, class F>
void for_each_submap_array(Maps& maps, F&& f) {
  f(maps.anchor_start, "start of anchors");
  f(maps.anchor_variables, "variables of anchors");
  f(maps.term_start, "start of terms");
  f(maps.term_variable, "variables of terms");
  f(maps.term_value, "places of values");
  f(maps.values, "values");
  f(maps.block_start, "start of blocks");
  f(maps.block_row, "rows of blocks");
  f(maps.block_column, "columns of blocks");
  f(maps.block_value, "places of blocks");
  f(maps.information, "information");
}

}  // namespace detail

/// A SymmetricBlockMatrix as its three arrays: offsets, block columns, numbers.
class BlockMatrixFile {
 public:
  static void write(ByteWriter& out, const SymmetricBlockMatrix& matrix);
  /// \throws InputError when the arrays are no symmetric block matrix.
  static SymmetricBlockMatrix read(ByteReader& in);
};

}  // namespace mapjoin
