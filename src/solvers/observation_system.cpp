#include "mapjoin/solvers/observation_system.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "mapjoin/graph/index.h"
#include "mapjoin/solvers/gauge_scalars.h"
#include "mapjoin/solvers/observation_assembly.h"
#include "mapjoin/solvers/pool_loop.h"

namespace mapjoin {

template <int D>
ObservationSystem<D>::ObservationSystem(const MeasurementGraph<D>& graph, const Piece<D>& piece,
                                        std::span<const std::int32_t> rank, Places& places,
                                        WorkerPool* pool)
    : graph_(graph), list_(graph, piece, places), cliques_(list_.cliques()) {
  hold_gauge(piece);
  plan(piece, rank, pool);
  sort_by_front(piece, pool != nullptr ? loop_on(*pool) : LoopRunner());
}

template <int D>
void ObservationSystem<D>::plan(const Piece<D>& piece, std::span<const std::int32_t> rank,
                                WorkerPool* pool) {
  const Cliques view{cliques_.start, cliques_.variables};
  if (rank.empty()) {
    const BlockGraph graph = block_graph(piece.size(), view);
    structure_ =
        analyze(list_.dims(), view, graph, order_blocks(list_.dims(), graph, {}, pool), pool);
    return;
  }
  std::vector<std::int32_t> order(piece.variables.size());
  std::iota(order.begin(), order.end(), 0);
  const auto rank_of = [&](std::int32_t i) { return rank[at(piece.variables[at(i)])]; };
  std::sort(order.begin(), order.end(),
            [&](std::int32_t a, std::int32_t b) { return rank_of(a) < rank_of(b); });
  structure_ = analyze(list_.dims(), view, order);
}

/// Holds the pose that most observations touch. Where there is no pose, some scalars of the
/// variables that the first local map is anchored at: they fix a frame, and weigh_held chooses when
/// it sees how they lie.
template <int D>
void ObservationSystem<D>::hold_gauge(const Piece<D>& piece) {
  int pose = -1;
  const int column = graph_.variables.find_column(Tag("pose"));
  if (column >= 0 && piece.column_size(at(column)) > 0) {
    std::vector<int> count(list_.dims().size(), 0);
    for (const std::int32_t v : list_.cliques().variables) ++count[at(v)];
    const auto begin = count.begin() + piece.column_start[at(column)];
    const auto end = count.begin() + piece.column_start[at(column) + 1];
    pose = static_cast<int>(std::max_element(begin, end) - count.begin());
  }
  const bool choose = pose < 0 && list_.size() > 0;
  for (const PieceScalar& s :
       choose ? list_.anchor_scalars(0) : gauge_scalars(graph_.variables, piece, pose))
    held_.push_back({s, 0, 0.0});
  for (std::size_t h = 0; h < held_.size(); ++h) {
    const bool same = h > 0 && held_[h].variable == held_[h - 1].variable;
    if (!same) {
      cliques_.variables.push_back(held_[h].variable);
      cliques_.start.push_back(static_cast<std::int64_t>(cliques_.variables.size()));
    }
    held_[h].clique = static_cast<std::int64_t>(cliques_.size()) - 1;
  }
}

/// A held scalar gets a stiffness of the size of its own information: any would do, this one
/// conditions well.
template <int D>
void ObservationSystem<D>::weigh_held(const Piece<D>& piece) {
  constexpr int kEnough = 64;  // observations of a variable to look at
  if (held_.size() > static_cast<std::size_t>(kGauge<D>)) {
    const std::vector<PieceScalar> candidates(held_.begin(), held_.end());
    const auto chosen = most_independent(graph_.variables, piece, candidates);
    std::erase_if(held_, [&](const PieceScalar& s) {
      return !std::binary_search(chosen.begin(), chosen.end(), s);
    });
  }
  std::vector<char> is_held(list_.dims().size(), 0);
  for (const Held& held : held_) is_held[at(held.variable)] = 1;
  SubmapScratch scratch;
  Eigen::MatrixXd H;
  int seen = 0;
  for (std::int64_t k = 0; k < static_cast<std::int64_t>(list_.size()) &&
                           seen < kEnough * static_cast<int>(held_.size());
       ++k) {
    const auto clique = list_.clique(k);
    if (std::ranges::none_of(clique, [&](std::int32_t v) { return is_held[at(v)] != 0; })) continue;
    bool evaluated = false;
    for (Held& held : held_) {
      const auto found = std::find(clique.begin(), clique.end(), held.variable);
      if (found == clique.end()) continue;
      if (!evaluated) list_.evaluate_alone(k, piece, H, scratch);
      evaluated = true;
      int row = held.scalar;
      for (auto v = clique.begin(); v != found; ++v) row += list_.dims()[at(*v)];
      held.weight += H(row, row);
      ++seen;
    }
  }
  for (Held& held : held_) {
    if (!(held.weight > 0.0) || !std::isfinite(held.weight)) held.weight = 1.0;
  }
}

/// Number of the type of measurement that observation k of the list is, or -1: it is a submap, or
/// what holds the gauge.
template <int D>
int ObservationSystem<D>::type_of(std::int64_t k) const {
  if (k >= static_cast<std::int64_t>(list_.size())) return -1;
  const std::int64_t observation = list_.observation(k);
  for (std::size_t g = 0; g < relative_.size(); ++g) {
    if (observation <
        relative_[g].first + static_cast<std::int64_t>(relative_[g].measurements->size()))
      return static_cast<int>(g);
  }
  return -1;
}

/// body(f) for every front, f ascending within a chunk.
template <int D>
template <class Body>
void ObservationSystem<D>::for_fronts(LoopRunner loop, const Body& body) const {
  constexpr int kChunk = 512;
  run_chunks(static_cast<int>(structure_.fronts.size()), kChunk, loop, [&](int begin, int end) {
    for (int f = begin; f < end; ++f) body(f);
  });
}

template <int D>
void ObservationSystem<D>::sort_by_front(const Piece<D>& piece, LoopRunner loop) {
  std::int64_t first = 0;
  for (const auto& column : graph_.relative) {
    Relative group;
    group.measurements = &column;
    group.column = graph_.variables.find_column(column.kind->tag);
    group.first = first;
    first += static_cast<std::int64_t>(column.size());
    relative_.push_back(std::move(group));
  }
  count_by_front(loop);
  const int poses = graph_.variables.find_column(Tag("pose"));
  for_fronts(loop, [&](int f) { take_owned(f, piece, poses); });
  has_submaps_ = std::ranges::any_of(
      submap_cliques_, [&](auto k) { return k < static_cast<std::int64_t>(list_.size()); });
  front_chi2_.resize(structure_.fronts.size());
}

/// Where each front's entries begin, and room for all of them.
template <int D>
void ObservationSystem<D>::count_by_front(LoopRunner loop) {
  const std::size_t fronts = structure_.fronts.size();
  for (Relative& group : relative_) group.front.assign(fronts + 1, 0);
  submap_front_.assign(fronts + 1, 0);
  for_fronts(loop, [&](int f) {
    for (const std::int64_t k : structure_.owned_by(f)) {
      const int g = type_of(k);
      ++(g >= 0 ? relative_[at(g)].front : submap_front_)[at(f + 1)];
    }
  });
  for (Relative& group : relative_) {
    std::inclusive_scan(group.front.begin(), group.front.end(), group.front.begin());
    group.id.resize(at(group.front.back()));
    group.slots.resize(2 * group.id.size());
    group.offsets.resize(2 * group.id.size());
  }
  std::inclusive_scan(submap_front_.begin(), submap_front_.end(), submap_front_.begin());
  submap_cliques_.resize(at(submap_front_.back()));
}

/// Enters what front f owns; `poses` is their column. Observations of a front are ascending, so
/// types come in order.
template <int D>
void ObservationSystem<D>::take_owned(std::int32_t f, const Piece<D>& piece, int poses) {
  int type = -1;
  std::size_t next = 0;
  std::int64_t submap = submap_front_[at(f)];
  for (const std::int64_t k : structure_.owned_by(f)) {
    const int g = type_of(k);
    if (g < 0) {
      submap_cliques_[at(submap++)] = k;
      continue;
    }
    Relative& group = relative_[at(g)];
    if (g != std::exchange(type, g)) next = at(group.front[at(f)]);
    const auto v = list_.clique(k);
    const auto rows = structure_.clique_rows(k);
    group.id[next] = static_cast<std::int32_t>(list_.observation(k) - group.first);
    group.slots[2 * next] = v[0] - piece.column_start[at(poses)];
    group.slots[2 * next + 1] = v[1] - piece.column_start[at(group.column)];
    group.offsets[2 * next] = rows[0];
    group.offsets[2 * next + 1] = rows[1];
    ++next;
  }
}

template <int D>
RelativeBatch<D> ObservationSystem<D>::batch(const Relative& group, const Piece<D>& piece,
                                             std::int64_t first, std::int64_t last) const {
  const auto poses = at(graph_.variables.find_column(Tag("pose")));
  RelativeBatch<D> out;
  out.size = at(last - first);
  out.id = group.id.data() + first;
  out.z = group.measurements->z.data();
  out.info = group.measurements->info.data();
  out.poses = piece.data[poses].data();
  out.values = piece.data[at(group.column)].data();
  out.slots = group.slots.data() + 2 * first;
  out.offsets = group.offsets.data() + 2 * first;
  out.following = group.id.size() - at(last);
  return out;
}

/// The submaps that a front owns. With `places`, the piece is not this system's but one whose
/// variables stand there.
template <int D>
double ObservationSystem<D>::assemble_submaps(std::int32_t front, const DenseTarget& target,
                                              const Piece<D>& piece, const Places* places) const {
  SubmapScratch scratch;
  double chi2 = 0.0;
  for (std::int64_t s = submap_front_[at(front)]; s < submap_front_[at(front) + 1]; ++s) {
    const std::int64_t k = submap_cliques_[at(s)];
    const auto rows = structure_.clique_rows(k);
    if (k < static_cast<std::int64_t>(list_.size())) {
      chi2 += places == nullptr ? list_.evaluate(k, piece, rows, &target, scratch)
                                : list_.evaluate_at(k, piece, *places, rows, &target, scratch);
      continue;
    }
    if (places != nullptr) continue;  // a part of the system has its own gauge
    for (const Held& held : held_) {
      if (held.clique != k) continue;
      const std::int64_t row = rows[0] + held.scalar;
      target.column(row)[row] += held.weight;
    }
  }
  return chi2;
}

template <int D>
void ObservationSystem<D>::assemble(std::int32_t front, const DenseTarget& target,
                                    const Piece<D>& piece) {
  const std::size_t f = at(front);
  double chi2 = 0.0;
  for (const Relative& group : relative_) {
    if (group.front[f] == group.front[f + 1]) continue;
    chi2 += group.measurements->kind->linearize_relative(
        batch(group, piece, group.front[f], group.front[f + 1]), target);
  }
  if (submap_front_[f] != submap_front_[f + 1])
    chi2 += assemble_submaps(front, target, piece, nullptr);
  front_chi2_[f] = chi2;
}

/// The right-hand side alone. Of submaps, the columns of the matrix are folded onto one another in
/// `room`, where nobody looks at them: each begins one further on, so that `rhs` is its last row.
template <int D>
void ObservationSystem<D>::assemble_rhs(std::int32_t front, double* rhs, double* room,
                                        const Piece<D>& piece) {
  const std::size_t f = at(front);
  double chi2 = 0.0;
  for (const Relative& group : relative_) {
    if (group.front[f] == group.front[f + 1]) continue;
    chi2 += group.measurements->kind->gradient_relative(
        batch(group, piece, group.front[f], group.front[f + 1]), rhs);
  }
  if (submap_front_[f] != submap_front_[f + 1]) {
    const std::int64_t rows = structure_.fronts[f].rows();
    chi2 += assemble_submaps(front, {room, 1, rows, nullptr, 0, rhs - room}, piece, nullptr);
  }
  front_chi2_[f] = chi2;
}

template <int D>
void ObservationSystem<D>::assemble_correction(std::int32_t front, double* rhs,
                                               const std::vector<std::vector<double>>& then,
                                               const Piece<D>& piece) {
  const std::size_t f = at(front);
  const std::size_t poses = at(graph_.variables.find_column(Tag("pose")));
  double chi2 = 0.0;
  for (const Relative& group : relative_) {
    if (group.front[f] == group.front[f + 1]) continue;
    RelativeBatch<D> part = batch(group, piece, group.front[f], group.front[f + 1]);
    part.poses_then = then[poses].data();
    part.values_then = then[at(group.column)].data();
    chi2 += group.measurements->kind->correction_relative(part, rhs);
  }
  front_chi2_[f] = chi2;
}

template <int D>
auto ObservationSystem<D>::solve(const Piece<D>& piece, FrontalCholesky& cholesky, WorkerPool& pool,
                                 Eigen::VectorXd& increment) -> Step {
  if (!std::exchange(weighed_, true)) weigh_held(piece);
  const auto assembler = [&](std::int32_t front, const FrontView& view) {
    assemble(front, target_of(view), piece);
  };
  const FactorStatus status = cholesky.factorize(structure_, assembler, pool);
  if (!status.ok()) return {.failed = piece.variables[at(status.failed_variable)]};
  return substitute_back(cholesky, pool, increment);
}

/// What follows elimination, of a new matrix or an old one.
template <int D>
auto ObservationSystem<D>::substitute_back(const FrontalCholesky& cholesky, WorkerPool& pool,
                                           Eigen::VectorXd& increment) const -> Step {
  Step step;
  for (const double c : front_chi2_) step.chi2 += c;
  step.predicted_decrease = cholesky.squared_norm_of_y();
  increment.resize(structure_.statistics.scalars);
  cholesky.solve(increment, pool);
  return step;
}

template <int D>
auto ObservationSystem<D>::solve_again(const Piece<D>& piece, FrontalCholesky& cholesky,
                                       WorkerPool& pool, double most, Eigen::VectorXd& increment)
    -> std::optional<Step> {
  const auto assembler = [&](std::int32_t front, double* rhs, double* room) {
    assemble_rhs(front, rhs, room, piece);
  };
  if (!cholesky.eliminate(assembler, pool, most)) return std::nullopt;
  return substitute_back(cholesky, pool, increment);
}

template <int D>
auto ObservationSystem<D>::correct(const std::vector<std::vector<double>>& then,
                                   const Piece<D>& piece, FrontalCholesky& cholesky,
                                   WorkerPool& pool, double most, Eigen::VectorXd& increment)
    -> std::optional<Step> {
  constexpr int kChunk = 2048;  // variables
  if (has_submaps_) return std::nullopt;
  const auto assembler = [&](std::int32_t front, double* rhs, double* /*room*/) {
    assemble_correction(front, rhs, then, piece);
  };
  if (!cholesky.eliminate(assembler, pool, most)) return std::nullopt;
  const Step step = substitute_back(cholesky, pool, increment);
  const std::span<double> d(increment.data(), at(increment.size()));
  run_chunks(piece.size(), kChunk, loop_on(pool), [&](int first, int last) {
    transport(graph_.variables, then, piece, d, first, last);
  });
  return step;
}

template <int D>
double ObservationSystem<D>::chi2(const Piece<D>& piece, WorkerPool& pool) {
  double sum = 0.0;
  std::vector<double> parts;
  for (const Relative& group : relative_) {
    const auto size = static_cast<std::int64_t>(group.id.size());
    sum += chi2_in_chunks<D>(*group.measurements->kind, batch(group, piece, 0, size), parts,
                             loop_on(pool));
  }
  SubmapScratch scratch;
  for (const std::int64_t k : submap_cliques_) {
    if (k < static_cast<std::int64_t>(list_.size()))
      sum += list_.evaluate(k, piece, {}, nullptr, scratch);
  }
  return sum;
}

template class ObservationSystem<2>;
template class ObservationSystem<3>;

}  // namespace mapjoin
