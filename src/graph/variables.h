#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "mapjoin/graph/variable_kind.h"

namespace mapjoin {

/// Which variables there are: for every type a sorted column of keys. No values.
///
/// Variables are numbered 0 .. size()-1 column by column, and scalars of their tangents likewise,
/// so the number, type and first scalar of any variable follow from a few integers per type. The
/// order is canonical: types by tag, keys ascending. Equal sets of keys are therefore equal
/// objects, and merging two sets is one linear sweep, no hashing.
template <int D>
class VariableSet {
 public:
  struct Column {
    const VariableKind<D>* kind = nullptr;
    std::vector<Key> keys;
    int first = 0;         ///< number of its first variable
    int first_scalar = 0;  ///< first scalar of its first variable

    int size() const { return static_cast<int>(keys.size()); }
    int end() const { return first + size(); }
  };

  VariableSet() = default;
  /// Sorts the keys of each column, drops repetitions and empty columns. Cost O(n log n), O(n) when
  /// sorted already. \throws InputError when two columns have the same tag or a key stands in a
  /// column of another type.
  explicit VariableSet(std::vector<Column> columns);

  int size() const { return columns_.empty() ? 0 : columns_.back().end(); }
  int scalars() const {
    return columns_.empty()
               ? 0
               : columns_.back().first_scalar + columns_.back().size() * columns_.back().kind->dim;
  }
  std::span<const Column> columns() const { return columns_; }

  /// Number of the column that holds variable i.
  int column_of(int i) const {
    int c = 0;
    while (i >= columns_[static_cast<std::size_t>(c)].end()) ++c;
    return c;
  }
  const Column& column(int c) const { return columns_[static_cast<std::size_t>(c)]; }
  const VariableKind<D>& kind(int i) const { return *column(column_of(i)).kind; }
  int dim(int i) const { return kind(i).dim; }
  /// First scalar of variable i.
  int offset(int i) const {
    const Column& c = column(column_of(i));
    return c.first_scalar + (i - c.first) * c.kind->dim;
  }
  /// offset(i) of every variable, and scalars() at the end. O(n).
  std::vector<int> offsets() const;
  std::vector<int> dims() const;

  const Key& key(int i) const {
    const Column& c = column(column_of(i));
    return c.keys[static_cast<std::size_t>(i - c.first)];
  }
  /// Number of the column of a type, -1 when there is none.
  int find_column(Tag tag) const;
  /// Number of a variable. O(log n).
  std::optional<int> find(const Key& key) const;
  /// Like find. \throws InputError that names the key, and `what` it was wanted for.
  int require(const Key& key, std::string_view what) const;

  friend bool operator==(const VariableSet& a, const VariableSet& b) {
    if (a.columns_.size() != b.columns_.size()) return false;
    for (std::size_t c = 0; c < a.columns_.size(); ++c) {
      if (a.columns_[c].kind->tag != b.columns_[c].kind->tag ||
          a.columns_[c].keys != b.columns_[c].keys)
        return false;
    }
    return true;
  }

 private:
  std::vector<Column> columns_;
};

/// The union of several sets. One sweep. \throws InputError when a tag stands for types of
/// different dimension.
template <int D>
VariableSet<D> unite(std::span<const VariableSet<D>* const> sets);

/// numbers[i] = number in `to` of variable i of `from`, -1 where `to` has no such key. One sweep
/// over both.
template <int D>
std::vector<int> numbers_in(const VariableSet<D>& from, const VariableSet<D>& to);

/// The subset of variables with the given ascending numbers.
template <int D>
VariableSet<D> subset(const VariableSet<D>& all, std::span<const int> numbers);

extern template class VariableSet<2>;
extern template class VariableSet<3>;

}  // namespace mapjoin
