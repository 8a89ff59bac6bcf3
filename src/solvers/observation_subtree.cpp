// The part of an ObservationSystem that a subtree of fronts eliminates.

#include <optional>

#include "mapjoin/graph/index.h"
#include "mapjoin/solvers/gauge_scalars.h"
#include "mapjoin/solvers/observation_assembly.h"
#include "mapjoin/solvers/observation_system.h"

namespace mapjoin {

/// Rows of the root's update matrix that hold the gauge of a subtree: a pose it shares with the
/// rest, or the scalars of features that turn most freely. Empty where what it shares does not fix
/// a frame.
template <int D>
std::vector<std::int32_t> ObservationSystem<D>::held_rows(std::int32_t root, const Piece<D>& sub,
                                                          const Places& places) const {
  constexpr int G = kGauge<D>;
  std::vector<std::int32_t> out;
  const int poses = graph_.variables.find_column(Tag("pose"));
  std::vector<std::int32_t> rows;
  std::int32_t row = 0;
  for (const std::int32_t position : structure_.updates_of(root)) {
    const std::int32_t v = structure_.order[at(position)];
    if (graph_.variables.column_of(v) == poses) {
      for (int k = 0; k < G; ++k) out.push_back(row + k);
      return out;
    }
    rows.push_back(row);
    row += structure_.dims[at(v)];
  }
  Eigen::MatrixXd g(row, G), block;
  std::size_t k = 0;
  for (const std::int32_t position : structure_.updates_of(root)) {
    const std::int32_t v = structure_.order[at(position)];
    const VariableKind<D>& kind = graph_.variables.kind(v);
    block.resize(kind.dim, G);
    kind.gauge(list_.value(sub, places[v]), 1, block.data());
    g.middleRows(rows[k++], kind.dim) = block;
  }
  if (row < G) return out;
  for (const int r : independent_rows(std::move(g), G, 1e-3)) out.push_back(r);
  return out;
}

/// Where each measurement of a subtree finds its values in the sub-piece.
template <int D>
void ObservationSystem<D>::find_slots(std::int32_t first, std::int32_t root, const Piece<D>& sub,
                                      const Places& places, SubtreeScratch& scratch) const {
  scratch.slots.resize(relative_.size());
  if (relative_.empty()) return;
  const int poses = graph_.variables.find_column(Tag("pose"));
  const int first_pose = graph_.variables.column(poses).first;
  const int pose_start = sub.column_start[at(poses)];
  for (std::size_t r = 0; r < relative_.size(); ++r) {
    const Relative& group = relative_[r];
    const std::int64_t begin = group.front[at(first)];
    const std::int64_t end = group.front[at(root) + 1];
    auto& slots = scratch.slots[r];
    slots.resize(at(2 * (end - begin)));
    const int first_value = graph_.variables.column(group.column).first;
    const int value_start = sub.column_start[at(group.column)];
    for (std::int64_t e = begin; e < end; ++e) {
      slots[at(2 * (e - begin))] = places[first_pose + group.slots[at(2 * e)]] - pose_start;
      slots[at(2 * (e - begin) + 1)] =
          places[first_value + group.slots[at(2 * e + 1)]] - value_start;
    }
  }
}

template <int D>
auto ObservationSystem<D>::solve_subtree(std::int32_t first, std::int32_t root, const Piece<D>& sub,
                                         Places& places, SubtreeScratch& scratch,
                                         Eigen::VectorXd& increment, WorkerPool& pool,
                                         LoopRunner loop) -> std::optional<Step> {
  places.mark(sub.variables);
  const std::vector<std::int32_t> held = held_rows(root, sub, places);
  Step step;
  bool solved = false;
  if (!held.empty()) {
    find_slots(first, root, sub, places, scratch);
    const auto assembler = [&](std::int32_t front, const FrontView& view) {
      const DenseTarget target = target_of(view);
      const std::size_t f = at(front);
      double chi2 = 0.0;
      for (std::size_t r = 0; r < relative_.size(); ++r) {
        const Relative& group = relative_[r];
        if (group.front[f] == group.front[f + 1]) continue;
        RelativeBatch<D> part = batch(group, sub, group.front[f], group.front[f + 1]);
        part.slots = scratch.slots[r].data() + 2 * (group.front[f] - group.front[at(first)]);
        part.following = at(group.front[at(root) + 1] - group.front[f + 1]);
        chi2 += group.measurements->kind->linearize_relative(part, target);
      }
      if (submap_front_[f] != submap_front_[f + 1])
        chi2 += assemble_submaps(front, target, sub, &places);
      front_chi2_[f] = chi2;
    };
    scratch.by_position.resize(at(structure_.statistics.scalars));
    solved =
        scratch.cholesky->factorize_subtree(structure_, first, root, assembler, pool, loop).ok() &&
        scratch.cholesky->close_subtree(first, root, held, scratch.by_position,
                                        step.predicted_decrease, pool);
    for (std::int32_t f = first; f <= root; ++f) step.chi2 += front_chi2_[at(f)];
  }
  if (solved) {
    std::int64_t total = 0;
    for (const int v : sub.variables) total += structure_.dims[at(v)];
    increment.resize(total);
    double* to = increment.data();
    for (const int v : sub.variables) {
      const std::int32_t position = structure_.position[at(v)];
      for (std::int32_t i = structure_.scalar_at[at(position)];
           i < structure_.scalar_at[at(position) + 1]; ++i) {
        *to++ = scratch.by_position[at(i)];
      }
    }
    solved = increment.allFinite();
  }
  places.clear(sub.variables);
  return solved ? std::optional<Step>(step) : std::nullopt;
}

template <int D>
double ObservationSystem<D>::subtree_chi2(std::int32_t first, std::int32_t root,
                                          const Piece<D>& sub, Places& places,
                                          SubtreeScratch& scratch, LoopRunner loop) const {
  places.mark(sub.variables);
  find_slots(first, root, sub, places, scratch);
  double sum = 0.0;
  for (std::size_t r = 0; r < relative_.size(); ++r) {
    const Relative& group = relative_[r];
    RelativeBatch<D> part = batch(group, sub, group.front[at(first)], group.front[at(root) + 1]);
    part.slots = scratch.slots[r].data();
    part.following = 0;
    sum += chi2_in_chunks<D>(*group.measurements->kind, part, scratch.parts, loop);
  }
  SubmapScratch submap;
  for (std::int64_t s = submap_front_[at(first)]; s < submap_front_[at(root) + 1]; ++s) {
    const std::int64_t k = submap_cliques_[at(s)];
    if (k < static_cast<std::int64_t>(list_.size()))
      sum += list_.evaluate_at(k, sub, places, {}, nullptr, submap);
  }
  places.clear(sub.variables);
  return sum;
}

template auto ObservationSystem<2>::solve_subtree(std::int32_t, std::int32_t, const Piece<2>&,
                                                  Places&, SubtreeScratch&, Eigen::VectorXd&,
                                                  WorkerPool&, LoopRunner) -> std::optional<Step>;
template double ObservationSystem<2>::subtree_chi2(std::int32_t, std::int32_t, const Piece<2>&,
                                                   Places&, SubtreeScratch&, LoopRunner) const;
template auto ObservationSystem<3>::solve_subtree(std::int32_t, std::int32_t, const Piece<3>&,
                                                  Places&, SubtreeScratch&, Eigen::VectorXd&,
                                                  WorkerPool&, LoopRunner) -> std::optional<Step>;
template double ObservationSystem<3>::subtree_chi2(std::int32_t, std::int32_t, const Piece<3>&,
                                                   Places&, SubtreeScratch&, LoopRunner) const;

}  // namespace mapjoin
