#include "benchmarks/goals.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "benchmarks/published.h"
#include "benchmarks/tables.h"

namespace mapjoin::benchmarks {

namespace {

const ThreadFigures* with(const Comparison& c, int threads) {
  const auto at = std::find_if(c.threads.begin(), c.threads.end(),
                               [&](const ThreadFigures& t) { return t.threads == threads; });
  return at == c.threads.end() ? nullptr : &*at;
}

/// Seconds of the fastest of the others, on this machine if CHOLMOD is the measure of both.
std::optional<double> fastest_other(const Comparison& c, const ThreadFigures& one_thread) {
  const auto p = published(c.name, c.local_maps);
  if (!p || p->cholmod <= 0.0) return std::nullopt;
  double least = p->g2o;
  for (const double s : {p->gtsam, p->se_sync})
    if (s > 0.0) least = std::min(least, s);
  return least * one_thread.once().seconds() / p->cholmod;
}

void add_goals(std::span<const Comparison> comparisons, std::vector<Goal>& out) {
  for (const Comparison& c : comparisons) {
    const std::string data = label(c);
    const ThreadFigures *const one = with(c, 1), *const two = with(c, 2);
    if (one != nullptr)
      out.push_back(
          {data, "one thread over one factorisation", one->ratio(), true, kGoalOneThread});
    if (two != nullptr)
      out.push_back(
          {data, "two threads over one factorisation", two->ratio(), true, kGoalTwoThreads});
    if (one == nullptr || two == nullptr) continue;
    if (c.factor_rows >= kGoalSpeedUpFrom) {
      out.push_back(
          {data, "two threads, times as fast as one", two->speed_up(*one), false, kGoalSpeedUp});
    }
    if (const auto other = fastest_other(c, *one)) {
      out.push_back({data, "two threads over the fastest of the others",
                     two->join.seconds() / *other, true,
                     c.poses > kLargeFrom ? kGoalOfOthersLarge : kGoalOfOthersSmall});
    }
  }
}

void add_goals(std::span<const Growth> growths, std::vector<Goal>& out) {
  for (const Growth& g : growths) {
    const auto one = std::find(g.threads.begin(), g.threads.end(), 1) - g.threads.begin();
    const auto two = std::find(g.threads.begin(), g.threads.end(), 2) - g.threads.begin();
    const auto all = static_cast<std::ptrdiff_t>(g.threads.size());
    for (const GrowthStep& step : g.steps) {
      const std::int64_t unknowns = (g.dimension == 2 ? 3 : 6) * step.poses;
      if (one == all || two == all || static_cast<double>(unknowns) < kGoalSpeedUpFrom) continue;
      const auto join = [&](std::ptrdiff_t t) -> const Contender& {
        return step.join[static_cast<std::size_t>(t)];
      };
      out.push_back({fmt::format("{} {}", g.world, step.poses), "two threads, times as fast as one",
                     times_as_fast(join(two), join(one)), false, kGoalSpeedUp});
    }
    for (std::size_t t = 0; g.dimension == 2 && t < g.threads.size(); ++t) {
      out.push_back(
          {fmt::format("{} {} to {}", g.world, g.steps.front().poses, g.steps.back().poses),
           fmt::format("power of poses as which seconds grow, {} thread{}", g.threads[t],
                       g.threads[t] == 1 ? "" : "s"),
           g.power(t), true, kGoalGrowth});
    }
  }
}

}  // namespace

std::vector<Goal> goals(std::span<const Comparison> comparisons, std::span<const Growth> growths) {
  std::vector<Goal> out;
  add_goals(comparisons, out);
  add_goals(growths, out);
  return out;
}

std::string markdown(std::span<const Goal> goals) {
  std::string out;
  for (const Goal& goal : goals) {
    out += fmt::format("* {}, {}: {:.3f} {} {:.3g} {}\n", goal.data, goal.what, goal.value,
                       goal.at_most ? "<=" : ">=", goal.limit,
                       goal.holds() ? "holds" : "does **not** hold");
  }
  return out;
}

}  // namespace mapjoin::benchmarks
