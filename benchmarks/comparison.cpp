#include "benchmarks/comparison.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <future>
#include <iterator>
#include <utility>

#include "benchmarks/ceres_run.h"
#include "benchmarks/cholmod_run.h"
#include "benchmarks/join_run.h"
#include "benchmarks/published.h"
#include "mapjoin/frames/gauge.h"
#include "mapjoin/graph/error.h"

namespace mapjoin::benchmarks {

namespace {

bool within(double chi2, double optimum) {
  return std::abs(chi2 - optimum) <= kTolerance * optimum;
}

const Contender& fastest(const std::vector<Contender>& contenders,
                         double (Contender::*seconds)() const) {
  return *std::min_element(
      contenders.begin(), contenders.end(),
      [&](const Contender& a, const Contender& b) { return (a.*seconds)() < (b.*seconds)(); });
}

template <int D>
Comparison describe(const Problem<D>& problem, const JoinResult<D>& result) {
  Comparison out;
  out.name = problem.name;
  out.local_maps = !problem.local_maps.empty();
  out.dimension = D;
  out.poses = result.report.poses;
  out.features = result.report.features;
  out.observations = result.report.observations;
  out.refine_solves = result.report.refine_solves;
  out.joins = result.report.joins;
  out.redone_joins = result.report.redone_joins;
  out.chi2 = chi2_of(result);
  const auto known = published(problem.name, out.local_maps);
  const Minimum minimum =
      known ? Minimum{known->optimum, "reference"} : minimum_of(problem, result);
  out.optimum = minimum.chi2;
  out.optimum_from = minimum.from;
  return out;
}

template <int D>
FinalSystem final_system(const Map<D>& map) {
  FinalSystem out;
  out.lower = anchored_information(map).lower;
  out.lower.makeCompressed();
  out.b = out.lower.template selfadjointView<Eigen::Lower>() *
          Eigen::VectorXd::LinSpaced(out.lower.rows(), -1.0, 1.0);
  return out;
}

/// CHOLMOD's variants; with more than one thread only those that can use them. Column by column
/// there is no BLAS, and nothing else in CHOLMOD that threads could share. The contenders refer to
/// `system`.
std::vector<Contender> factorizations(const FinalSystem& system, int threads) {
  std::vector<Contender> out;
  for (const CholmodVariant& variant : cholmod_variants()) {
    if (threads > 1 && !variant.supernodal) continue;
    out.push_back(
        {threads == 1 ? variant.name : fmt::format("{}, {} threads", variant.name, threads),
         threads, [&variant, &system] { return run_cholmod(variant, system.lower, system.b); }});
  }
  return out;
}

/// The whole run, with the information matrix of the result or without. Refers to `problem`.
template <int D>
Contender whole_run(const Problem<D>& problem, int threads, bool information) {
  return {
      information ? "mapjoin, with information" : "mapjoin", threads,
      [&problem, threads, information] { return run_join(problem, threads, information).measured; },
      !information};
}

/// Refers to all its arguments, and writes down in `out` where Ceres ends.
template <int D>
Contender ceres_run(const Problem<D>& problem, int threads, const ComparisonOptions& options,
                    Comparison& out) {
  return {"Ceres", threads, [&problem, threads, &options, &out] {
            CeresRun run = run_ceres(problem.graph, threads, out.optimum * (1.0 + kTolerance),
                                     options.ceres_limit);
            out.ceres_chi2 = run.chi2;
            out.ceres_iterations = run.iterations;
            return std::move(run.measured);
          }};
}

/// Joins that share nothing but the machine. Refers to `problem`.
template <int D>
Contender side_by_side(const Problem<D>& problem, int threads) {
  return {fmt::format("{} joins at once", threads), threads,
          [&problem, threads] {
            Laps laps;
            std::vector<std::future<void>> runners;
            for (int k = 0; k < threads; ++k)
              runners.push_back(
                  std::async(std::launch::async, [&problem] { run_join(problem, 1, false); }));
            for (std::future<void>& runner : runners) runner.get();
            laps.lap();
            return std::move(laps).measured();
          },
          true};
}

/// Everybody, group by group. Joins that will be compared with each other are neighbours: what
/// disturbs the machine then disturbs both.
template <int D>
std::vector<std::vector<Contender>> entrants(const Problem<D>& problem, const FinalSystem& system,
                                             const ComparisonOptions& options, Comparison& out) {
  const bool with_ceres = options.ceres && out.why_not_ceres.empty();
  std::vector<std::vector<Contender>> groups = {factorizations(system, 1)};
  for (const int threads : options.threads) groups.push_back({whole_run(problem, threads, false)});
  for (const int threads : options.threads) {
    groups.emplace_back();
    if (threads > 1) groups.back().push_back(side_by_side(problem, threads));
  }
  for (const int threads : options.threads) {
    groups.push_back({whole_run(problem, threads, true)});
    groups.push_back(threads > 1 ? factorizations(system, threads) : std::vector<Contender>());
    groups.emplace_back();
    if (with_ceres) groups.back().push_back(ceres_run(problem, threads, options, out));
  }
  return groups;
}

/// From the groups that `entrants` made.
std::vector<ThreadFigures> figures_of(const std::vector<std::vector<Contender>>& groups,
                                      const std::vector<int>& threads) {
  std::vector<ThreadFigures> figures;
  const std::size_t count = threads.size();
  for (std::size_t t = 0; t < count; ++t) {
    const auto* const rest = &groups[1 + 2 * count + 3 * t];
    ThreadFigures f;
    f.threads = threads[t];
    f.join = groups[1 + t][0];
    f.side_by_side = groups[1 + count + t];
    f.with_information = rest[0][0];
    f.cholmod = groups[0];
    f.cholmod.insert(f.cholmod.end(), rest[1].begin(), rest[1].end());
    f.ceres = rest[2];
    figures.push_back(std::move(f));
  }
  return figures;
}

}  // namespace

const Contender& ThreadFigures::once() const { return fastest(cholmod, &Contender::seconds); }

double ThreadFigures::cpu_ratio() const {
  return join.cpu_seconds() / fastest(cholmod, &Contender::cpu_seconds).cpu_seconds();
}

double ThreadFigures::machine_speed_up(const ThreadFigures& one) const {
  return side_by_side.empty() ? 1.0 : threads * times_as_fast(side_by_side[0], one.join);
}

bool Comparison::reached() const { return within(chi2, optimum); }

// From above: Ceres is stopped as soon as it is near enough.
bool Comparison::ceres_reached() const { return ceres_chi2 <= optimum * (1.0 + kTolerance); }

ComparisonRace::ComparisonRace(AnyProblem problem, const ComparisonOptions& options)
    : problem_(std::move(problem)), options_(options) {
  std::visit([&](const auto& p) { enter(p); }, problem_);
}

template <int D>
void ComparisonRace::enter(const Problem<D>& problem) {
  {
    const JoinResult<D> result = run_join(problem, 1, true).result;
    if (result.maps.size() != 1) {
      throw InputError(
          fmt::format("{} falls into {} pieces that nothing links; compare on one of them",
                      problem.name, result.maps.size()));
    }
    out_ = describe(problem, result);
    system_ = final_system(result.maps[0]);
  }
  out_.factor_rows = static_cast<double>(system_.lower.rows());
  out_.why_not_ceres = why_not_ceres(problem.graph);
  std::vector<Contender> all;
  for (std::vector<Contender>& group : entrants(problem, system_, options_, out_)) {
    sizes_.push_back(group.size());
    std::move(group.begin(), group.end(), std::back_inserter(all));
  }
  race_.emplace(std::move(all), options_.slow, options_.round);
}

Comparison ComparisonRace::finish() && {
  std::vector<Contender> all = std::move(*race_).finish();
  std::vector<std::vector<Contender>> groups;
  auto next = std::make_move_iterator(all.begin());
  for (const std::size_t size : sizes_) {
    groups.emplace_back(next, next + static_cast<std::ptrdiff_t>(size));
    next += static_cast<std::ptrdiff_t>(size);
  }
  out_.threads = figures_of(groups, options_.threads);
  return std::move(out_);
}

}  // namespace mapjoin::benchmarks
