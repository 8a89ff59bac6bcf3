#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <span>
#include <string_view>

#include "mapjoin/graph/error.h"
#include "mapjoin/graph/key.h"

namespace mapjoin {

/// What SparseCholesky::factorize returned, of a system whose variables start at `offsets`: nothing
/// for -1. \throws SingularError that names the variable of the scalar, by key_of(its number).
template <class KeyOf>
void require_determined(int failed, std::span<const int> offsets, std::string_view whose,
                        KeyOf&& key_of) {
  if (failed < 0) return;
  const auto k = std::upper_bound(offsets.begin(), offsets.end(), failed) - offsets.begin() - 1;
  throw SingularError(
      fmt::format("{} information does not determine {}; add a measurement of it or leave it out",
                  whose, to_string(key_of(static_cast<int>(k)))));
}

}  // namespace mapjoin
