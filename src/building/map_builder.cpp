#include "mapjoin/building/map_builder.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "mapjoin/building/filter.h"
#include "mapjoin/building/integrated.h"
#include "mapjoin/building/parts.h"
#include "mapjoin/building/prepared.h"
#include "mapjoin/frames/anchors.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/frames/points_anchor.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/joining/join_all.h"
#include "mapjoin/solvers/marginalize.h"

namespace mapjoin {

namespace {

template <int D>
Anchor<D> wanted_anchor(const Map<D>& map, const LocalProblem<D>& problem,
                        const BuildOptions& options) {
  if (options.frame == LocalFrame::kFeatures || options.keep == Keep::kFeatures) {
    if (const auto points = farthest_points(map.values)) return *points;
  }
  if (options.keep == Keep::kFeatures) return map.anchor;
  const bool end = options.frame == LocalFrame::kEnd;
  return pose_anchor<D>(problem.variables.key(end ? problem.last_pose() : problem.first_pose()));
}

/// The measurements of a problem as they are; nothing where some are not relative poses or points.
template <int D>
std::optional<MeasurementGraph<D>> own_graph(const LocalProblem<D>& problem) {
  MeasurementGraphBuilder<D> builder;
  for (const auto& m : problem.measurements) {
    if (!m.model->relative) return std::nullopt;
    builder.add(*m.model->target, problem.variables.key(m.from), problem.variables.key(m.to), m.z,
                m.info);
  }
  return std::move(builder).build();
}

template <int D>
Map<D> the_map(JoinResult<D> joined) {
  if (joined.maps.size() != 1)  // cannot be: the problem hangs together, and so do its parts
    throw Error("the parts of a local map do not hang together");
  return std::move(joined.maps[0]);
}

/// The variables of parts that have to stay until the parts are joined: what is kept in the end,
/// and the poses at which parts meet.
template <int D>
std::vector<std::vector<char>> kept_in_parts(const LocalProblem<D>& whole,
                                             const std::vector<char>& keep,
                                             const std::vector<LocalProblem<D>>& parts) {
  const auto place = [&](int number) {
    return static_cast<std::size_t>(
        std::lower_bound(whole.numbers.begin(), whole.numbers.end(), number) -
        whole.numbers.begin());
  };
  std::vector<int> parts_with(whole.numbers.size(), 0);
  for (const LocalProblem<D>& part : parts) {
    for (const int number : part.numbers) ++parts_with[place(number)];
  }
  std::vector<std::vector<char>> out;
  for (const LocalProblem<D>& part : parts) {
    std::vector<char>& own = out.emplace_back();
    for (const int number : part.numbers)
      own.push_back(keep[place(number)] || parts_with[place(number)] > 1);
  }
  return out;
}

}  // namespace

template <int D>
std::vector<char> MapBuilder<D>::kept(const LocalProblem<D>& problem) const {
  std::vector<char> out(static_cast<std::size_t>(problem.variables.size()), 1);
  if (options_.keep == Keep::kAll) return out;
  for (int i = problem.first_pose(); i <= problem.last_pose(); ++i) {
    const auto k = static_cast<std::size_t>(i);
    const bool shared = maps_of_[static_cast<std::size_t>(problem.numbers[k])] > 1;
    out[k] = options_.keep == Keep::kEndPose &&
             (shared || i == problem.first_pose() || i == problem.last_pose());
  }
  return out;
}

template <int D>
bool MapBuilder<D>::is_large(const LocalProblem<D>& problem, const std::vector<char>& keep) const {
  if (options_.whole || problem.last_pose() - problem.first_pose() < 2 * kPartPoses) return false;
  if (options_.builder == Builder::kNonlinear) return true;  // whatever it keeps
  int state = 0;
  for (int i = 0; i < problem.variables.size(); ++i)
    state += keep[static_cast<std::size_t>(i)] ? problem.variables.dim(i) : 0;
  return state > kLargestState;
}

/// What joining makes of a large map's own measurements. Relative poses and points are joined as
/// they are, every pose with what it measures a local map; anything else in parts. With a robust
/// loss both: measurements as they are may be wrong, which parts notice.
template <int D>
std::vector<Map<D>> MapBuilder<D>::joined_starts(const LocalProblem<D>& problem) const {
  std::vector<Map<D>> out;
  if (const auto graph = own_graph(problem)) out.push_back(the_map(join_all(*graph, {})));
  if (out.empty() || robust()) {
    const std::vector<char> all(static_cast<std::size_t>(problem.variables.size()), 1);
    out.push_back(joined_parts(problem, all).map);
  }
  return out;
}

/// The start with the smallest cost.
template <int D>
InitialValues<D> MapBuilder<D>::start_of(const LocalProblem<D>& problem) const {
  const InitialValues<D> chain = initial_values(problem, robust());
  if (!is_large(problem, {})) return chain;
  InitialValues<D> best = chain;
  for (const Map<D>& map : joined_starts(problem)) {
    InitialValues<D> joined = chain;
    const std::vector<int> places = numbers_in(map.variables(), problem.variables);
    for (int i = 0; i < map.values.size(); ++i) {
      const int place = places[static_cast<std::size_t>(i)];
      const double* const x = map.values.value(i);
      std::copy(x, x + map.variables().kind(i).value_size, joined.values.value(place));
      joined.known[static_cast<std::size_t>(place)] = 1;
    }
    const RobustLoss& loss = options_.loss;
    if (cost(problem, loss, joined, best) <= cost(problem, loss, best, joined))
      best = std::move(joined);
  }
  return best;
}

template <int D>
auto MapBuilder<D>::minimised(LocalProblem<D> problem, InitialValues<D> values) const -> Solved {
  Solved out{with_all_placed(std::move(problem), values), {}, {}};
  if (out.problem.measurements.empty()) return out;
  out.map.values = std::move(values.values);
  out.summary = minimise(out.problem, options_.loss, options_.max_iterations, out.map.values);
  out.map.information = information_at(out.problem, options_.loss, out.map.values);
  out.map.anchor = pose_anchor<D>(out.problem.variables.key(out.problem.first_pose()));
  return out;
}

template <int D>
auto MapBuilder<D>::filtered(LocalProblem<D> problem, InitialValues<D> values,
                             const std::vector<char>& keep) const -> Solved {
  const std::vector<int> numbers = problem.numbers;
  Solved out{with_all_placed(std::move(problem), values), {}, {}};
  if (out.problem.measurements.empty()) return out;
  std::vector<char> kept;
  for (std::size_t i = 0, k = 0; i < numbers.size() && k < out.problem.numbers.size(); ++i) {
    if (numbers[i] != out.problem.numbers[k]) continue;
    kept.push_back(keep[i]);
    ++k;
  }
  FilteredMap<D> filtered = filter(out.problem, values, std::span<const char>(kept));
  out.map = std::move(filtered.map);
  out.summary.chi2 = filtered.chi2;
  return out;
}

/// Each part from its own chain; then the least squares optimum over the parts, which joining finds
/// without a start.
template <int D>
auto MapBuilder<D>::joined_parts(LocalProblem<D> problem, const std::vector<char>& keep) const
    -> Solved {
  const std::vector<LocalProblem<D>> parts = parts_of(log_, problem);
  const std::vector<std::vector<char>> keeps = kept_in_parts(problem, keep, parts);
  SolveSummary summary;
  std::vector<Map<D>> maps;
  std::vector<std::int64_t> used;
  for (std::size_t k = 0; k < parts.size(); ++k) {
    InitialValues<D> chain = initial_values(parts[k], robust());
    Solved part = options_.builder == Builder::kFilter
                      ? filtered(parts[k], std::move(chain), keeps[k])
                      : minimised(parts[k], std::move(chain));
    if (part.problem.measurements.empty()) continue;
    if (options_.builder == Builder::kNonlinear)
      part.map.observations = integrated_observations(part.problem, options_.loss, part.map);
    summary.chi2 += part.summary.chi2;
    for (const auto& m : part.problem.measurements) used.push_back(m.number);
    maps.push_back(std::move(part.map));
  }
  JoinResult<D> joined = join_all(std::span<const Map<D>>(maps), {}, {});
  summary.chi2 += joined.report.chi2;

  std::sort(used.begin(), used.end());
  std::vector<std::int64_t> refused;
  for (const auto& m : problem.measurements) {
    if (!std::binary_search(used.begin(), used.end(), m.number)) refused.push_back(m.number);
  }
  if (!refused.empty()) problem = without(problem, std::span(std::as_const(refused)));
  return {std::move(problem), the_map(std::move(joined)), summary};
}

template <int D>
auto MapBuilder<D>::solved(LocalProblem<D> problem, const std::vector<char>& keep) const -> Solved {
  if (options_.builder == Builder::kNonlinear) {
    InitialValues<D> start = start_of(problem);
    return minimised(std::move(problem), std::move(start));
  }
  if (is_large(problem, keep)) return joined_parts(std::move(problem), keep);
  InitialValues<D> chain = initial_values(problem, false);
  return filtered(std::move(problem), std::move(chain), keep);
}

template <int D>
BuiltMap<D> MapBuilder<D>::build(LocalProblem<D> problem) const {
  std::vector<char> keep = kept(problem);
  Solved solved = this->solved(std::move(problem), keep);
  const LocalProblem<D>& placed = solved.problem;
  BuiltMap<D> out;
  if (placed.measurements.empty()) return out;
  for (const auto& m : placed.measurements) out.used.push_back(m.number);
  out.summary = solved.summary;

  Map<D>& map = out.map.emplace(std::move(solved.map));
  keep = kept(placed);
  std::vector<int> wanted;  // the filter has dropped most of the others already
  const std::vector<int> there = numbers_in(map.variables(), placed.variables);
  for (std::size_t i = 0; i < there.size(); ++i) {
    if (keep[static_cast<std::size_t>(there[i])]) wanted.push_back(static_cast<int>(i));
  }
  const bool own = options_.keep == Keep::kAll && options_.builder == Builder::kNonlinear;
  const auto observe = [&] {
    map.observations = integrated_observations(placed, options_.loss, map);
  };
  try {
    if (wanted.size() < there.size()) map = marginalize(map, std::span<const int>(wanted));
    const Anchor<D> anchor = wanted_anchor(map, placed, options_);
    if (own && !is_pose_anchor(anchor)) observe();  // from the first pose, whatever the frame
    if (!(anchor == map.anchor)) map = change_frame(std::move(map), anchor);
    if (own && is_pose_anchor(anchor)) observe();
  } catch (const DegenerateFrameError& error) {
    throw DegenerateFrameError(
        fmt::format("the local map from {} to {}: {}; or build larger local maps",
                    to_string(placed.variables.key(placed.first_pose())),
                    to_string(placed.variables.key(placed.last_pose())), error.what()));
  }
  map.solved_in = map.anchor;  // gauge-free to rounding: any frame is as good
  return out;
}

template class MapBuilder<2>;
template class MapBuilder<3>;

}  // namespace mapjoin
