#include "mapjoin/joining/join.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <string>

#include "mapjoin/frames/change_frame.h"
#include "mapjoin/frames/points_anchor.h"
#include "mapjoin/graph/index.h"
#include "mapjoin/joining/place.h"
#include "mapjoin/joining/require_determined.h"
#include "mapjoin/joining/summary_join.h"
#include "mapjoin/joining/summary_tree.h"
#include "mapjoin/solvers/blas_threads.h"
#include "mapjoin/solvers/gauge_scalars.h"
#include "mapjoin/solvers/sparse_cholesky.h"

namespace mapjoin {

namespace {

template <int D>
VariableSet<D> united(const std::vector<Map<D>>& maps) {
  std::vector<const VariableSet<D>*> sets;
  for (const Map<D>& map : maps) sets.push_back(&map.variables());
  return unite<D>(sets);
}

/// What the fit of the stranger onto the other maps cannot use: types of common variables that
/// offer nothing to it, for the message.
template <int D>
std::string not_fitted(const std::set<Tag>& shared, const VariableSet<D>& variables) {
  std::string out;
  for (const auto& column : variables.columns()) {
    const VariableKind<D>& kind = *column.kind;
    if (shared.count(kind.tag) == 0 || kind.action == FrameAction::kInvariant) continue;
    if (kind.positions != nullptr || kind.rotations != nullptr || kind.directions != nullptr)
      continue;
    out += fmt::format(
        "; variables of type {0} take no part as {0} offers no position, rotation, direction or "
        "offset (graph/variable.h)",
        kind.tag.text());
  }
  return out;
}

/// What the maps that do not fit share with the rest, for the message.
template <int D>
[[noreturn]] void throw_disconnected(const std::vector<Map<D>>& maps, std::size_t stranger) {
  std::string shared;
  std::set<Tag> types;
  int count = 0;
  for (std::size_t m = 0; m < maps.size(); ++m) {
    if (m == stranger) continue;
    const std::vector<int> numbers = numbers_in(maps[stranger].variables(), maps[m].variables());
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      if (numbers[i] < 0) continue;
      const Key key = maps[stranger].variables().key(static_cast<int>(i));
      types.insert(key.type);
      if (++count <= 5) shared += " " + to_string(key);
    }
  }
  throw DisconnectedError(fmt::format(
      "map {} shares {} with the other maps{}{}; joining needs one common pose, or {}{}",
      stranger + 1,
      count == 0 ? "nothing" : fmt::format("only {} variable{}", count, count == 1 ? "" : "s"),
      count == 0 ? "" : ":", shared,
      D == 2 ? "two common points, or lines that cross"
             : "three common points that are not on one line, or planes that meet in a point",
      not_fitted(types, maps[stranger].variables())));
}

template <int D>
Map<D> as_map(const VariableSet<D>& all, Summary<D> summary, Anchor<D> anchor) {
  Map<D> out;
  out.values = to_values(all, summary.piece);
  out.information = std::move(summary.information);
  out.anchor = anchor;
  out.solved_in = std::move(anchor);
  return out;
}

/// The frame of a join: the first map's, where that can be had by dropping columns of A; else the
/// lowest pose's, else that of points.
template <int D>
Anchor<D> frame_of_join(const Anchor<D>& first, const Values<D>& x0) {
  if (first.kind != nullptr) {
    Values<D> there = x0;
    there.transform(motion_into(first, x0));
    if (!anchor_rows(first, there).pinned.empty()) return first;
  }
  const int poses = x0.variables().find_column(Tag("pose"));
  if (poses >= 0) return pose_anchor<D>(x0.variables().column(poses).keys[0]);
  return farthest_points(x0).value_or(Anchor<D>());
}

/// The columns of A that the frame drops: scalars of all variables, which the unknowns are
/// increments of. x0 is written in the frame, or in any that a pose is dropped in whole.
template <int D>
std::vector<int> dropped_columns(const Anchor<D>& anchor, const Values<D>& x0,
                                 const Piece<D>& start) {
  if (anchor.kind != nullptr) return anchor_rows(anchor, x0).pinned;
  std::vector<int> out;
  const std::vector<int> offsets = x0.variables().offsets();
  for (const PieceScalar& s : gauge_scalars(x0.variables(), start, -1))
    out.push_back(offsets[at(s.variable)] + s.scalar);
  return out;
}

}  // namespace

template <int D>
Merge<D> merge(std::vector<Map<D>> maps) {
  if (maps.size() < 2) throw InputError("a merge needs two maps at least");
  Merge<D> out;
  out.variables = united(maps);
  std::vector<Piece<D>> pieces;
  for (Map<D>& map : maps) {
    pieces.push_back(to_piece(out.variables, map.values));
    out.placed.push_back({pieces.back(), std::move(map.information)});
  }
  Places places(out.variables.size());
  const auto groups = place_groups(out.variables, pieces, places);
  if (groups.size() > 1) throw_disconnected(maps, at(groups[1].members[0]));

  const PlacedGroup<D>& group = groups[0];
  Rigid<D> to_first;  // everything in the frame of the first map given
  for (std::size_t m = 0; m < group.members.size(); ++m) {
    if (group.members[m] == 0) to_first = group.motions[m].inverse();
  }
  for (std::size_t m = 0; m < group.members.size(); ++m) {
    move(out.variables, out.placed[at(group.members[m])], to_first * group.motions[m]);
  }
  Piece<D> start = unite(out.variables, pieces, group.members);
  move(out.variables, start, to_first);

  out.x0 = to_values(out.variables, start);
  out.anchor = frame_of_join(maps[0].anchor, out.x0);
  if (out.anchor.kind != nullptr && !is_pose_anchor(out.anchor)) {
    const Rigid<D> into = motion_into(out.anchor, out.x0);
    for (Summary<D>& map : out.placed) move(out.variables, map, into);
    move(out.variables, start, into);
    out.x0.transform(into);
  }
  std::vector<const Summary<D>*> parts;
  for (const Summary<D>& map : out.placed) parts.push_back(&map);
  out.equations = join_equations<D>(out.variables, parts, start);
  out.dropped = dropped_columns(out.anchor, out.x0, start);
  return out;
}

template <int D>
Map<D> solve(const Merge<D>& merge) {
  const SingleThreadedBlas blas;
  const SymmetricBlockMatrix normal = merge.equations.normal_matrix();
  SparseCholesky cholesky;
  cholesky.analyze(normal, merge.dropped);
  require_determined(cholesky.factorize(normal), merge.equations.column_offset,
                     "joining: the maps'", [&](int k) { return merge.variables.key(k); });
  const Eigen::VectorXd d = cholesky.solve(merge.equations.right_hand_side());
  Piece<D> x = to_piece(merge.variables, merge.x0);
  retract(merge.variables, x, std::span<const double>(d.data(), at(d.size())));
  std::vector<const Summary<D>*> parts;
  for (const Summary<D>& map : merge.placed) parts.push_back(&map);
  SymmetricBlockMatrix information = join_equations<D>(merge.variables, parts, x).normal_matrix();
  Map<D> joined =
      as_map(merge.variables, Summary<D>{std::move(x), std::move(information)}, merge.anchor);
  return merge.anchor.kind == nullptr ? joined : change_frame(std::move(joined), merge.anchor);
}

template <int D>
Map<D> join(const Map<D>& a, const Map<D>& b) {
  return solve(merge<D>({a, b}));
}

template <int D>
Map<D> join_as_published(const Map<D>& a, const Map<D>& b, const Anchor<D>& common) {
  const SingleThreadedBlas blas;
  const std::vector<Map<D>> maps{a, b};
  const VariableSet<D> all = united(maps);
  anchor_variables(common, all);  // are there such variables?
  return as_map(all,
                join_as_published(all, Summary<D>{to_piece(all, a.values), a.information},
                                  Summary<D>{to_piece(all, b.values), b.information}, common),
                common);
}

template <int D>
Map<D> join_as_published(const Map<D>& a, const Map<D>& b, const Key& common_pose) {
  return join_as_published(a, b, pose_anchor<D>(common_pose));
}

template <int D>
Map<D> to_map(const LocalMap<D>& local_map) {
  if (local_map.keys.empty()) throw InputError("the local map is empty: there is nothing in it");
  MeasurementGraphBuilder<D> builder;
  builder.add(local_map);
  JoinOptions options;
  options.mode = Mode::kSummary;
  JoinResult<D> result = join_by_summaries<D>(std::move(builder).build(), {}, options);
  if (result.maps.size() != 1)
    throw DisconnectedError(
        "the local map falls apart: its information leaves parts of it unconnected");
  Map<D> map = change_frame(std::move(result.maps[0]), local_map.anchor);
  map.solved_in = map.anchor;  // where its information was given
  return map;
}

#define MAPJOIN_INSTANTIATE(D)                                                          \
  template Merge<D> merge<D>(std::vector<Map<D>>);                                      \
  template Map<D> solve<D>(const Merge<D>&);                                            \
  template Map<D> join<D>(const Map<D>&, const Map<D>&);                                \
  template Map<D> join_as_published<D>(const Map<D>&, const Map<D>&, const Anchor<D>&); \
  template Map<D> join_as_published<D>(const Map<D>&, const Map<D>&, const Key&);       \
  template Map<D> to_map<D>(const LocalMap<D>&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
