#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "mapjoin/graph/variables.h"

namespace mapjoin {

/// The whole numbers that stand for poses and points in formats that know neither sessions nor
/// types.
///
/// An id is itself wherever that is unambiguous. Points are moved up by 100000, or by the next
/// power of ten above the largest pose id, when asked for or when a pose has the same id. Variables
/// of several sessions become session * 10^k + id, with the smallest k that keeps sessions apart.
template <int D>
class PlainIds {
 public:
  /// For all variables of the sets. \throws InputError for variables that are neither poses nor
  /// points (`format` is what cannot say them), and for ids that outgrow 63 bits.
  PlainIds(std::span<const VariableSet<D>* const> sets, bool offset_features,
           const std::string& format);

  /// The number of a variable of these sets; the world has none.
  std::uint64_t operator()(const Key& key) const {
    return key.session * session_factor_ + key.id +
           (key.type == Tag("point") ? feature_offset_ : 0);
  }
  /// Sentences that say what was added, to be written as comments.
  std::vector<std::string> notes() const;

  std::uint64_t feature_offset() const { return feature_offset_; }

 private:
  std::uint64_t feature_offset_ = 0;
  std::uint64_t session_factor_ = 0;  // 0: one session, not written
};

extern template class PlainIds<2>;
extern template class PlainIds<3>;

}  // namespace mapjoin
