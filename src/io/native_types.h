#pragma once

// Types and variables in native maps: names in the file, descriptions in memory. Not for users.

#include <string>
#include <vector>

#include "mapjoin/graph/variables.h"
#include "mapjoin/io/byte_stream.h"
#include "mapjoin/io/native_map.h"

namespace mapjoin::detail {

/// The types that a file uses, looked up among those that are known.
template <int D>
class FileTypes {
 public:
  /// \throws InputError that names a type which has to be registered, or which is not what it was
  /// when the file was written.
  FileTypes(ByteReader in, const KnownTypes<D>& known, const std::string& file);

  /// Reads the number of a type.
  const VariableKind<D>& variable(ByteReader& in) const;
  const AnchorKind<D>& anchor(ByteReader& in) const;
  const std::vector<const AnchorKind<D>*>& anchors() const { return anchors_; }

 private:
  std::vector<const VariableKind<D>*> variables_;
  std::vector<const AnchorKind<D>*> anchors_;
};

template <int D>
VariableSet<D> read_variables(ByteReader& in, const FileTypes<D>& types);

}  // namespace mapjoin::detail
