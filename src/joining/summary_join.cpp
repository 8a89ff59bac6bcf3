#include "mapjoin/joining/summary_join.h"

#include <fmt/format.h>

#include <algorithm>

#include "mapjoin/frames/anchors.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/frames/gauge.h"
#include "mapjoin/frames/points_anchor.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/graph/index.h"
#include "mapjoin/joining/place.h"
#include "mapjoin/joining/require_determined.h"
#include "mapjoin/solvers/gauge_scalars.h"
#include "mapjoin/solvers/sparse_cholesky.h"

namespace mapjoin {

namespace {

int place_of(const std::vector<int>& variables, int variable) {
  const auto found = std::lower_bound(variables.begin(), variables.end(), variable);
  return found != variables.end() && *found == variable
             ? static_cast<int>(found - variables.begin())
             : -1;
}

/// The places of an anchor's variables in a piece.
template <int D>
std::vector<int> anchor_places(const VariableSet<D>& all, const Piece<D>& piece,
                               const Anchor<D>& anchor) {
  std::vector<int> out;
  for (const Key& key : anchor.keys) {
    out.push_back(place_of(piece.variables, all.require(key, "common variable")));
    if (out.back() < 0)
      throw DisconnectedError(
          fmt::format("{} is not in both maps; they can only be joined in the frame of what both "
                      "have",
                      to_string(key)));
  }
  return out;
}

template <int D>
std::vector<double*> values_at(const VariableSet<D>& all, Piece<D>& piece,
                               const std::vector<int>& places) {
  std::vector<double*> out;
  for (const int place : places) out.push_back(value_of(all, piece, place));
  return out;
}

/// What an anchor holds of a piece that is written in its frame.
struct Held {
  AnchorRows rows;                   ///< of places in the piece
  std::vector<PieceScalar> scalars;  ///< that the anchor drops from the state
};

template <int D>
Held held_by(const VariableSet<D>& all, Piece<D>& piece, const Anchor<D>& anchor) {
  Held out;
  const std::vector<int> places = anchor_places(all, piece, anchor);
  ValuesBuilder<D> builder;  // of the anchor's variables alone
  for (std::size_t k = 0; k < places.size(); ++k) {
    builder.add(all.kind(piece.variables[at(places[k])]), anchor.keys[k],
                value_of(all, piece, places[k]));
  }
  out.rows = anchor_rows(anchor, std::move(builder).build());
  if (out.rows.pinned.empty())
    throw InputError(to_string(anchor) +
                     " pins mixtures of coordinates, which no column of A stands for; join in the "
                     "frame of a pose or of points");
  auto scalar = out.rows.scalars.begin();
  for (std::size_t k = 0; k < places.size(); ++k) {
    for (int s = 0; s < all.dim(piece.variables[at(places[k])]); ++s, ++scalar) {
      if (std::binary_search(out.rows.pinned.begin(), out.rows.pinned.end(), *scalar))
        out.scalars.push_back({places[k], s});
    }
  }
  std::sort(out.scalars.begin(), out.scalars.end());
  out.rows.variables = places;
  return out;
}

template <int D>
void write_in(const VariableSet<D>& all, Summary<D>& map, const Anchor<D>& anchor) {
  const auto values = values_at(all, map.piece, anchor_places(all, map.piece, anchor));
  move(all, map, anchor.kind->frame(values.data(), anchor.keys.data()));
  anchor.kind->pin(values.data());
}

/// Scalars of the equations' columns.
std::vector<int> columns_of(const JoinEquations& equations, std::span<const PieceScalar> scalars) {
  std::vector<int> out;
  for (const PieceScalar& s : scalars)
    out.push_back(equations.column_offset[at(s.variable)] + s.scalar);
  return out;
}

/// One solve of (16) about x with the given scalars held: x becomes x [+] d.
template <int D>
void solve_step(const VariableSet<D>& all, std::span<const Summary<D>* const> maps, Piece<D>& x,
                std::span<const PieceScalar> held) {
  const JoinEquations equations = join_equations(all, maps, x);
  const SymmetricBlockMatrix normal = equations.normal_matrix();
  const std::vector<int> dropped = columns_of(equations, held);
  SparseCholesky cholesky;
  cholesky.analyze(normal, dropped);
  require_determined(cholesky.factorize(normal), equations.column_offset, "joining: the maps'",
                     [&](int k) { return all.key(x.variables[at(k)]); });
  const Eigen::VectorXd d = cholesky.solve(equations.right_hand_side());
  retract(all, x, std::span<const double>(d.data(), at(d.size())));
}

/// The points that a piece without poses is solved in the frame of; none where it has a pose, or no
/// such points.
template <int D>
Anchor<D> points_for(const VariableSet<D>& all, const Piece<D>& piece) {
  if (lowest_pose(all, piece) >= 0) return {};
  return farthest_points(to_values(all, piece)).value_or(Anchor<D>());
}

/// One solve that holds what `joined.solved_in` pins, where it says; else the lowest pose, or the
/// most independent scalars.
template <int D>
void solve_in_frame(const VariableSet<D>& all, std::span<const Summary<D>* const> maps,
                    Summary<D>& joined) {
  Piece<D>& x = joined.piece;
  if (joined.solved_in.kind == nullptr) {
    solve_step(all, maps, x, gauge_scalars(all, x, lowest_pose(all, x)));
    return;
  }
  const Held held = held_by(all, x, joined.solved_in);
  solve_step<D>(all, maps, x, held.scalars);
  joined.solved_in.kind->pin(values_at(all, x, held.rows.variables).data());
}

template <int D>
std::vector<const Summary<D>*> pointers(const std::vector<Summary<D>>& maps) {
  std::vector<const Summary<D>*> out;
  for (const Summary<D>& map : maps) out.push_back(&map);
  return out;
}

}  // namespace

template <int D>
void move(const VariableSet<D>& all, Summary<D>& summary, const Rigid<D>& T) {
  std::vector<MovedColumn<D>> columns;
  for (std::size_t c = 0; c < summary.piece.data.size(); ++c) {
    columns.push_back({all.column(static_cast<int>(c)).kind, summary.piece.data[c].data(),
                       summary.piece.column_start[c], summary.piece.column_size(c)});
  }
  move_information<D>(summary.information, columns, T);
  move(all, summary.piece, T);
}

template <int D>
std::vector<Summary<D>> join_summaries(const VariableSet<D>& all, std::vector<Summary<D>> maps,
                                       int solves, Places& places) {
  for (;;) {
    if (maps.size() <= 1) return maps;
    std::vector<Piece<D>> pieces;
    for (const Summary<D>& map : maps) pieces.push_back(map.piece);
    std::vector<Summary<D>> out;
    for (const PlacedGroup<D>& group : place_groups(all, pieces, places)) {
      std::vector<Summary<D>> members;
      for (std::size_t m = 0; m < group.members.size(); ++m) {
        members.push_back(std::move(maps[at(group.members[m])]));
        move(all, members.back(), group.motions[m]);
      }
      if (members.size() == 1) {
        out.push_back(std::move(members[0]));
        continue;
      }
      Summary<D> joined;
      joined.piece = unite(all, pieces, group.members);
      joined.solved_in = points_for(all, joined.piece);
      if (joined.solved_in.kind != nullptr) {
        const Rigid<D> into = motion_into(joined.solved_in, to_values(all, joined.piece));
        for (Summary<D>& member : members) move(all, member, into);
        move(all, joined.piece, into);
      }
      const auto parts = pointers(members);
      for (int s = 0; s < solves; ++s) solve_in_frame<D>(all, parts, joined);
      joined.information = join_equations<D>(all, parts, joined.piece).normal_matrix();
      out.push_back(std::move(joined));
    }
    const bool done = out.size() == maps.size();
    maps = std::move(out);
    if (done) return maps;
  }
}

template <int D>
Summary<D> join_as_published(const VariableSet<D>& all, Summary<D> first, Summary<D> second,
                             const Anchor<D>& common, bool complete) {
  for (Summary<D>* map : {&first, &second}) write_in(all, *map, common);
  std::vector<Piece<D>> pieces{first.piece, second.piece};
  Summary<D> joined;
  joined.piece = unite(all, pieces, {0, 1});
  joined.solved_in = common;
  const Summary<D>* const maps[2] = {&first, &second};
  solve_in_frame<D>(all, maps, joined);

  const JoinEquations equations = join_equations<D>(all, maps, joined.piece);
  joined.information = equations.normal_matrix();
  if (!complete) return joined;
  // (17) in the frame of what is common, whose pinned rows and columns are not part of it; then
  // completed exactly.
  const Held held = held_by(all, joined.piece, common);
  leave_out(joined.information, columns_of(equations, held.scalars));
  joined.information = complete_gauge(gauge_rows(all, joined.piece), held.rows, joined.information);
  return joined;
}

#define MAPJOIN_INSTANTIATE(D)                                                               \
  template void move<D>(const VariableSet<D>&, Summary<D>&, const Rigid<D>&);                \
  template std::vector<Summary<D>> join_summaries<D>(const VariableSet<D>&,                  \
                                                     std::vector<Summary<D>>, int, Places&); \
  template Summary<D> join_as_published<D>(const VariableSet<D>&, Summary<D>, Summary<D>,    \
                                           const Anchor<D>&, bool);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
