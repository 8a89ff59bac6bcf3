#include "mapjoin/graph/variables.h"

#include <fmt/format.h>

#include <algorithm>

#include "mapjoin/graph/error.h"

namespace mapjoin {

template <int D>
VariableSet<D>::VariableSet(std::vector<Column> columns) : columns_(std::move(columns)) {
  std::erase_if(columns_, [](const Column& c) { return c.keys.empty(); });
  std::sort(columns_.begin(), columns_.end(),
            [](const Column& a, const Column& b) { return a.kind->tag < b.kind->tag; });
  int first = 0;
  int scalar = 0;
  for (std::size_t k = 0; k < columns_.size(); ++k) {
    Column& c = columns_[k];
    if (k > 0 && columns_[k - 1].kind->tag == c.kind->tag) {
      throw InputError(fmt::format(
          "two variable types are called '{}': give each type its own name", c.kind->tag.text()));
    }
    if (!std::is_sorted(c.keys.begin(), c.keys.end())) std::sort(c.keys.begin(), c.keys.end());
    c.keys.erase(std::unique(c.keys.begin(), c.keys.end()), c.keys.end());
    if (c.keys.front().type != c.kind->tag || c.keys.back().type != c.kind->tag) {
      throw InputError(fmt::format("key {} stands among variables of type '{}'",
                                   to_string(c.keys.front()), c.kind->tag.text()));
    }
    c.first = first;
    c.first_scalar = scalar;
    first += c.size();
    scalar += c.size() * c.kind->dim;
  }
}

template <int D>
std::vector<int> VariableSet<D>::offsets() const {
  std::vector<int> out;
  out.reserve(static_cast<std::size_t>(size()) + 1);
  for (const Column& c : columns_) {
    for (int k = 0; k < c.size(); ++k) out.push_back(c.first_scalar + k * c.kind->dim);
  }
  out.push_back(scalars());
  return out;
}

template <int D>
std::vector<int> VariableSet<D>::dims() const {
  std::vector<int> out;
  out.reserve(static_cast<std::size_t>(size()));
  for (const Column& c : columns_) out.insert(out.end(), c.keys.size(), c.kind->dim);
  return out;
}

template <int D>
int VariableSet<D>::find_column(Tag tag) const {
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    if (columns_[c].kind->tag == tag) return static_cast<int>(c);
  }
  return -1;
}

template <int D>
std::optional<int> VariableSet<D>::find(const Key& key) const {
  const int c = find_column(key.type);
  if (c < 0) return std::nullopt;
  const std::vector<Key>& keys = column(c).keys;
  const auto at = std::lower_bound(keys.begin(), keys.end(), key);
  if (at == keys.end() || *at != key) return std::nullopt;
  return column(c).first + static_cast<int>(at - keys.begin());
}

template <int D>
int VariableSet<D>::require(const Key& key, std::string_view what) const {
  if (const auto i = find(key)) return *i;
  throw InputError(fmt::format("{}: there is no variable {} in this map{}", what, to_string(key),
                               size() == 0
                                   ? " (it is empty)"
                                   : fmt::format("; it has {} ... {}", to_string(this->key(0)),
                                                 to_string(this->key(size() - 1)))));
}

template <int D>
VariableSet<D> unite(std::span<const VariableSet<D>* const> sets) {
  std::vector<typename VariableSet<D>::Column> columns;
  for (const VariableSet<D>* set : sets) {
    for (const auto& c : set->columns()) {
      auto at = std::find_if(columns.begin(), columns.end(),
                             [&](const auto& o) { return o.kind->tag == c.kind->tag; });
      if (at == columns.end()) {
        columns.push_back({c.kind, {}, 0, 0});
        at = columns.end() - 1;
      }
      if (at->kind->dim != c.kind->dim || at->kind->value_size != c.kind->value_size) {
        throw InputError(
            fmt::format("variables called '{}' have {} dimensions in one map and {} in another",
                        c.kind->tag.text(), at->kind->dim, c.kind->dim));
      }
      at->keys.insert(at->keys.end(), c.keys.begin(), c.keys.end());
    }
  }
  return VariableSet<D>(std::move(columns));
}

template <int D>
std::vector<int> numbers_in(const VariableSet<D>& from, const VariableSet<D>& to) {
  std::vector<int> out(static_cast<std::size_t>(from.size()), -1);
  for (const auto& c : from.columns()) {
    const int other = to.find_column(c.kind->tag);
    if (other < 0) continue;
    const auto& target = to.column(other);
    auto at = target.keys.begin();
    // Sets of very different size: search instead of sweeping.
    const bool search = static_cast<std::size_t>(c.size()) * 16 < target.keys.size();
    for (int k = 0; k < c.size() && at != target.keys.end(); ++k) {
      const Key& key = c.keys[static_cast<std::size_t>(k)];
      if (search) {
        at = std::lower_bound(at, target.keys.end(), key);
      } else {
        while (at != target.keys.end() && *at < key) ++at;
      }
      if (at != target.keys.end() && *at == key) {
        out[static_cast<std::size_t>(c.first + k)] =
            target.first + static_cast<int>(at - target.keys.begin());
      }
    }
  }
  return out;
}

template <int D>
VariableSet<D> subset(const VariableSet<D>& all, std::span<const int> numbers) {
  std::vector<typename VariableSet<D>::Column> columns;
  std::size_t at = 0;
  for (const auto& c : all.columns()) {
    columns.push_back({c.kind, {}, 0, 0});
    for (; at < numbers.size() && numbers[at] < c.end(); ++at) {
      columns.back().keys.push_back(c.keys[static_cast<std::size_t>(numbers[at] - c.first)]);
    }
  }
  return VariableSet<D>(std::move(columns));
}

#define MAPJOIN_INSTANTIATE(D)                                                           \
  template class VariableSet<D>;                                                         \
  template VariableSet<D> unite<D>(std::span<const VariableSet<D>* const>);              \
  template std::vector<int> numbers_in<D>(const VariableSet<D>&, const VariableSet<D>&); \
  template VariableSet<D> subset<D>(const VariableSet<D>&, std::span<const int>);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
