#include "mapjoin/joining/summary_join.h"

#include <fmt/format.h>

#include <algorithm>

#include "mapjoin/frames/anchors.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/frames/gauge.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/joining/place.h"
#include "mapjoin/solvers/gauge_scalars.h"
#include "mapjoin/solvers/sparse_cholesky.h"

namespace mapjoin {

namespace {

std::size_t at(std::int64_t k) { return static_cast<std::size_t>(k); }

/// Place of the lowest pose in a piece, -1 where it has none.
template <int D>
int lowest_pose(const VariableSet<D>& all, const Piece<D>& piece) {
  const int c = all.find_column(Tag("pose"));
  return c < 0 || piece.column_size(at(c)) == 0 ? -1 : piece.column_start[at(c)];
}

int place_of(const std::vector<int>& variables, int variable) {
  const auto found = std::lower_bound(variables.begin(), variables.end(), variable);
  return found != variables.end() && *found == variable
             ? static_cast<int>(found - variables.begin())
             : -1;
}

/// One solve of (16) about x, with the given pose (or features, when negative) pinned: x becomes x
/// [+] d.
template <int D>
void solve_step(const VariableSet<D>& all, std::span<const Summary<D>* const> maps, Piece<D>& x,
                int pinned_pose) {
  const JoinEquations equations = join_equations(all, maps, x);
  const SymmetricBlockMatrix normal = equations.normal_matrix();
  std::vector<int> dropped;
  for (const PieceScalar& s : gauge_scalars(all, x, pinned_pose)) {
    dropped.push_back(equations.column_offset[at(s.variable)] + s.scalar);
  }
  SparseCholesky cholesky;
  cholesky.analyze(normal, dropped);
  const int failed = cholesky.factorize(normal);
  if (failed >= 0) {
    const auto& offsets = equations.column_offset;
    const auto k = std::upper_bound(offsets.begin(), offsets.end(), failed) - offsets.begin() - 1;
    throw SingularError(
        fmt::format("joining: the maps' information does not determine {}; add a measurement of it "
                    "or leave it out",
                    to_string(all.key(x.variables[at(k)]))));
  }
  const Eigen::VectorXd d = cholesky.solve(equations.right_hand_side());
  retract(all, x, std::span<const double>(d.data(), at(d.size())));
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
      const auto parts = pointers(members);
      for (int s = 0; s < solves; ++s)
        solve_step<D>(all, parts, joined.piece, lowest_pose(all, joined.piece));
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
                             int common, bool complete) {
  constexpr int G = kGauge<D>;
  for (Summary<D>* map : {&first, &second}) {
    const int place = place_of(map->piece.variables, common);
    if (place < 0)
      throw DisconnectedError(
          fmt::format("pose {} is not in both maps", to_string(all.key(common))));
    auto* const pose = reinterpret_cast<Rigid<D>*>(value_of(all, map->piece, place));
    move(all, *map, motion_into(*pose));
    *pose = Rigid<D>::identity();
  }
  std::vector<Piece<D>> pieces{first.piece, second.piece};
  Summary<D> joined;
  joined.piece = unite(all, pieces, {0, 1});
  const Summary<D>* const maps[2] = {&first, &second};
  const int place = place_of(joined.piece.variables, common);
  solve_step<D>(all, maps, joined.piece, place);
  *reinterpret_cast<Rigid<D>*>(value_of(all, joined.piece, place)) = Rigid<D>::identity();

  if (!complete) {
    joined.information = join_equations<D>(all, maps, joined.piece).normal_matrix();
    return joined;
  }
  // (17) in the frame of the common pose, whose rows and columns are not part of it; then completed
  // exactly.
  SymmetricBlockMatrix anchored = join_equations<D>(all, maps, joined.piece).normal_matrix();
  for (int j = 0; j < anchored.size(); ++j) {
    for (std::int64_t s = anchored.begin(j); s < anchored.end(j); ++s) {
      if (j != place && anchored.row(s) != place) continue;
      std::fill_n(anchored.block(s), anchored.dim(anchored.row(s)) * anchored.dim(j), 0.0);
    }
  }
  AnchorRows rows;
  rows.variables = {place};
  rows.P = Eigen::MatrixXd::Identity(G, G);
  rows.C = Eigen::MatrixXd::Identity(G, G);
  joined.information = complete_gauge(gauge_rows(all, joined.piece), rows, anchored);
  return joined;
}

#define MAPJOIN_INSTANTIATE(D)                                                                 \
  template void move<D>(const VariableSet<D>&, Summary<D>&, const Rigid<D>&);                  \
  template std::vector<Summary<D>> join_summaries<D>(const VariableSet<D>&,                    \
                                                     std::vector<Summary<D>>, int, Places&);   \
  template Summary<D> join_as_published<D>(const VariableSet<D>&, Summary<D>, Summary<D>, int, \
                                           bool);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
