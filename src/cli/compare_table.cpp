#include "mapjoin/cli/compare_table.h"

#include <fmt/format.h>

#include <utility>

namespace mapjoin::cli {

namespace {

std::string cell(bool there, double value, int digits) {
  return there ? fmt::format("{:.{}f}", value, digits) : std::string("-");
}

double part(std::int64_t some, std::int64_t all) {
  return static_cast<double>(some) / static_cast<double>(all);
}

/// "chi2" of what is measured from poses needs the poses.
template <int D>
bool has_chi2(const Row<D>& row) {
  return row.failure.empty() && row.contestant.method != Method::kEkf && !row.matches;
}

}  // namespace

template <int D>
std::string text(const std::vector<Row<D>>& rows, bool with_truth, bool associated) {
  std::string out =
      fmt::format("{:<15}{:>14}{:>10}{:>10}{:>10}", "method", "chi2", "poses", "features", "fit");
  if (with_truth) out += fmt::format("{:>12}{:>20}{:>9}", "NEES", "95% between", "2 sigma");
  if (associated) out += fmt::format("{:>10}{:>9}{:>9}", "precision", "recall", "assoc");
  out += fmt::format("{:>9}{:>9}{:>9}{:>9}{:>9}{:>9}{:>9}\n", "add", "order", "factor", "recover",
                     "refine", "seconds", "MiB");
  for (const Row<D>& row : rows) {
    out += fmt::format("{:<15}", row.contestant.label);
    if (!row.failure.empty()) {
      out += fmt::format("  {}\n", row.failure);
      continue;
    }
    const Deviation d = row.deviation.value_or(Deviation());
    const FilterReport& report = row.result.report;
    out += fmt::format("{:>14}{:>10}{:>10}{:>10}", cell(has_chi2(row), report.chi2, 4),
                       cell(d.poses > 1, d.pose_rmse, 4),
                       cell(d.poses > 0 && d.features > 0, d.feature_rmse, 4),
                       cell(d.features > 0, d.aligned_feature_rmse, 4));
    if (with_truth) {
      const Consistency c = row.consistency.value_or(Consistency());
      out += fmt::format("{:>12}{:>20}", cell(row.consistency.has_value(), c.nees, 1),
                         row.consistency ? fmt::format("{:.1f}..{:.1f}", c.lower, c.upper) : "-");
      out += fmt::format(
          "{:>9}", cell(row.coverage.has_value(), row.coverage.value_or(Coverage()).share(), 3));
    }
    const Fusion sum = report.total();
    if (associated) {
      const MatchScore m = row.matches.value_or(MatchScore());
      out += fmt::format("{:>10}{:>9}{:>9.3f}", cell(m.matches > 0, part(m.right, m.matches), 4),
                         cell(m.seen_before > 0, part(m.right, m.seen_before), 4),
                         sum.seconds_associate);
    }
    out += fmt::format("{:>9.3f}{:>9.3f}{:>9.3f}{:>9.3f}{:>9.3f}{:>9.3f}{:>9.1f}\n",
                       sum.seconds_update, sum.seconds_order, sum.seconds_factor,
                       sum.seconds_recover, report.seconds_refine, row.seconds,
                       static_cast<double>(row.memory) / 1048576.0);
  }
  return out;
}

template <int D>
nlohmann::ordered_json json(const Row<D>& row) {
  nlohmann::ordered_json out;
  out["method"] = row.contestant.label;
  out["seconds"] = row.seconds;
  if (!row.failure.empty()) {
    out["failure"] = row.failure;
    return out;
  }
  const FilterReport& report = row.result.report;
  if (has_chi2(row)) out["chi2"] = report.chi2;
  if (row.deviation && row.deviation->poses > 1) out["pose_rmse"] = row.deviation->pose_rmse;
  if (row.deviation && row.deviation->features > 0) {
    if (row.deviation->poses > 0) out["feature_rmse"] = row.deviation->feature_rmse;
    out["aligned_feature_rmse"] = row.deviation->aligned_feature_rmse;
  }
  if (row.consistency) {
    out["nees"] = row.consistency->nees;
    out["dimension"] = row.consistency->dimension;
    out["lower"] = row.consistency->lower;
    out["upper"] = row.consistency->upper;
  }
  if (row.coverage) out["within_2_sigma"] = row.coverage->share();
  const Fusion sum = report.total();
  out["seconds_by_step"] = {{"add", sum.seconds_update},
                            {"order", sum.seconds_order},
                            {"factor", sum.seconds_factor},
                            {"recover", sum.seconds_recover},
                            {"refine", report.seconds_refine}};
  if (row.matches) {
    out["seconds_by_step"]["associate"] = sum.seconds_associate;
    out["matches"] = row.matches->matches;
    out["right_matches"] = row.matches->right;
    out["seen_before"] = row.matches->seen_before;
  }
  out["memory_bytes"] = row.memory;
  out["scalars"] = report.scalars;
  if (report.nonzeros > 0) out["information_nonzeros"] = report.nonzeros;
  if (report.factor_nonzeros > 0) out["factor_nonzeros"] = report.factor_nonzeros;
  if (report.refine_solves > 0) out["refine_solves"] = report.refine_solves;
  out["minimum"] = report.minimum;
  nlohmann::ordered_json seconds = nlohmann::ordered_json::array();
  for (const Fusion& fusion : report.fusions) seconds.push_back(fusion.seconds());
  out[row.contestant.whole_run ? "seconds_per_pose" : "seconds_per_map"] = std::move(seconds);
  for (const Watched<D>& watched : row.watched) {
    auto& rows = out["watched"][to_string(watched.key)] = nlohmann::ordered_json::array();
    for (const Sight<D>& sight : watched.sights) {
      rows.push_back(nlohmann::ordered_json::array({sight.time}));
      for (const Vec<D>& v : {sight.estimate, sight.sigma}) {
        for (int s = 0; s < D; ++s) rows.back().push_back(v(s));
      }
    }
  }
  if (!report.fusions.empty() && !row.contestant.whole_run) out["reordered"] = report.reordered();
  return out;
}

template std::string text<2>(const std::vector<Row<2>>&, bool, bool);
template std::string text<3>(const std::vector<Row<3>>&, bool, bool);
template nlohmann::ordered_json json<2>(const Row<2>&);
template nlohmann::ordered_json json<3>(const Row<3>&);

}  // namespace mapjoin::cli
