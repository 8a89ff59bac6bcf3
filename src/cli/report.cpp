#include "mapjoin/cli/report.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "mapjoin/cli/terminal.h"
#include "mapjoin/joining/process_memory.h"

namespace mapjoin::cli {

namespace {

std::string solves(int n) { return fmt::format("{} linear solve{}", n, n == 1 ? "" : "s"); }

std::string_view tree_name(const RunReport& r) {
  return join_options(r.arguments).tree == TreeShape::kOrder ? "order" : "graph";
}

constexpr std::size_t kMostWarnings = 10;  // in words; all of them are in the JSON

template <class Line>
void describe(const AssociationSummary& a, const Line& line) {
  const AssociationReport& r = a.report;
  if (a.matcher == "given") {
    line("matches",
         fmt::format("{} given, {} do not agree with the others", r.matches, r.suspicious));
  } else {
    line("association",
         fmt::format("{}: {} sightings of {} features", a.matcher, r.sightings, r.variables));
    line("matches", fmt::format("{}, {} of them ambiguous; {} features not clearly new; {} do not "
                                "agree with the others",
                                r.matches, r.ambiguous, r.doubtful, r.suspicious));
  }
  if (r.cut_short > 0)
    line("warning",
         fmt::format("the search for joint compatibility was cut short in {} joins", r.cut_short));
  for (std::size_t k = 0; k < r.warnings.size() && k < kMostWarnings; ++k)
    line("warning", r.warnings[k]);
  if (r.warnings.size() > kMostWarnings)
    line("warning",
         fmt::format("and {} more like it: see --json", r.warnings.size() - kMostWarnings));
  if (a.score)
    line("judged", fmt::format("precision {:.5f}, recall {:.5f}, by pairs of sightings",
                               a.score->precision(), a.score->recall()));
}

nlohmann::ordered_json to_json(const AssociationSummary& a) {
  const AssociationReport& r = a.report;
  nlohmann::ordered_json out;
  out["matcher"] = a.matcher;
  if (a.matcher != "given") {
    out["sightings"] = r.sightings;
    out["features"] = r.variables;
    out["ambiguous"] = r.ambiguous;
    out["doubtful"] = r.doubtful;
    out["cut_short"] = r.cut_short;
  }
  out["matches"] = r.matches;
  out["suspicious"] = r.suspicious;
  out["warnings"] = r.warnings;
  out["seconds"] = r.seconds;
  if (a.score) {
    out["precision"] = a.score->precision();
    out["recall"] = a.score->recall();
  }
  return out;
}

}  // namespace

std::string text(const RunReport& r) {
  std::string out;
  const auto line = [&](const std::string& head, const std::string& body) {
    const std::string padded = fmt::format("{:<14}", head);
    out += fmt::format("{}{}\n", bold(padded), body);
  };
  line("variables", fmt::format("{} poses, {} features", r.join.poses, r.join.features));
  line("measurements", fmt::format("{}", r.measurements));
  line("components",
       r.join.components == 1
           ? "1"
           : fmt::format("{}: nothing links them, each has a file of its own", r.join.components));
  const bool linear = r.arguments.method == "linear";
  if (linear) {
    line("mode", fmt::format("{}, {}, tree from the {}, {} joins", r.arguments.mode,
                             r.arguments.strategy == "dc" ? "divide and conquer" : "sequential",
                             tree_name(r), r.join.joins));
  } else {
    line("method", r.arguments.method);
  }
  if (r.join.resumed_joins > 0)
    line("resumed", fmt::format("{} joins were found in the checkpoint", r.join.resumed_joins));
  if (!linear && r.arguments.method != "ekf") {
    line("chi2", r.join.refine_solves > 0 ? fmt::format("{:.6f} (smoothed by {})", r.join.chi2,
                                                        solves(r.join.refine_solves))
                                          : fmt::format("{:.6f}", r.join.chi2));
  }
  if (r.association) describe(*r.association, line);
  if (linear) {
    line("chi2 linear", fmt::format("{:.6f} ({} a join, {} at the root)", r.join.chi2_linear,
                                    solves(r.join.solves_per_join), r.join.root_solves));
  }
  if (linear && r.arguments.mode == "optimal") {
    line("chi2 refined", fmt::format("{:.6f} ({})", r.join.chi2, solves(r.join.refine_solves)));
  }
  line("seconds", fmt::format("{:.3f} read, {:.3f} join, {:.3f} refine, {:.3f} write",
                              r.seconds.read, r.seconds.solve - r.join.seconds_refine,
                              r.join.seconds_refine, r.seconds.write));
  line("peak memory", fmt::format("{:.1f} MiB", static_cast<double>(peak_memory()) / 1048576));
  for (std::size_t k = 0; k < r.written.size(); ++k) {
    line("written", fmt::format("{} (frame of {})", r.written[k].string(), r.frames[k]));
  }
  if (r.arguments.mode == "optimal" && !r.join.minimum) {
    line("warning", "the refinement did not end in a minimum; the result is the best it found");
  }
  for (const std::string& note : r.join.notes) line("note", note);
  for (const std::string& note : r.notes) line("note", note);
  return out;
}

std::string json(const RunReport& r) {
  nlohmann::ordered_json out;
  out["method"] = r.arguments.method;
  out["chi2"] = r.join.chi2;
  out["chi2_linear"] = r.join.chi2_linear;
  out["solves_per_join"] = r.join.solves_per_join;
  out["root_solves"] = r.join.root_solves;
  out["refine_solves"] = r.join.refine_solves;
  out["poses"] = r.join.poses;
  out["features"] = r.join.features;
  out["components"] = r.join.components;
  out["seconds"] = {{"read", r.seconds.read},
                    {"solve", r.seconds.solve},
                    {"solve_processor", r.seconds.solve_processor},
                    {"refine", r.join.seconds_refine},
                    {"write", r.seconds.write}};
  out["peak_memory_bytes"] = peak_memory();
  out["measurements"] = r.measurements;
  out["joins"] = r.join.joins;
  out["redone_joins"] = r.join.redone_joins;
  out["resumed_joins"] = r.join.resumed_joins;
  out["minimum"] = r.join.minimum;
  out["mode"] = r.arguments.mode;
  out["tree"] = tree_name(r);
  out["strategy"] = r.arguments.strategy;
  out["threads"] = join_options(r.arguments).threads;
  out["frames"] = r.frames;
  out["outputs"] = nlohmann::json::array();
  for (const auto& path : r.written) out["outputs"].push_back(path.string());
  if (r.association) out["association"] = to_json(*r.association);
  out["notes"] = r.join.notes;
  for (const std::string& note : r.notes) out["notes"].push_back(note);
  return out.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

}  // namespace mapjoin::cli
