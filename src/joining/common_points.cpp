#include "mapjoin/joining/common_points.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "mapjoin/graph/index.h"
#include "mapjoin/joining/require_determined.h"
#include "mapjoin/solvers/gauge_scalars.h"
#include "mapjoin/solvers/sparse_cholesky.h"

namespace mapjoin {

namespace {

constexpr int kMostCandidates = 12;

/// Numbers of the points that all maps have, ascending.
template <int D>
std::vector<int> shared_points(const VariableSet<D>& all, std::span<const Summary<D>* const> maps) {
  const int c = all.find_column(Tag("point"));
  if (c < 0 || maps.empty()) return {};
  const auto points_of = [&](const Piece<D>& piece) {
    return std::vector<int>(piece.variables.begin() + piece.column_start[at(c)],
                            piece.variables.begin() + piece.column_start[at(c) + 1]);
  };
  std::vector<int> out = points_of(maps[0]->piece);
  for (const Summary<D>* const map : maps.subspan(1)) {
    const std::vector<int> theirs = points_of(map->piece);
    std::vector<int> both;
    std::set_intersection(out.begin(), out.end(), theirs.begin(), theirs.end(),
                          std::back_inserter(both));
    out = std::move(both);
  }
  return out;
}

/// Where points stand among a piece's variables.
template <int D>
std::vector<int> places_of(const Piece<D>& piece, std::span<const int> points) {
  std::vector<int> out;
  for (const int v : points) {
    const auto found = std::lower_bound(piece.variables.begin(), piece.variables.end(), v);
    out.push_back(static_cast<int>(found - piece.variables.begin()));
  }
  return out;
}

template <int D>
std::vector<Vec<D>> positions_of(const VariableSet<D>& all, const Piece<D>& piece,
                                 std::span<const int> points) {
  const auto c = at(all.find_column(Tag("point")));
  std::vector<Vec<D>> out;
  for (const int place : places_of(piece, points))
    out.push_back(
        reinterpret_cast<const Vec<D>*>(piece.data[c].data())[place - piece.column_start[c]]);
  return out;
}

/// Joint covariance of points in some frame: which one does not matter to lengths.
template <int D>
Eigen::MatrixXd covariance_of(const VariableSet<D>& all, const Summary<D>& map,
                              std::span<const int> points) {
  const std::vector<int> offsets = offsets_of(all, map.piece);
  std::vector<int> held;
  for (const PieceScalar& s : gauge_scalars(all, map.piece, lowest_pose(all, map.piece)))
    held.push_back(offsets[at(s.variable)] + s.scalar);
  SparseCholesky cholesky;
  cholesky.analyze(map.information, held);
  require_determined(cholesky.factorize(map.information), offsets, "choosing a frame: the map's",
                     [&](int k) { return all.key(map.piece.variables[at(k)]); });
  std::vector<int> rows;
  for (const int place : places_of(map.piece, points)) {
    for (int s = 0; s < D; ++s) rows.push_back(offsets[at(place)] + s);
  }
  const auto n = static_cast<Eigen::Index>(rows.size());
  Eigen::MatrixXd unit = Eigen::MatrixXd::Zero(offsets.back(), n);
  for (Eigen::Index k = 0; k < n; ++k) unit(rows[at(k)], k) = 1.0;
  for (const int s : held) unit.row(s).setZero();
  return cholesky.solve(unit)(rows, Eigen::all);
}

}  // namespace

template <int D>
std::optional<ChosenPoints<D>> common_points(const VariableSet<D>& all,
                                             std::span<const Summary<D>* const> maps) {
  const std::vector<int> shared = shared_points(all, maps);
  if (shared.size() < at(D)) return std::nullopt;
  const std::vector<Vec<D>> positions = positions_of(all, maps[0]->piece, shared);
  std::vector<int> points;
  std::vector<Key> keys;
  for (const int k : spread_points<D>(positions, kMostCandidates)) {
    points.push_back(shared[at(k)]);
    keys.push_back(all.key(points.back()));
  }
  std::vector<CandidatePoints<D>> candidates;
  for (const Summary<D>* const map : maps)
    candidates.push_back({positions_of(all, map->piece, points), covariance_of(all, *map, points)});
  return best_points<D>(keys, candidates);
}

template <int D>
std::optional<ChosenPoints<D>> common_points(std::span<const Map<D>* const> maps) {
  std::vector<const VariableSet<D>*> sets;
  for (const Map<D>* const map : maps) sets.push_back(&map->variables());
  const VariableSet<D> all = unite<D>(sets);
  std::vector<Summary<D>> summaries;
  for (const Map<D>* const map : maps)
    summaries.push_back({to_piece(all, map->values), map->information});
  std::vector<const Summary<D>*> pointers;
  for (const Summary<D>& summary : summaries) pointers.push_back(&summary);
  return common_points<D>(all, pointers);
}

#define MAPJOIN_INSTANTIATE(D)                                                                  \
  template std::optional<ChosenPoints<D>> common_points<D>(const VariableSet<D>&,               \
                                                           std::span<const Summary<D>* const>); \
  template std::optional<ChosenPoints<D>> common_points<D>(std::span<const Map<D>* const>);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
