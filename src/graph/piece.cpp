#include "mapjoin/graph/piece.h"

#include <algorithm>
#include <cstring>

#include "mapjoin/graph/index.h"

namespace mapjoin {

template <int D>
Piece<D> make_piece(const VariableSet<D>& all, std::vector<int> variables) {
  Piece<D> piece;
  piece.variables = std::move(variables);
  piece.column_start.push_back(0);
  for (const auto& column : all.columns()) {
    const auto end = std::lower_bound(piece.variables.begin() + piece.column_start.back(),
                                      piece.variables.end(), column.end());
    const auto size =
        static_cast<std::size_t>(end - piece.variables.begin() - piece.column_start.back());
    piece.data.emplace_back(size * static_cast<std::size_t>(column.kind->value_size));
    piece.column_start.push_back(static_cast<int>(end - piece.variables.begin()));
  }
  return piece;
}

template <int D>
void move(const VariableSet<D>& all, Piece<D>& piece, const Rigid<D>& T) {
  for (std::size_t c = 0; c < piece.data.size(); ++c) {
    all.column(static_cast<int>(c))
        .kind->transform(T, piece.data[c].data(), static_cast<std::size_t>(piece.column_size(c)));
  }
}

template <int D>
Values<D> to_values(const VariableSet<D>& all, const Piece<D>& piece) {
  Values<D> out{subset(all, piece.variables)};
  int to = 0;
  for (const auto& data : piece.data) {
    if (data.empty()) continue;
    std::memcpy(out.data(to++), data.data(), data.size() * sizeof(double));
  }
  return out;
}

template <int D>
Piece<D> to_piece(const VariableSet<D>& all, const Values<D>& values) {
  Piece<D> piece = make_piece(all, numbers_in(values.variables(), all));
  int from = 0;
  for (auto& data : piece.data) {
    if (data.empty()) continue;
    std::memcpy(data.data(), values.data(from++), data.size() * sizeof(double));
  }
  return piece;
}

namespace {

/// Calls with the variables at places first .. last - 1 of a piece, column by column: (column, its
/// kind, first double in the column's values, first scalar in the piece's tangent, variables).
template <int D, class F>
void for_each_stretch(const VariableSet<D>& all, const Piece<D>& piece, int first, int last,
                      F&& call) {
  std::size_t scalar = 0;
  for (std::size_t c = 0; c < piece.data.size(); ++c) {
    const VariableKind<D>& kind = *all.column(static_cast<int>(c)).kind;
    const int from = std::clamp(first - piece.column_start[c], 0, piece.column_size(c));
    const int to = std::clamp(last - piece.column_start[c], from, piece.column_size(c));
    call(c, kind, at(from) * at(kind.value_size), scalar + at(from) * at(kind.dim), at(to - from));
    scalar += at(piece.column_size(c)) * at(kind.dim);
  }
}

}  // namespace

template <int D>
void retract(const VariableSet<D>& all, Piece<D>& piece, std::span<const double> d, int first,
             int last) {
  for_each_stretch(
      all, piece, first, last,
      [&](std::size_t c, const VariableKind<D>& kind, std::size_t value, std::size_t scalar,
          std::size_t n) { kind.retract(piece.data[c].data() + value, d.data() + scalar, n); });
}

template <int D>
void transport(const VariableSet<D>& all, const std::vector<std::vector<double>>& from,
               const Piece<D>& piece, std::span<double> d, int first, int last) {
  for_each_stretch(all, piece, first, last,
                   [&](std::size_t c, const VariableKind<D>& kind, std::size_t value,
                       std::size_t scalar, std::size_t n) {
                     if (kind.transport == nullptr) return;
                     kind.transport(from[c].data() + value, piece.data[c].data() + value,
                                    d.data() + scalar, n);
                   });
}

template <int D>
void retract(const VariableSet<D>& all, Piece<D>& piece, std::span<const double> d) {
  retract(all, piece, d, 0, piece.size());
}

template <int D>
std::vector<int> offsets_of(const VariableSet<D>& all, const Piece<D>& piece) {
  std::vector<int> out{0};
  out.reserve(piece.variables.size() + 1);
  for (std::size_t c = 0; c < piece.data.size(); ++c) {
    const int dim = all.column(static_cast<int>(c)).kind->dim;
    for (int k = 0; k < piece.column_size(c); ++k) out.push_back(out.back() + dim);
  }
  return out;
}

#define MAPJOIN_INSTANTIATE(D)                                                                   \
  template Piece<D> to_piece<D>(const VariableSet<D>&, const Values<D>&);                        \
  template void retract<D>(const VariableSet<D>&, Piece<D>&, std::span<const double>);           \
  template void retract<D>(const VariableSet<D>&, Piece<D>&, std::span<const double>, int, int); \
  template void transport<D>(const VariableSet<D>&, const std::vector<std::vector<double>>&,     \
                             const Piece<D>&, std::span<double>, int, int);                      \
  template std::vector<int> offsets_of<D>(const VariableSet<D>&, const Piece<D>&);               \
  template Piece<D> make_piece<D>(const VariableSet<D>&, std::vector<int>);                      \
  template void move<D>(const VariableSet<D>&, Piece<D>&, const Rigid<D>&);                      \
  template Values<D> to_values<D>(const VariableSet<D>&, const Piece<D>&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
