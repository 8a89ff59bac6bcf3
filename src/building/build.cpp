#include "mapjoin/building/build.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <exception>
#include <optional>
#include <utility>

#include "mapjoin/building/delayed.h"
#include "mapjoin/building/filter.h"
#include "mapjoin/building/integrated.h"
#include "mapjoin/building/nonlinear.h"
#include "mapjoin/frames/anchors.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/frames/points_anchor.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/solvers/marginalize.h"
#include "mapjoin/solvers/worker_pool.h"

namespace mapjoin {

namespace {

/// A local map before it is solved.
template <int D>
struct Prepared {
  LocalProblem<D> problem;
  InitialValues<D> values;
};

/// Calls task(k) for k = 0 .. n - 1 on all threads of a pool. \throws what the lowest k threw.
template <class Task>
void for_each(WorkerPool& pool, std::size_t n, const Task& task) {
  std::atomic<std::size_t> next{0};
  std::vector<std::exception_ptr> errors(n);
  pool.run([&](int) {
    for (std::size_t k = next++; k < n; k = next++) {
      try {
        task(k);
      } catch (...) {
        errors[k] = std::current_exception();
      }
    }
  });
  for (const std::exception_ptr& error : errors) {
    if (error) std::rethrow_exception(error);
  }
}

/// Values to start from, without the measurements of features that cannot be placed.
template <int D>
std::vector<Prepared<D>> prepare(const RawLog<D>& log, std::span<const std::int64_t> measurements,
                                 bool in_order) {
  std::vector<Prepared<D>> out;
  for (LocalProblem<D>& problem : local_problems(log, measurements)) {
    InitialValues<D> values = initial_values(problem, in_order);
    const std::vector<std::int64_t> refused = place_delayed(problem, values);
    if (!refused.empty()) {
      std::vector<int> kept;
      LocalProblem<D> rest = without(problem, std::span(refused));
      for (const int i : numbers_in(rest.variables, problem.variables)) kept.push_back(i);
      values.values = subset(values.values, std::span<const int>(kept));
      values.known.assign(kept.size(), 1);
      problem = std::move(rest);
    }
    if (!problem.measurements.empty()) out.push_back({std::move(problem), std::move(values)});
  }
  return out;
}

/// What a local map keeps, by numbers of its variables.
template <int D>
std::vector<char> kept_variables(const LocalProblem<D>& problem, Keep keep,
                                 const std::vector<int>& maps_of) {
  std::vector<char> out(static_cast<std::size_t>(problem.variables.size()), 1);
  if (keep == Keep::kAll) return out;
  for (int i = problem.first_pose(); i <= problem.last_pose(); ++i) {
    const auto k = static_cast<std::size_t>(i);
    const bool shared = maps_of[static_cast<std::size_t>(problem.numbers[k])] > 1;
    out[k] =
        keep == Keep::kEndPose && (shared || i == problem.first_pose() || i == problem.last_pose());
  }
  return out;
}

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

template <int D>
class MapBuilder {
 public:
  MapBuilder(const BuildOptions& options, const std::vector<int>& maps_of)
      : options_(options), maps_of_(maps_of) {}

  Map<D> build(const Prepared<D>& p, SolveSummary& summary) const {
    const std::vector<char> keep = kept_variables(p.problem, options_.keep, maps_of_);
    Map<D> map =
        options_.builder == Builder::kFilter ? filtered(p, keep, summary) : minimised(p, summary);
    std::vector<int> kept;  // the filter has dropped most of the others already
    const std::vector<int> there = numbers_in(map.variables(), p.problem.variables);
    for (std::size_t i = 0; i < there.size(); ++i) {
      if (keep[static_cast<std::size_t>(there[i])]) kept.push_back(static_cast<int>(i));
    }
    try {
      if (kept.size() < there.size()) map = marginalize(map, std::span<const int>(kept));
      const Anchor<D> anchor = wanted_anchor(map, p.problem, options_);
      if (!(anchor == map.anchor)) map = change_frame(std::move(map), anchor);
    } catch (const DegenerateFrameError& error) {
      throw DegenerateFrameError(
          fmt::format("the local map from {} to {}: {}; or build larger local maps",
                      to_string(p.problem.variables.key(p.problem.first_pose())),
                      to_string(p.problem.variables.key(p.problem.last_pose())), error.what()));
    }
    map.solved_in = map.anchor;  // gauge-free to rounding: any frame is as good
    if (options_.builder == Builder::kNonlinear && options_.keep == Keep::kAll &&
        is_pose_anchor(map.anchor))
      map.observations = integrated_observations(p.problem, options_.loss, map);
    return map;
  }

 private:
  Map<D> filtered(const Prepared<D>& p, const std::vector<char>& keep,
                  SolveSummary& summary) const {
    FilteredMap<D> out = filter(p.problem, p.values, std::span<const char>(keep));
    summary.chi2 = out.chi2;
    return std::move(out.map);
  }
  Map<D> minimised(const Prepared<D>& p, SolveSummary& summary) const {
    Map<D> map;
    map.values = p.values.values;
    summary = minimise(p.problem, options_.loss, options_.max_iterations, map.values);
    map.information = information_at(p.problem, options_.loss, map.values);
    map.anchor = pose_anchor<D>(p.problem.variables.key(p.problem.first_pose()));
    return map;
  }

  const BuildOptions& options_;
  const std::vector<int>& maps_of_;  ///< in how many maps a variable of the recording is
};

void check(const BuildOptions& options) {
  if (options.threads < 1) throw InputError("threads must be at least 1");
  if (options.max_iterations < 1) throw InputError("max_iterations must be at least 1");
  const bool robust = options.loss.shape != RobustLoss::Shape::kNone;
  if (robust && options.builder == Builder::kFilter) {
    throw InputError(
        "a filter takes each measurement once and cannot weigh it against the others: robust "
        "losses are for the nonlinear builder");
  }
  if (robust && !(options.loss.width > 0.0))
    throw InputError("the width of a robust loss must be above 0");
}

}  // namespace

template <int D>
BuiltMaps<D> build_local_maps(const RawLog<D>& log, const Segmentation& segmentation,
                              const BuildOptions& options) {
  check(options);
  const auto start = std::chrono::steady_clock::now();
  WorkerPool pool(options.threads);
  const bool in_order = options.loss.shape != RobustLoss::Shape::kNone;
  std::vector<std::vector<Prepared<D>>> of_segment(segmentation.maps.size());
  for_each(pool, of_segment.size(), [&](std::size_t k) {
    of_segment[k] = prepare(log, std::span(segmentation.maps[k]), in_order);
  });

  BuiltMaps<D> out;
  std::vector<Prepared<D>> prepared;
  std::vector<int> maps_of(static_cast<std::size_t>(log.variables.size()), 0);
  for (auto& segment : of_segment) {
    for (Prepared<D>& p : segment) {
      for (const int number : p.problem.numbers) ++maps_of[static_cast<std::size_t>(number)];
      for (const auto& m : p.problem.measurements) out.used.push_back(m.number);
      prepared.push_back(std::move(p));
    }
  }
  std::sort(out.used.begin(), out.used.end());
  for (const auto& map : segmentation.maps) {
    for (const std::int64_t m : map) {
      if (!std::binary_search(out.used.begin(), out.used.end(), m)) out.refused.push_back(m);
    }
  }
  std::sort(out.refused.begin(), out.refused.end());

  const MapBuilder<D> builder(options, maps_of);
  std::vector<SolveSummary> summaries(prepared.size());
  out.maps.resize(prepared.size());
  for_each(pool, prepared.size(),
           [&](std::size_t k) { out.maps[k] = builder.build(prepared[k], summaries[k]); });
  for (const SolveSummary& s : summaries) {
    out.chi2 += s.chi2;
    out.most_iterations = std::max(out.most_iterations, s.iterations);
  }
  out.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return out;
}

template BuiltMaps<2> build_local_maps<2>(const RawLog<2>&, const Segmentation&,
                                          const BuildOptions&);
template BuiltMaps<3> build_local_maps<3>(const RawLog<3>&, const Segmentation&,
                                          const BuildOptions&);

}  // namespace mapjoin
