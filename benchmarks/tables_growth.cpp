#include <fmt/format.h>

#include "benchmarks/tables.h"

namespace mapjoin::benchmarks {

namespace {

std::string mebibytes(const Contender& c) {
  return c.peak_bytes ? fmt::format("{:.0f}", static_cast<double>(*c.peak_bytes) / 1048576)
                      : "not measurable";
}

std::vector<std::string> row(const Growth& g, std::size_t t, std::size_t s) {
  const GrowthStep& step = g.steps[s];
  const Contender& join = step.join[t];
  const bool whole = s > 1 && s + 1 == g.steps.size();
  return {fmt::format("{}", step.poses),
          fmt::format("{}", step.observations),
          fmt::format("{}", g.threads[t]),
          seconds(join.seconds()),
          fmt::format("{:.2f}", 1e6 * join.seconds() / static_cast<double>(step.poses)),
          s == 0 ? "" : fmt::format("{:.3f}", g.power(s - 1, s, t)),
          whole ? fmt::format("{:.3f}", g.power(t)) : "",
          mebibytes(join),
          fmt::format("{:.1e}", step.error),
          step.reached() ? "yes" : "**MISSED**"};
}

}  // namespace

std::string markdown(std::span<const Growth> growths, const ComparisonOptions& options) {
  if (growths.empty()) return {};
  std::string out = fmt::format(
      "## Growth\n\nSeconds to the optimum, medians of {} rounds, of {} where one takes less than "
      "two seconds;\nsizes and numbers of threads take turns, in one process that keeps its "
      "memory, small sizes as often\nas fits into a second. Powers are medians of what the rounds "
      "of both "
      "say, so that a slow minute\nslows down all sizes. Memory: the first run's peak beyond what "
      "was in use.\n\n",
      options.repeat, options.repeat * (1 + options.between));
  for (const Growth& g : growths) {
    Rows rows;
    for (std::size_t t = 0; t < g.threads.size(); ++t) {
      for (std::size_t s = 0; s < g.steps.size(); ++s) rows.push_back(row(g, t, s));
    }
    out += table({g.world + ", poses", "measurements", "threads", "to the optimum, s", "us a pose",
                  "power of poses", "from first to last", "memory, MiB", "relative difference",
                  "within 1e-6"},
                 rows);
  }
  return out;
}

}  // namespace mapjoin::benchmarks
