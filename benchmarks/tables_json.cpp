#include <nlohmann/json.hpp>

#include "benchmarks/ceres_run.h"
#include "benchmarks/cholmod_run.h"
#include "benchmarks/join_run.h"
#include "benchmarks/published.h"
#include "benchmarks/tables.h"

namespace mapjoin::benchmarks {

namespace {

using Json = nlohmann::ordered_json;

Json figures(const Contender& c, std::span<const char* const> phase_names) {
  Json out;
  out["name"] = c.name;
  out["threads"] = c.threads;
  out["seconds"] = c.seconds();
  out["cpu_seconds"] = c.cpu_seconds();
  const std::vector<double> phases = c.phase_seconds();
  for (std::size_t p = 0; p < phases.size(); ++p) out["phases"][phase_names[p]] = phases[p];
  if (c.peak_bytes) out["peak_bytes"] = *c.peak_bytes;
  for (const Measured& run : c.runs) out["runs"].push_back({run.seconds(), run.cpu});
  return out;
}

Json figures(const ThreadFigures& t) {
  Json out;
  out["threads"] = t.threads;
  out["ratio"] = t.ratio();
  out["cpu_ratio"] = t.cpu_ratio();
  out["fastest_cholmod"] = t.once().name;
  out["once_seconds"] = t.once().seconds();
  out["mapjoin"] = figures(t.join, kJoinPhases);
  out["mapjoin_with_information"] = figures(t.with_information, kJoinPhases);
  for (const Contender& c : t.cholmod) out["cholmod"].push_back(figures(c, kCholmodPhases));
  if (!t.ceres.empty()) out["ceres"] = figures(t.ceres[0], kCeresPhases);
  return out;
}

Json figures(const Growth& g) {
  Json out;
  out["world"] = g.world;
  out["dimension"] = g.dimension;
  for (const GrowthStep& step : g.steps) {
    Json one;
    one["poses"] = step.poses;
    one["measurements"] = step.observations;
    one["error"] = step.error;
    one["reached"] = step.reached();
    for (const Contender& c : step.join) one["mapjoin"].push_back(figures(c, kJoinPhases));
    out["steps"].push_back(std::move(one));
  }
  for (std::size_t t = 0; t < g.threads.size(); ++t)
    out["powers"].push_back({{"threads", g.threads[t]}, {"power", g.power(t)}});
  return out;
}

Json figures(const Goal& goal) {
  return {{"data", goal.data},
          {"what", goal.what},
          {"value", goal.value},
          {goal.at_most ? "at_most" : "at_least", goal.limit},
          {"holds", goal.holds()}};
}

}  // namespace

std::string json(std::span<const Comparison> comparisons, std::span<const Growth> growths,
                 std::span<const Goal> goals, const ComparisonOptions& options) {
  Json out;
  out["repeat"] = options.repeat;
  out["round"] = options.round;
  out["blas"] = blas_in_use();
  out["data_sets"] = Json::array();
  for (const Comparison& c : comparisons) {
    Json one;
    one["name"] = c.name;
    one["local_maps"] = c.local_maps;
    one["dimension"] = c.dimension;
    one["poses"] = c.poses;
    one["features"] = c.features;
    one["measurements"] = c.observations;
    one["unknowns"] = c.factor_rows;
    one["chi2"] = c.chi2;
    one["optimum"] = c.optimum;
    one["optimum_from"] = c.optimum_from;
    one["reached"] = c.reached();
    one["joins"] = c.joins;
    one["redone_joins"] = c.redone_joins;
    one["refine_solves"] = c.refine_solves;
    if (!c.why_not_ceres.empty()) one["why_not_ceres"] = c.why_not_ceres;
    if (c.ceres_chi2 > 0.0) {
      one["ceres_chi2"] = c.ceres_chi2;
      one["ceres_iterations"] = c.ceres_iterations;
      one["ceres_reached"] = c.ceres_reached();
    }
    if (const auto p = published(c.name, c.local_maps); p && p->cholmod > 0.0) {
      one["published"]["cholmod"] = p->cholmod;
      if (p->g2o > 0.0) one["published"]["g2o"] = p->g2o;
      if (p->gtsam > 0.0) one["published"]["gtsam"] = p->gtsam;
      if (p->se_sync > 0.0) one["published"]["se_sync"] = p->se_sync;
    }
    for (const ThreadFigures& t : c.threads) {
      one["with_threads"].push_back(figures(t));
      if (t.threads == 1 || c.threads[0].threads != 1) continue;
      one["with_threads"].back()["times_as_fast"] = t.speed_up(c.threads[0]);
      one["with_threads"].back()["machine_times_as_fast"] = t.machine_speed_up(c.threads[0]);
    }
    out["data_sets"].push_back(std::move(one));
  }
  for (const Growth& g : growths) out["growth"].push_back(figures(g));
  out["goals"] = Json::array();
  for (const Goal& goal : goals) out["goals"].push_back(figures(goal));
  return out.dump(2) + "\n";
}

}  // namespace mapjoin::benchmarks
