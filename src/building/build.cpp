#include "mapjoin/building/build.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <exception>
#include <utility>

#include "mapjoin/building/map_builder.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/solvers/pool_loop.h"
#include "mapjoin/solvers/worker_pool.h"

namespace mapjoin {

namespace {

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
  rethrow_first(errors);
}

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

/// \throws InputError where frames of features are asked for and there are none.
template <int D>
void expect_features(const RawLog<D>& log, const BuildOptions& options) {
  const bool wanted = options.frame == LocalFrame::kFeatures && options.keep != Keep::kFeatures;
  if (wanted && log.variables.find_column(Tag("point")) < 0) {
    throw InputError(
        "the recording has no features that could fix the frames of local maps: anchor them at "
        "their start or end poses");
  }
}

}  // namespace

template <int D>
BuiltMaps<D> build_local_maps(const RawLog<D>& log, const Segmentation& segmentation,
                              const BuildOptions& options) {
  check(options);
  expect_features(log, options);
  const auto start = std::chrono::steady_clock::now();
  WorkerPool pool(options.threads);
  std::vector<std::vector<LocalProblem<D>>> of_segment(segmentation.maps.size());
  for_each(pool, of_segment.size(), [&](std::size_t k) {
    of_segment[k] = local_problems(log, std::span(segmentation.maps[k]));
  });
  std::vector<LocalProblem<D>> problems;
  std::vector<int> maps_of(static_cast<std::size_t>(log.variables.size()), 0);
  for (auto& segment : of_segment) {
    for (LocalProblem<D>& problem : segment) {
      for (const int number : problem.numbers) ++maps_of[static_cast<std::size_t>(number)];
      problems.push_back(std::move(problem));
    }
  }

  const MapBuilder<D> builder(log, options, maps_of);
  std::vector<BuiltMap<D>> built(problems.size());
  for_each(pool, problems.size(),
           [&](std::size_t k) { built[k] = builder.build(std::move(problems[k])); });
  BuiltMaps<D> out;
  for (BuiltMap<D>& b : built) {
    if (b.map) out.maps.push_back(std::move(*b.map));
    out.used.insert(out.used.end(), b.used.begin(), b.used.end());
    out.chi2 += b.summary.chi2;
    out.most_iterations = std::max(out.most_iterations, b.summary.iterations);
  }
  std::sort(out.used.begin(), out.used.end());
  for (const auto& map : segmentation.maps) {
    for (const std::int64_t m : map) {
      if (!std::binary_search(out.used.begin(), out.used.end(), m)) out.refused.push_back(m);
    }
  }
  std::sort(out.refused.begin(), out.refused.end());
  out.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return out;
}

template BuiltMaps<2> build_local_maps<2>(const RawLog<2>&, const Segmentation&,
                                          const BuildOptions&);
template BuiltMaps<3> build_local_maps<3>(const RawLog<3>&, const Segmentation&,
                                          const BuildOptions&);

}  // namespace mapjoin
