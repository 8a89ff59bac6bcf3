#include "mapjoin/graph/key_numbering.h"

#include <algorithm>

#include "mapjoin/graph/index.h"

namespace mapjoin {

template <int D>
void KeyNumbering<D>::add(const VariableKind<D>& kind, std::span<const Key> keys) {
  auto at = std::find_if(columns_.begin(), columns_.end(),
                         [&](const Column& c) { return c.kind->tag == kind.tag; });
  if (at == columns_.end()) {
    columns_.push_back({});
    at = columns_.end() - 1;
    at->kind = &kind;
  }
  if (keys.empty()) return;
  const std::uint32_t session = at->parts.empty() ? keys[0].session : at->parts[0][0].session;
  for (const Key& key : keys) {
    at->one_session = at->one_session && key.session == session;
    at->lowest = std::min(at->lowest, key.id);
    at->highest = std::max(at->highest, key.id);
  }
  at->parts.push_back(keys);
  at->size += keys.size();
}

template <int D>
const VariableSet<D>& KeyNumbering<D>::number() {
  std::vector<typename VariableSet<D>::Column> columns;
  for (Column& c : columns_) {
    if (c.parts.empty()) continue;
    typename VariableSet<D>::Column out{c.kind, {}, 0, 0};
    if (dense(c)) {
      c.table.assign(static_cast<std::size_t>(c.highest - c.lowest) + 1, -1);
      for (const std::span<const Key> keys : c.parts) {
        for (const Key& key : keys) c.table[static_cast<std::size_t>(key.id - c.lowest)] = 0;
      }
      out.keys.reserve(at(std::count(c.table.begin(), c.table.end(), 0)));
      for (std::size_t k = 0; k < c.table.size(); ++k) {
        if (c.table[k] == 0) out.keys.push_back({c.kind->tag, c.parts[0][0].session, c.lowest + k});
      }
    } else {
      for (const std::span<const Key> keys : c.parts) {
        for (const Key& key : keys) {
          if (out.keys.empty() || out.keys.back() != key) out.keys.push_back(key);
        }
      }
    }
    c.parts = {};
    columns.push_back(std::move(out));
  }
  set_ = VariableSet<D>(std::move(columns));
  for (Column& c : columns_) {
    if (c.table.empty()) continue;
    std::int32_t next = set_.column(set_.find_column(c.kind->tag)).first;
    for (std::int32_t& entry : c.table) {
      if (entry == 0) entry = next++;
    }
  }
  return set_;
}

template <int D>
std::vector<std::int32_t> KeyNumbering<D>::numbers(std::span<const Key> keys) const {
  std::vector<std::int32_t> out;
  out.reserve(keys.size());
  const Column* column = nullptr;
  for (const Key& key : keys) {
    if (column == nullptr || column->kind->tag != key.type) {
      column = &*std::find_if(columns_.begin(), columns_.end(),
                              [&](const Column& c) { return c.kind->tag == key.type; });
    }
    out.push_back(column->table.empty()
                      ? set_.require(key, "numbering")
                      : column->table[static_cast<std::size_t>(key.id - column->lowest)]);
  }
  return out;
}

template class KeyNumbering<2>;
template class KeyNumbering<3>;

}  // namespace mapjoin
