#include "benchmarks/tables.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <iterator>

#include "benchmarks/join_run.h"
#include "benchmarks/published.h"

namespace mapjoin::benchmarks {

namespace {

std::string known_seconds(double s) { return s > 0.0 ? seconds(s) : ""; }

std::string ratios(std::span<const Comparison> comparisons) {
  Rows rows;
  for (const Comparison& c : comparisons) {
    for (const ThreadFigures& t : c.threads) {
      const bool beside_one = t.threads > 1 && c.threads[0].threads == 1;
      std::string ceres = c.why_not_ceres.empty() ? "" : "no: " + c.why_not_ceres, ceres_ratio;
      if (!t.ceres.empty()) {
        ceres = seconds(t.ceres[0].seconds());
        if (!c.ceres_reached()) ceres += fmt::format(" (ends at chi2 {:.7g})", c.ceres_chi2);
        ceres_ratio = fmt::format("{:.1f}", t.ceres[0].seconds() / t.once().seconds());
      }
      rows.push_back({label(c), fmt::format("{}", t.threads), seconds(t.join.seconds()),
                      seconds(t.once().seconds()), t.once().name, fmt::format("{:.2f}", t.ratio()),
                      t.threads == 1 ? fmt::format("{:.2f}", t.cpu_ratio()) : "",
                      beside_one ? fmt::format("{:.2f}", t.speed_up(c.threads[0])) : "",
                      beside_one ? fmt::format("{:.2f}", t.machine_speed_up(c.threads[0])) : "",
                      ceres, ceres_ratio});
    }
  }
  return table({"data set", "threads", "to the optimum, s", "CHOLMOD once, s",
                "its fastest variant", "ratio", "ratio of CPU time", "times as fast as one",
                "two joins at once", "Ceres, s", "Ceres ratio"},
               rows);
}

std::string phases(std::span<const Comparison> comparisons) {
  std::vector<std::string> head = {"data set", "threads"};
  for (const char* phase : kJoinPhases) head.push_back(fmt::format("{}, s", phase));
  head.insert(head.end(), {"information besides, s", "joins", "redone", "refining solves"});
  Rows rows;
  for (const Comparison& c : comparisons) {
    for (const ThreadFigures& t : c.threads) {
      rows.push_back({label(c), fmt::format("{}", t.threads)});
      for (const double s : t.join.phase_seconds()) rows.back().push_back(seconds(s));
      // Information is the result's: the difference of that phase has less noise than that of all.
      const double more = t.with_information.phase_seconds().back() - t.join.phase_seconds().back();
      rows.back().push_back(seconds(std::max(0.0, more)));
      for (const int n : {c.joins, c.redone_joins, c.refine_solves})
        rows.back().push_back(fmt::format("{}", n));
    }
  }
  return table(head, rows);
}

std::string checks(std::span<const Comparison> comparisons) {
  Rows rows;
  for (const Comparison& c : comparisons) {
    rows.push_back({label(c), fmt::format("{}", c.poses), fmt::format("{}", c.features),
                    fmt::format("{}", c.observations), fmt::format("{:.9g}", c.chi2),
                    fmt::format("{:.9g}", c.optimum), c.optimum_from,
                    fmt::format("{:.1e}", c.error()), c.reached() ? "yes" : "**MISSED**"});
  }
  return table({"data set", "poses", "features", "measurements", "chi2", "optimum", "known from",
                "relative difference", "within 1e-6"},
               rows);
}

std::string memory(std::span<const Comparison> comparisons) {
  Rows rows;
  for (const Comparison& c : comparisons) {
    for (const ThreadFigures& t : c.threads) {
      rows.push_back({label(c), fmt::format("{}", t.threads)});
      std::vector<const Contender*> shown = {&t.join, &t.once()};
      if (!t.ceres.empty()) shown.push_back(&t.ceres[0]);
      for (const Contender* contender : shown) {
        const auto bytes = contender->peak_bytes;
        rows.back().push_back(bytes ? fmt::format("{:.1f}", static_cast<double>(*bytes) / 1048576)
                                    : "not measurable");
        rows.back().push_back(bytes ? fmt::format("{:.0f}", static_cast<double>(*bytes) /
                                                                static_cast<double>(c.poses))
                                    : "");
      }
      rows.back().resize(8);
    }
  }
  return table({"data set", "threads", "mapjoin, MiB", "bytes a pose", "CHOLMOD, MiB",
                "bytes a pose", "Ceres, MiB", "bytes a pose"},
               rows);
}

/// Others' seconds on their machine, and ours as they would be there if CHOLMOD is the measure.
std::string others(std::span<const Comparison> comparisons) {
  Rows rows;
  for (const Comparison& c : comparisons) {
    const auto p = published(c.name, c.local_maps);
    if (!p || p->cholmod <= 0.0 || c.threads.empty()) continue;
    std::string here = "", one = "", two = "";
    double scale = 0.0;
    for (const ThreadFigures& t : c.threads) {
      if (t.threads == 1) {
        scale = p->cholmod / t.once().seconds();
        here = seconds(t.once().seconds());
        one = seconds(t.join.seconds() * scale);
      }
      if (t.threads == 2 && scale > 0.0) two = seconds(t.join.seconds() * scale);
    }
    rows.push_back({label(c), here, seconds(p->cholmod), one, known_seconds(p->g2o), two,
                    known_seconds(p->gtsam), known_seconds(p->se_sync)});
  }
  if (rows.empty()) return {};
  return "## Against published times\n\nSeconds of others on another machine, quoted; those of "
         "mapjoin here times the ratio of\nCHOLMOD there to CHOLMOD here, one thread. The others "
         "were given initial values.\n\n" +
         table({"data set", "CHOLMOD here", "CHOLMOD there", "mapjoin, 1 thread", "g2o, 1 thread",
                "mapjoin, 2 threads", "GTSAM, 2 threads", "SE-Sync"},
               rows);
}

}  // namespace

std::string label(const Comparison& c) { return c.name + (c.local_maps ? " (local maps)" : ""); }

std::string table(const std::vector<std::string>& head, const Rows& rows) {
  std::string out = fmt::format("| {} |\n|", fmt::join(head, " | "));
  for (std::size_t k = 0; k < head.size(); ++k) out += k == 0 ? "---|" : "---:|";
  out += "\n";
  for (const auto& row : rows) out += fmt::format("| {} |\n", fmt::join(row, " | "));
  return out + "\n";
}

std::string seconds(double s) {
  const int decimals = s > 0.0 ? std::max(0, 2 - static_cast<int>(std::floor(std::log10(s)))) : 0;
  return fmt::format("{:.{}f}", s, std::min(decimals, 6));
}

std::string markdown(std::span<const Comparison> comparisons, const ComparisonOptions& options) {
  if (comparisons.empty()) return {};
  return fmt::format(
             "## Seconds from measurements in memory to the optimum\n\n"
             "Without initial values, against one factorisation (ordering, analysis, numbers, "
             "solve) of the\nfinal information matrix by CHOLMOD's fastest variant with at most so "
             "many threads, and Ceres\nfrom a spanning tree, stopped as soon as it is there. "
             "Medians of {} rounds, those of\njoins without the information of {}, all data sets "
             "in turn in each, after one run more of everybody whom it\ntakes less than two "
             "seconds: minutes in which the machine is slow cost everybody a round and nobody "
             "all.\nWho takes less than {:g} s runs as often as fits into them, and the median of "
             "these runs counts for the round.\nWhat one frees stays in the process for the next, "
             "so nobody pays for fresh pages. BLAS is `{}`.\n"
             "*Times as fast as one* is the median of the rounds, in which both are neighbours; "
             "*two joins "
             "at once*,\non a thread each and sharing nothing but the machine, are so many times "
             "as fast "
             "as one after the\nother: what its processors give at that time to who never "
             "waits.\n\n",
             options.repeat, options.repeat * (1 + options.between), options.round, blas_in_use()) +
         ratios(comparisons) + "## By phase\n\n" + phases(comparisons) + "## Checks\n\n" +
         checks(comparisons) + others(comparisons) +
         "## Peak memory\n\nBeyond the measurements and whatever else was in use before the "
         "run.\n\n" +
         memory(comparisons);
}

}  // namespace mapjoin::benchmarks
