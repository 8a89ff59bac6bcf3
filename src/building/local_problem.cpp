#include "mapjoin/building/local_problem.h"

#include <algorithm>
#include <numeric>

#include "mapjoin/graph/disjoint_sets.h"

namespace mapjoin {

namespace {

int number_of(const std::vector<int>& sorted, int global) {
  return static_cast<int>(std::lower_bound(sorted.begin(), sorted.end(), global) - sorted.begin());
}

template <int D>
bool places_pose(const LocalMeasurement<D>& m) {
  return m.model->target->tag == Tag("pose") && m.model->seen != nullptr;
}

/// A problem over the variables that the measurements name; `from` and `to` come as numbers in
/// `all`.
template <int D>
LocalProblem<D> compact(const VariableSet<D>& all, std::vector<LocalMeasurement<D>> measurements,
                        int first_pose) {
  std::vector<int> used{first_pose};
  for (const auto& m : measurements) {
    used.push_back(m.from);
    used.push_back(m.to);
  }
  std::sort(used.begin(), used.end());
  used.erase(std::unique(used.begin(), used.end()), used.end());
  for (auto& m : measurements) {
    m.from = number_of(used, m.from);
    m.to = number_of(used, m.to);
  }
  VariableSet<D> variables = subset(all, std::span<const int>(used));
  return {std::move(variables), std::move(used), std::move(measurements)};
}

}  // namespace

template <int D>
std::vector<LocalProblem<D>> local_problems(const RawLog<D>& log,
                                            std::span<const std::int64_t> measurements) {
  std::vector<LocalMeasurement<D>> all;
  std::vector<int> poses;
  for (const std::int64_t number : measurements) {
    const auto [column, row] = log.find(number);
    const RawMeasurements<D>& c = log.columns[column];
    const auto measured = static_cast<std::size_t>(c.model->measured);
    const auto dim = static_cast<std::size_t>(c.model->dim);
    all.push_back(
        {c.model, c.from[row], c.to[row], &c.z[row * measured], &c.info[row * dim * dim], number});
    poses.push_back(c.from[row]);
    if (c.model->target->tag == Tag("pose")) poses.push_back(c.to[row]);
  }
  std::sort(poses.begin(), poses.end());
  poses.erase(std::unique(poses.begin(), poses.end()), poses.end());

  // Pieces: poses that relative poses hold together.
  DisjointSets held(static_cast<int>(poses.size()));
  for (const auto& m : all) {
    if (places_pose(m)) held.unite(number_of(poses, m.from), number_of(poses, m.to));
  }
  std::vector<int> piece_of(poses.size(), -1);
  std::vector<int> first_pose;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const auto root = static_cast<std::size_t>(held.root(static_cast<int>(i)));
    if (root == i) {
      piece_of[i] = static_cast<int>(first_pose.size());
      first_pose.push_back(poses[i]);
    } else {
      piece_of[i] = piece_of[root];
    }
  }
  std::vector<std::vector<LocalMeasurement<D>>> pieces(first_pose.size());
  for (const auto& m : all) {
    const int piece = piece_of[static_cast<std::size_t>(number_of(poses, m.from))];
    pieces[static_cast<std::size_t>(piece)].push_back(m);
  }
  std::vector<LocalProblem<D>> out;
  for (std::size_t p = 0; p < pieces.size(); ++p) {
    if (!pieces[p].empty())
      out.push_back(compact(log.variables, std::move(pieces[p]), first_pose[p]));
  }
  return out;
}

template <int D>
LocalProblem<D> without(const LocalProblem<D>& problem,
                        std::span<const std::int64_t> measurements) {
  std::vector<LocalMeasurement<D>> kept;
  for (const auto& m : problem.measurements) {
    if (!std::binary_search(measurements.begin(), measurements.end(), m.number)) kept.push_back(m);
  }
  LocalProblem<D> out = compact(problem.variables, std::move(kept), problem.first_pose());
  for (int& number : out.numbers) number = problem.numbers[static_cast<std::size_t>(number)];
  return out;
}

namespace {

/// Poses and what links them.
struct PoseLinks {
  std::vector<std::int64_t> start;  ///< per variable, into `measurement`
  std::vector<int> measurement;     ///< places in the problem
};

template <int D>
PoseLinks pose_links(const LocalProblem<D>& problem) {
  PoseLinks out;
  out.start.assign(static_cast<std::size_t>(problem.variables.size()) + 1, 0);
  for (const auto& m : problem.measurements) {
    if (!places_pose(m)) continue;
    ++out.start[static_cast<std::size_t>(m.from) + 1];
    ++out.start[static_cast<std::size_t>(m.to) + 1];
  }
  std::partial_sum(out.start.begin(), out.start.end(), out.start.begin());
  out.measurement.resize(static_cast<std::size_t>(out.start.back()));
  std::vector<std::int64_t> at(out.start.begin(), out.start.end() - 1);
  for (std::size_t k = 0; k < problem.measurements.size(); ++k) {
    const auto& m = problem.measurements[k];
    if (!places_pose(m)) continue;
    for (const int end : {m.from, m.to}) {
      auto& slot = at[static_cast<std::size_t>(end)];
      out.measurement[static_cast<std::size_t>(slot++)] = static_cast<int>(k);
    }
  }
  return out;
}

/// Breadth first from the poses in `queue`, over all links or those between neighbours in time.
template <int D>
void place_poses(const LocalProblem<D>& problem, const PoseLinks& links, bool neighbours_only,
                 std::vector<int> queue, InitialValues<D>& out) {
  for (std::size_t head = 0; head < queue.size(); ++head) {
    const int here = queue[head];
    for (auto s = links.start[static_cast<std::size_t>(here)];
         s < links.start[static_cast<std::size_t>(here) + 1]; ++s) {
      const auto& m = problem.measurements[static_cast<std::size_t>(
          links.measurement[static_cast<std::size_t>(s)])];
      const int there = m.from == here ? m.to : m.from;
      if (out.known[static_cast<std::size_t>(there)]) continue;
      if (neighbours_only && std::abs(there - here) > 1) continue;
      Rigid<D> step;
      m.model->seen(m.z, reinterpret_cast<double*>(&step));
      out.values.pose(there) = out.values.pose(here) * (m.from == here ? step : step.inverse());
      out.known[static_cast<std::size_t>(there)] = 1;
      queue.push_back(there);
    }
  }
}

/// Of what several measurements say of one feature, the one nearest to the others: the sum of the
/// distances is least.
template <int D>
std::size_t middle_of(const VariableKind<D>& kind, const std::vector<double>& candidates) {
  const auto size = static_cast<std::size_t>(kind.value_size);
  const std::size_t n = std::min<std::size_t>(candidates.size() / size, 32);
  if (n < 3 || !kind.has_position) return 0;
  std::vector<int> index(n);
  std::iota(index.begin(), index.end(), 0);
  Eigen::Matrix<double, D, Eigen::Dynamic> p(D, static_cast<Eigen::Index>(n));
  kind.positions(candidates.data(), index.data(), n, p.data());
  Eigen::Index best = 0;
  double least = -1.0;
  for (Eigen::Index k = 0; k < p.cols(); ++k) {
    const double sum = (p.colwise() - p.col(k)).colwise().norm().sum();
    if (least < 0.0 || sum < least) {
      least = sum;
      best = k;
    }
  }
  return static_cast<std::size_t>(best);
}

template <int D>
void place_features(const LocalProblem<D>& problem, bool all_of_them, InitialValues<D>& out) {
  const auto n = static_cast<std::size_t>(problem.variables.size());
  std::vector<std::vector<int>> seen_by(n);
  for (std::size_t k = 0; k < problem.measurements.size(); ++k) {
    const auto& m = problem.measurements[k];
    const auto to = static_cast<std::size_t>(m.to);
    if (out.known[to] || m.model->seen == nullptr) continue;
    if (seen_by[to].empty() || all_of_them) seen_by[to].push_back(static_cast<int>(k));
  }
  std::vector<double> candidates;
  for (std::size_t i = 0; i < n; ++i) {
    if (seen_by[i].empty()) continue;
    const VariableKind<D>& kind = problem.variables.kind(static_cast<int>(i));
    const auto size = static_cast<std::size_t>(kind.value_size);
    candidates.assign(seen_by[i].size() * size, 0.0);
    for (std::size_t k = 0; k < seen_by[i].size(); ++k) {
      const auto& m = problem.measurements[static_cast<std::size_t>(seen_by[i][k])];
      m.model->seen(m.z, &candidates[k * size]);
      kind.transform(out.values.pose(m.from), &candidates[k * size], 1);
    }
    const double* const chosen = &candidates[middle_of(kind, candidates) * size];
    std::copy(chosen, chosen + size, out.values.value(static_cast<int>(i)));
    out.known[i] = 1;
  }
}

}  // namespace

template <int D>
InitialValues<D> initial_values(const LocalProblem<D>& problem, bool in_order) {
  InitialValues<D> out;
  out.values = Values<D>(problem.variables);
  out.known.assign(static_cast<std::size_t>(problem.variables.size()), 0);
  const int first = problem.first_pose();
  out.values.pose(first) = Rigid<D>::identity();
  out.known[static_cast<std::size_t>(first)] = 1;
  const PoseLinks links = pose_links(problem);
  if (in_order) place_poses(problem, links, true, {first}, out);
  std::vector<int> placed;
  for (int i = first; i <= problem.last_pose(); ++i) {
    if (out.known[static_cast<std::size_t>(i)]) placed.push_back(i);
  }
  place_poses(problem, links, false, std::move(placed), out);
  place_features(problem, in_order, out);
  return out;
}

#define MAPJOIN_INSTANTIATE(D)                                                                \
  template std::vector<LocalProblem<D>> local_problems<D>(const RawLog<D>&,                   \
                                                          std::span<const std::int64_t>);     \
  template LocalProblem<D> without<D>(const LocalProblem<D>&, std::span<const std::int64_t>); \
  template InitialValues<D> initial_values<D>(const LocalProblem<D>&, bool);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
