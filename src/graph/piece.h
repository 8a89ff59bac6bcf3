#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mapjoin/graph/measurement_graph.h"
#include "mapjoin/graph/values.h"

namespace mapjoin {

/// A rigid piece of a map while it is being joined: values of some of the variables of one
/// measurement graph, and the observations they came from.
///
/// Variables are named by their numbers in the graph, ascending, so pieces of one graph compare and
/// merge by sweeps over integers: no key is looked at during a join.
template <int D>
struct Piece {
  std::vector<int> variables;  ///< ascending numbers in the graph
  std::vector<int>
      column_start;  ///< per column of the graph's VariableSet: first entry of `variables`
  std::vector<std::vector<double>> data;   ///< per column: value_size doubles a variable
  std::vector<std::int64_t> observations;  ///< numbers in the graph

  int size() const { return static_cast<int>(variables.size()); }
  int column_size(std::size_t c) const { return column_start[c + 1] - column_start[c]; }
};

/// An empty piece over the given ascending variables, with room for their values.
template <int D>
Piece<D> make_piece(const VariableSet<D>& all, std::vector<int> variables);

/// The doubles of the k-th variable of a piece.
template <int D>
double* value_of(const VariableSet<D>& all, Piece<D>& piece, int k) {
  std::size_t c = 0;
  while (k >= piece.column_start[c + 1]) ++c;
  return piece.data[c].data() + static_cast<std::ptrdiff_t>(k - piece.column_start[c]) *
                                    all.column(static_cast<int>(c)).kind->value_size;
}

/// Moves a piece rigidly.
template <int D>
void move(const VariableSet<D>& all, Piece<D>& piece, const Rigid<D>& T);

/// The piece as values with keys.
template <int D>
Values<D> to_values(const VariableSet<D>& all, const Piece<D>& piece);

/// Values as a piece of a larger set of variables, which holds all of theirs.
template <int D>
Piece<D> to_piece(const VariableSet<D>& all, const Values<D>& values);

/// x = x [+] d, d in the order of the piece's variables.
template <int D>
void retract(const VariableSet<D>& all, Piece<D>& piece, std::span<const double> d);

/// The same for the variables at places first .. last - 1 of the piece alone; `d` is that of all.
/// Parts without common places may be done at the same time.
template <int D>
void retract(const VariableSet<D>& all, Piece<D>& piece, std::span<const double> d, int first,
             int last);

/// Tangents at `from` become those at the piece's values that do the same in the map's frame, for
/// the variables at places first .. last - 1 of the piece; `from` is as piece.data is, `d` that of
/// all.
template <int D>
void transport(const VariableSet<D>& all, const std::vector<std::vector<double>>& from,
               const Piece<D>& piece, std::span<double> d, int first, int last);

/// First scalar of every variable of the piece in its stacked tangent, and the number of scalars at
/// the end.
template <int D>
std::vector<int> offsets_of(const VariableSet<D>& all, const Piece<D>& piece);

/// Workspace of one thread: where each variable of the graph stands in the piece at hand, -1
/// elsewhere.
class Places {
 public:
  explicit Places(int variables) : place_(static_cast<std::size_t>(variables), -1) {}
  std::int32_t operator[](int variable) const { return place_[static_cast<std::size_t>(variable)]; }
  void set(int variable, int place) { place_[static_cast<std::size_t>(variable)] = place; }
  void mark(std::span<const int> variables) {
    for (std::size_t k = 0; k < variables.size(); ++k) set(variables[k], static_cast<int>(k));
  }
  void clear(std::span<const int> variables) {
    for (const int v : variables) set(v, -1);
  }

 private:
  std::vector<std::int32_t> place_;
};

}  // namespace mapjoin
