#include "benchmarks/growth.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "benchmarks/join_run.h"
#include "benchmarks/problem.h"
#include "mapjoin/graph/error.h"

namespace mapjoin::benchmarks {

namespace {

std::int64_t variables_of(const AnyProblem& any) {
  return std::visit([](const auto& p) { return std::int64_t{p.graph.variables.size()}; }, any);
}

/// "manhattan:10,20": manhattan:10 and manhattan:20.
std::vector<std::string> worlds_of(const std::string& text) {
  const std::size_t colon = text.find(':');
  std::vector<std::string> out;
  for (std::size_t at = colon; at != std::string::npos;) {
    const std::size_t next = text.find(',', at + 1);
    out.push_back(text.substr(0, colon) + ":" + text.substr(at + 1, next - at - 1));
    at = next;
  }
  if (out.size() < 2) {
    throw InputError(
        fmt::format("--growth {}: expected WORLD:POSES,POSES,... with two sizes or more, as in "
                    "manhattan:10000,100000",
                    text));
  }
  return out;
}

template <int D>
GrowthStep describe(const Problem<D>& problem) {
  const JoinResult<D> result = run_join(problem, 1, false).result;
  GrowthStep out;
  out.poses = result.report.poses;
  out.observations = result.report.observations;
  out.error = chi2_of(result) / minimum_of(problem, result).chi2 - 1.0;
  return out;
}

}  // namespace

bool GrowthStep::reached() const { return std::abs(error) <= kTolerance; }

bool Growth::reached() const {
  return std::all_of(steps.begin(), steps.end(), [](const GrowthStep& s) { return s.reached(); });
}

double Growth::power(std::size_t from, std::size_t to, std::size_t t) const {
  return std::log(times_as_fast(steps[from].join[t], steps[to].join[t])) /
         std::log(static_cast<double>(steps[to].poses) / static_cast<double>(steps[from].poses));
}

GrowthRace::GrowthRace(const std::string& text, std::uint64_t seed,
                       const ComparisonOptions& options) {
  for (const std::string& world : worlds_of(text)) {
    problems_.push_back(simulate_problem(world, seed));
    if (problems_.size() > 1 && variables_of(problems_.back()) <= variables_of(problems_.end()[-2]))
      throw InputError(fmt::format("--growth {}: name the sizes from small to large", text));
  }
  out_.world = text.substr(0, text.find(':'));
  out_.dimension = std::holds_alternative<Problem<2>>(problems_[0]) ? 2 : 3;
  out_.threads = options.threads;
  std::vector<Contender> all;
  for (const AnyProblem& any : problems_) {
    std::visit(
        [&](const auto& problem) {
          out_.steps.push_back(describe(problem));
          for (const int threads : options.threads) {
            all.push_back(
                {problem.name, threads,
                 [&problem, threads] { return run_join(problem, threads, false).measured; }, true});
          }
        },
        any);
  }
  constexpr double kRound = 1.0;  // seconds: as long as some runs of the large sizes take
  race_.emplace(std::move(all), std::numeric_limits<double>::infinity(), kRound);
}

Growth GrowthRace::finish() && {
  std::vector<Contender> all = std::move(*race_).finish();
  for (std::size_t k = 0; k < all.size(); ++k)
    out_.steps[k / out_.threads.size()].join.push_back(std::move(all[k]));
  return std::move(out_);
}

}  // namespace mapjoin::benchmarks
