#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mapjoin/graph/variables.h"

namespace mapjoin {

/// From keys to the numbers of a VariableSet: the one place where measurements stop being keyed.
///
/// Add all keys, call number(), then translate. Ids that are dense enough go through a table,
/// others by binary search.
template <int D>
class KeyNumbering {
 public:
  /// The keys must outlive number().
  void add(const VariableKind<D>& kind, std::span<const Key> keys);
  /// The set of all keys added. O(n) when each type's ids are dense and of one session, else O(n
  /// log n).
  const VariableSet<D>& number();
  /// Numbers of keys that were added.
  std::vector<std::int32_t> numbers(std::span<const Key> keys) const;

 private:
  struct Column {
    const VariableKind<D>* kind;
    std::vector<std::span<const Key>> parts;
    std::size_t size = 0;  // of all parts
    std::uint64_t lowest = ~std::uint64_t{0};
    std::uint64_t highest = 0;
    bool one_session = true;
    std::vector<std::int32_t> table;  // number by id - lowest, where dense
  };
  bool dense(const Column& c) const {
    return c.one_session && c.highest - c.lowest < 8 * c.size + 64;
  }

  std::vector<Column> columns_;
  VariableSet<D> set_;
};

extern template class KeyNumbering<2>;
extern template class KeyNumbering<3>;

}  // namespace mapjoin
