#include "mapjoin/solvers/observation_system.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "mapjoin/solvers/gauge_scalars.h"

namespace mapjoin {

namespace {

std::size_t at(std::int64_t k) { return static_cast<std::size_t>(k); }

constexpr std::int64_t kChunk = 1024;  // measurements a task of chi2 takes: fixed, so that sums are

/// Runs body(i) for i = 0 .. count - 1, spread by `loop`.
template <class Body>
void for_each(int count, LoopRunner loop, Body&& body) {
  if (loop.run == nullptr || count < 2) {
    for (int i = 0; i < count; ++i) body(i);
    return;
  }
  using Type = std::remove_reference_t<Body>;
  loop.run(loop.runner, count, &body,
           [](void* object, int i) { (*static_cast<Type*>(object))(i); });
}

/// r^T I r of a batch, summed chunk by chunk whoever computes them.
template <int D>
double chi2_in_chunks(const VariableKind<D>& kind, const RelativeBatch<D>& batch,
                      std::vector<double>& parts, LoopRunner loop) {
  const auto size = static_cast<std::int64_t>(batch.size);
  parts.assign(at((size + kChunk - 1) / kChunk), 0.0);
  for_each(static_cast<int>(parts.size()), loop, [&](int c) {
    const std::int64_t first = c * kChunk;
    RelativeBatch<D> part = batch;
    part.size = at(std::min(kChunk, size - first));
    part.id += first;
    part.slots += 2 * first;
    parts[at(c)] = kind.chi2_relative(part);
  });
  double sum = 0.0;
  for (const double p : parts) sum += p;
  return sum;
}

DenseTarget target_of(const FrontView& view) {
  return {view.panel(),         view.stride(), view.pivot_dim(), view.column(view.pivot_dim()),
          view.update_stride(), view.rows()};
}

}  // namespace

template <int D>
const double* ObservationSystem<D>::value(const Piece<D>& piece, int place) const {
  std::size_t c = 0;
  while (place >= piece.column_start[c + 1]) ++c;
  return piece.data[c].data() + static_cast<std::ptrdiff_t>(place - piece.column_start[c]) *
                                    graph_.variables.column(static_cast<int>(c)).kind->value_size;
}

template <int D>
ObservationSystem<D>::ObservationSystem(const MeasurementGraph<D>& graph, const Piece<D>& piece,
                                        std::span<const std::int32_t> rank, Places& places)
    : graph_(graph), list_(graph, piece, places), cliques_(list_.cliques()) {
  hold_gauge(piece);
  plan(piece, rank);
  sort_by_front(piece);
}

template <int D>
void ObservationSystem<D>::plan(const Piece<D>& piece, std::span<const std::int32_t> rank) {
  const Cliques view{cliques_.start, cliques_.variables};
  std::vector<std::int32_t> order;
  if (rank.empty()) {
    order = order_blocks(list_.dims(), view);
  } else {
    order.resize(piece.variables.size());
    std::iota(order.begin(), order.end(), 0);
    const auto rank_of = [&](std::int32_t i) { return rank[at(piece.variables[at(i)])]; };
    std::sort(order.begin(), order.end(),
              [&](std::int32_t a, std::int32_t b) { return rank_of(a) < rank_of(b); });
  }
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
  SubmapScratch scratch;
  Eigen::MatrixXd H;
  int seen = 0;
  for (std::int64_t k = 0; k < static_cast<std::int64_t>(list_.size()) &&
                           seen < kEnough * static_cast<int>(held_.size());
       ++k) {
    const auto clique = list_.clique(k);
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

template <int D>
void ObservationSystem<D>::sort_by_front(const Piece<D>& piece) {
  std::vector<std::int64_t> first;  // observation number of each column's first measurement
  std::int64_t next = 0;
  int c = 0;
  for (const auto& column : graph_.relative) {
    Relative group;
    group.measurements = &column;
    group.column = graph_.variables.find_column(column.kind->tag);
    relative_.push_back(std::move(group));
    first.push_back(next);
    next += static_cast<std::int64_t>(column.size());
  }
  const int poses = graph_.variables.find_column(Tag("pose"));
  const auto regular = static_cast<std::int64_t>(list_.size());
  const std::size_t fronts = structure_.fronts.size();
  for (std::size_t f = 0; f < fronts; ++f) {
    for (Relative& group : relative_)
      group.front.push_back(static_cast<std::int64_t>(group.id.size()));
    submap_front_.push_back(static_cast<std::int64_t>(submap_cliques_.size()));
    c = 0;
    for (const std::int64_t k : structure_.owned_by(static_cast<std::int32_t>(f))) {
      if (k >= regular || list_.observation(k) >= next) {
        submap_cliques_.push_back(k);
        continue;
      }
      while (c + 1 < static_cast<int>(first.size()) && list_.observation(k) >= first[at(c) + 1])
        ++c;
      Relative& group = relative_[at(c)];
      const auto v = list_.clique(k);
      const auto rows = structure_.clique_rows(k);
      group.id.push_back(static_cast<std::int32_t>(list_.observation(k) - first[at(c)]));
      group.slots.push_back(v[0] - piece.column_start[at(poses)]);
      group.slots.push_back(v[1] - piece.column_start[at(group.column)]);
      group.offsets.push_back(rows[0]);
      group.offsets.push_back(rows[1]);
    }
  }
  for (Relative& group : relative_)
    group.front.push_back(static_cast<std::int64_t>(group.id.size()));
  submap_front_.push_back(static_cast<std::int64_t>(submap_cliques_.size()));
  front_chi2_.resize(fronts);
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

/// The right-hand side alone. The columns of the matrix are folded onto one another in `room`,
/// where nobody looks at them: each begins one further on, so that `rhs` is its last row.
template <int D>
void ObservationSystem<D>::assemble_rhs(std::int32_t front, double* rhs, double* room,
                                        const Piece<D>& piece) {
  const std::int64_t rows = structure_.fronts[at(front)].rows();
  assemble(front, {room, 1, rows, nullptr, 0, rhs - room}, piece);
}

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
    kind.gauge(value(sub, places[v]), 1, block.data());
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
                                         Eigen::VectorXd& increment, LoopRunner loop)
    -> std::optional<Step> {
  places.mark(sub.variables);
  const std::vector<std::int32_t> held = held_rows(root, sub, places);
  Step step;
  bool solved = false;
  if (!held.empty()) {
    find_slots(first, root, sub, places, scratch);
    const auto assembler = [&](std::int32_t front, const FrontView& view) {
      const DenseTarget target = target_of(view);
      const std::size_t f = at(front);
      for (std::size_t r = 0; r < relative_.size(); ++r) {
        const Relative& group = relative_[r];
        if (group.front[f] == group.front[f + 1]) continue;
        RelativeBatch<D> part = batch(group, sub, group.front[f], group.front[f + 1]);
        part.slots = scratch.slots[r].data() + 2 * (group.front[f] - group.front[at(first)]);
        step.chi2 += group.measurements->kind->linearize_relative(part, target);
      }
      if (submap_front_[f] != submap_front_[f + 1])
        step.chi2 += assemble_submaps(front, target, sub, &places);
    };
    scratch.by_position.resize(at(structure_.statistics.scalars));
    solved = scratch.cholesky->factorize_subtree(structure_, first, root, assembler, loop).ok() &&
             scratch.cholesky->close_subtree(first, root, held, scratch.by_position,
                                             step.predicted_decrease);
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

template <int D>
auto ObservationSystem<D>::solve(const Piece<D>& piece, FrontalCholesky& cholesky, WorkerPool& pool,
                                 Eigen::VectorXd& increment) -> Step {
  Step step;
  if (!std::exchange(weighed_, true)) weigh_held(piece);
  const auto assembler = [&](std::int32_t front, const FrontView& view) {
    assemble(front, target_of(view), piece);
  };
  const FactorStatus status = cholesky.factorize(structure_, assembler, pool);
  if (!status.ok()) {
    step.failed = piece.variables[at(status.failed_variable)];
    return step;
  }
  for (const double c : front_chi2_) step.chi2 += c;
  increment.resize(structure_.statistics.scalars);
  cholesky.solve(increment, pool);
  step.predicted_decrease = cholesky.squared_norm_of_y();
  return step;
}

template <int D>
auto ObservationSystem<D>::solve_again(const Piece<D>& piece, FrontalCholesky& cholesky,
                                       WorkerPool& pool, Eigen::VectorXd& increment) -> Step {
  const auto assembler = [&](std::int32_t front, double* rhs, double* room) {
    assemble_rhs(front, rhs, room, piece);
  };
  cholesky.eliminate(assembler, pool);
  Step step;
  for (const double c : front_chi2_) step.chi2 += c;
  increment.resize(structure_.statistics.scalars);
  cholesky.solve(increment, pool);
  step.predicted_decrease = cholesky.squared_norm_of_y();
  return step;
}

template <int D>
double ObservationSystem<D>::chi2(const Piece<D>& piece, WorkerPool& pool) {
  double sum = 0.0;
  std::vector<double> parts;
  for (const Relative& group : relative_) {
    const auto n = static_cast<std::int64_t>(group.id.size());
    const std::int64_t chunks = (n + kChunk - 1) / kChunk;
    parts.assign(at(chunks), 0.0);
    pool.run([&](int thread) {
      for (std::int64_t c = thread; c < chunks; c += pool.threads()) {
        const std::int64_t first = c * kChunk;
        parts[at(c)] = group.measurements->kind->chi2_relative(
            batch(group, piece, first, std::min(n, first + kChunk)));
      }
    });
    for (const double p : parts) sum += p;
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
