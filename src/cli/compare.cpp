#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "mapjoin/cli/arguments.h"
#include "mapjoin/cli/commands.h"
#include "mapjoin/cli/input.h"
#include "mapjoin/cli/output.h"
#include "mapjoin/cli/progress.h"
#include "mapjoin/cli/truth.h"
#include "mapjoin/evaluation/consistency.h"
#include "mapjoin/evaluation/evaluate.h"
#include "mapjoin/filtering/methods.h"
#include "mapjoin/io/local_maps.h"
#include "mapjoin/joining/memory_limit.h"

namespace mapjoin::cli {

namespace {

constexpr const char* kExamples = R"(Methods:
  linear:paper, linear:summary, linear:observe, linear:optimal
            Linear SLAM, by divide and conquer; 'linear' is the last. See 'mapjoin join --help'
  slsjf     Sparse Local Submap Joining Filter; islsjf: smoothed at the end (I-SLSJF);
            slsjf:amd ordered by minimum degree alone, slsjf:whole factorised whole at every map
            (these two only where they are named)
  dslam     D-SLAM map joining: features alone; idslam: iterated (I-DMJ)
  ekf       map joining by a dense extended Kalman filter
Columns: chi2 over all local maps (of dslam and idslam over feature-only ones); RMSE of poses and of
features to the reference, in metres per coordinate, both maps in the frame of their lowest common
pose, and of features after the best rigid fit; NEES against the truth, and the bounds that a
consistent map's lies between with 95% probability; seconds of initialising and adding, ordering,
factorising, recovering the estimate, refining, and in all; the memory it took.
Without --reference, methods are held against islsjf or linear:optimal, and dslam against idslam,
where those are among them.

Examples:
  mapjoin compare victoria_park_200
  mapjoin compare simu_8240_50 --methods slsjf,ekf,linear:optimal --truth beacons_true.csv
  mapjoin compare dlr_200 --methods all --reference dlr_200_optimum.g2o --json table.json
)";

struct Arguments {
  std::string folder;
  std::string methods = "all";
  std::string truth;
  std::string reference;
  std::string json;
  std::string indefinite = "refuse";
  std::uint32_t session = 0;
};

/// A method and, of linear joining, its mode.
struct Contestant {
  std::string label;
  Method method = Method::kLinear;
  Mode mode = Mode::kOptimal;
  FilterOptions filter = {};
};

constexpr std::pair<const char*, Mode> kLinearModes[] = {{"linear:paper", Mode::kPaper},
                                                         {"linear:summary", Mode::kSummary},
                                                         {"linear:observe", Mode::kObserve},
                                                         {"linear:optimal", Mode::kOptimal}};

/// \throws InputError when there is no such method.
Contestant contestant(const std::string& word) {
  for (const auto& [label, mode] : kLinearModes) {
    if (word == label) return {word, Method::kLinear, mode, {}};
  }
  if (word == "slsjf:amd") {
    FilterOptions filter;
    filter.ordering = FilterOrdering::kMinimumDegree;
    return {word, Method::kSlsjf, Mode::kOptimal, filter};
  }
  if (word == "slsjf:whole") {
    FilterOptions filter;
    filter.incremental = false;
    return {word, Method::kSlsjf, Mode::kOptimal, filter};
  }
  return {word, parse_method(word), Mode::kOptimal, {}};
}

std::vector<Contestant> contestants(const std::string& list) {
  std::vector<Contestant> out;
  if (list == "all") {
    for (const auto& linear : kLinearModes) out.push_back(contestant(linear.first));
    for (const Method method : kMethods) {
      if (method != Method::kLinear) out.push_back(contestant(std::string(name(method))));
    }
    return out;
  }
  std::size_t at = 0;
  while (at <= list.size()) {
    const std::size_t end = std::min(list.find(',', at), list.size());
    out.push_back(contestant(list.substr(at, end - at)));
    at = end + 1;
  }
  return out;
}

/// Bytes that the process holds at most from now on, where the system can tell.
void forget_peak() { std::ofstream("/proc/self/clear_refs") << "5"; }
std::int64_t peak_since() {
  std::ifstream in("/proc/self/status");
  std::string word;
  while (in >> word) {
    std::int64_t kilobytes = 0;
    if (word == "VmHWM:" && in >> kilobytes) return kilobytes * 1024;
  }
  return peak_memory();
}

template <int D>
struct Row {
  Contestant contestant;
  FilterResult<D> result;
  double seconds = 0.0;
  std::int64_t memory = 0;
  std::optional<Deviation> deviation;
  std::optional<Consistency> consistency;
  std::string failure;  ///< what stopped it
};

template <int D>
Row<D> run_one(const Contestant& contestant, std::span<const LocalMap<D>> maps) {
  Row<D> row;
  row.contestant = contestant;
  MethodOptions options;
  options.join.mode = contestant.mode;
  options.filter = contestant.filter;
  options.join.tree = contestant.mode == Mode::kPaper ? TreeShape::kOrder : TreeShape::kGraph;
  ProgressBar bar;
  options.join.progress = bar.callback();
  forget_peak();
  const std::int64_t before = resident_memory();
  const Stopwatch clock;
  try {
    row.result = join_by(contestant.method, maps, options);
  } catch (const CancelledError&) {
    throw;
  } catch (const Error& error) {  // a method that cannot join these maps says so in its row
    row.failure = error.what();
  }
  row.seconds = clock.seconds();
  row.memory = std::max<std::int64_t>(0, peak_since() - before);
  return row;
}

bool features_alone(Method method) { return method == Method::kDslam || method == Method::kIdslam; }

/// What a row is held against: the given reference, else the row of the same problem's optimum.
template <int D>
const Values<D>* reference_of(const Row<D>& row, const std::vector<Row<D>>& rows,
                              const std::optional<Values<D>>& given) {
  if (given) return &*given;
  const auto is_optimum = [&](const Row<D>& other) {
    if (!other.failure.empty()) return false;
    if (features_alone(row.contestant.method)) return other.contestant.method == Method::kIdslam;
    return other.contestant.method == Method::kIslsjf ||
           (other.contestant.method == Method::kLinear && other.contestant.mode == Mode::kOptimal);
  };
  const auto found = std::find_if(rows.begin(), rows.end(), is_optimum);
  return found == rows.end() ? nullptr : &found->result.map.values;
}

std::string cell(bool there, double value, int digits) {
  return there ? fmt::format("{:.{}f}", value, digits) : std::string("-");
}

/// "chi2" of what is measured from poses needs the poses.
template <int D>
bool has_chi2(const Row<D>& row) {
  return row.failure.empty() && row.contestant.method != Method::kEkf;
}

template <int D>
std::string text(const std::vector<Row<D>>& rows, bool with_truth) {
  std::string out =
      fmt::format("{:<15}{:>14}{:>10}{:>10}{:>10}", "method", "chi2", "poses", "features", "fit");
  if (with_truth) out += fmt::format("{:>12}{:>20}", "NEES", "95% between");
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
    }
    const Fusion sum = report.total();
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
  const Fusion sum = report.total();
  out["seconds_by_step"] = {{"add", sum.seconds_update},
                            {"order", sum.seconds_order},
                            {"factor", sum.seconds_factor},
                            {"recover", sum.seconds_recover},
                            {"refine", report.seconds_refine}};
  out["memory_bytes"] = row.memory;
  out["scalars"] = report.scalars;
  if (report.nonzeros > 0) out["information_nonzeros"] = report.nonzeros;
  if (report.factor_nonzeros > 0) out["factor_nonzeros"] = report.factor_nonzeros;
  if (report.refine_solves > 0) out["refine_solves"] = report.refine_solves;
  out["minimum"] = report.minimum;
  out["seconds_per_map"] = nlohmann::json::array();
  for (const Fusion& fusion : report.fusions) out["seconds_per_map"].push_back(fusion.seconds());
  if (!report.fusions.empty()) out["reordered"] = report.reordered();
  return out;
}

template <int D>
void compare_maps(const Arguments& a, const LocalMapSet<D>& set) {
  const Interruptible interruptible;
  std::optional<Values<D>> reference;
  std::vector<Row<D>> rows;
  for (const Contestant& contestant : contestants(a.methods)) {
    rows.push_back(run_one<D>(contestant, set.maps));
    Row<D>& row = rows.back();
    if (!row.failure.empty()) continue;
    if (!a.reference.empty() && !reference) {
      const AnyValues any = read_solution(a.reference, a.session, row.result.map.variables());
      const auto* const values = std::get_if<Values<D>>(&any);
      if (values == nullptr)
        throw InputError(
            fmt::format("{} is {}D but the local maps are {}D", a.reference, 5 - D, D));
      reference = *values;
    }
    if (!a.truth.empty())
      row.consistency = consistency(row.result.map, read_truth(a.truth, row.result.map));
  }
  for (Row<D>& row : rows) {
    const Values<D>* const held = reference_of(row, rows, reference);
    if (row.failure.empty() && held != nullptr)
      row.deviation = deviation(row.result.map.values, *held);
  }
  if (!a.json.empty()) {
    nlohmann::ordered_json all = nlohmann::ordered_json::array();
    for (const Row<D>& row : rows) all.push_back(json(row));
    OutputFiles files;
    files.write_text(a.json, all.dump(2) + "\n");
    files.commit();
  }
  fmt::print("{}", text(rows, !a.truth.empty()));
}

void compare(const Arguments& a) {
  contestants(a.methods);  // are there such methods? Before anything takes long.
  if (!a.json.empty()) OutputFiles::expect(a.json);
  if (input_format(a.folder) != InputFormat::kLocalMaps)
    throw InputError(fmt::format("{} is no folder of local maps (localmap_1.txt, ...)", a.folder));
  for (const std::string& path : {a.truth, a.reference}) {
    if (!path.empty()) input_format(path);  // is it there?
  }
  LocalMapOptions options;
  options.session = a.session;
  options.indefinite = information_policy(a.indefinite);
  std::visit([&]<int D>(const LocalMapSet<D>& set) { compare_maps(a, set); },
             read_local_maps(a.folder, options));
}

}  // namespace

void add_compare(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  Arguments& a = *arguments;
  CLI::App& command =
      *app.add_subcommand("compare", "Join local maps by several methods, side by side");
  command.add_option("folder", a.folder, "A folder of localmap_K.txt")
      ->type_name("FOLDER")
      ->required();
  command.add_option("--methods", a.methods, "all, or names separated by commas; see below")
      ->capture_default_str();
  command
      .add_option(
          "--truth", a.truth,
          "What is known to be true: .g2o, .map, or a .csv of features (id,x,y) in the frame "
          "of the first local map")
      ->type_name("FILE");
  command.add_option("--reference", a.reference, "A solution to measure RMSE to, .g2o or .map")
      ->type_name("FILE");
  command
      .add_option("--json", a.json,
                  "Write the figures to this file as well, and more: seconds of every local map, "
                  "sizes and non-zeros of the information matrix")
      ->type_name("FILE");
  command.add_option("--session", a.session, "Session of ids that are written without one")
      ->type_name("N");
  add_indefinite_argument(command, a.indefinite);
  add_examples(command, kExamples);
  command.callback([arguments] { compare(*arguments); });
}

}  // namespace mapjoin::cli
