#include <fmt/format.h>

#include "mapjoin/association/associated_join.h"
#include "mapjoin/cli/input.h"
#include "mapjoin/cli/join_command.h"
#include "mapjoin/cli/progress.h"
#include "mapjoin/cli/run.h"
#include "mapjoin/cli/sequence.h"
#include "mapjoin/filtering/methods.h"
#include "mapjoin/frames/anchors.h"
#include "mapjoin/io/local_maps.h"
#include "mapjoin/joining/features_only.h"
#include "mapjoin/joining/join_all.h"

namespace mapjoin::cli {

AssociationOptions association_options(const std::string& matcher) {
  AssociationOptions options;
  if (matcher == "nn") options.matcher = Matcher::kNearest;
  if (matcher == "gnn") options.matcher = Matcher::kGlobal;
  return options;
}

AssociationOptions association_options(const JoinCommand& a) {
  AssociationOptions options = association_options(a.associate);
  options.candidates.gate = options.joint.gate = a.gate;
  options.odds = a.odds;
  options.candidates.max_distance = a.max_distance;
  return options;
}

namespace {

constexpr double kFalseAlarm = 0.01;  // of a join whose matches are all right

/// Which local maps each feature-only map is made of, by their numbers, and its frame.
template <int D>
std::string merged_list(const FeatureOnlyMaps<D>& features, int first_number) {
  std::string out = "map,first,last,frame\n";
  for (std::size_t k = 0; k < features.maps.size(); ++k) {
    out +=
        fmt::format("{},{},{},\"{}\"\n", k + 1, features.first[k] + first_number,
                    features.first[k + 1] - 1 + first_number, to_string(features.maps[k].anchor));
  }
  return out;
}

template <int D>
std::string note_of(const FeatureOnlyMaps<D>& features) {
  int merged = 0;
  for (std::size_t k = 0; k < features.maps.size(); ++k) merged += features.parts(k) > 1 ? 1 : 0;
  return fmt::format(
      "{} feature-only maps of {} local maps: {} are made of several, joined with their poses, "
      "because neighbours shared too few features",
      features.maps.size(), features.first.back(), merged);
}

template <int D>
void join_features(const JoinCommand& a, const LocalMapSet<D>& set, Job job) {
  const Stopwatch marginalizing;
  const FeatureOnlyMaps<D> features = features_only(std::span<const LocalMap<D>>(set.maps));
  job.read_seconds += marginalizing.seconds();
  job.measurements = static_cast<std::int64_t>(features.maps.size());
  job.notes.push_back(note_of(features));
  std::vector<const VariableSet<D>*> sets;
  for (const Map<D>& map : features.maps) sets.push_back(&map.variables());
  run<D>(std::move(job), unite<D>(sets), [&](const JoinOptions& o) {
    return join_all(std::span<const Map<D>>(features.maps), {}, o);
  });
  if (!a.merged_list.empty()) {
    OutputFiles list;
    list.write_text(a.merged_list, merged_list(features, set.first_number));
    list.commit();
  }
}

/// The variables that a method's map has.
template <int D>
VariableSet<D> variables_of(Method method, const VariableSet<D>& all,
                            const std::vector<LocalMap<D>>& maps) {
  if (keeps_poses(method)) return all;
  std::vector<int> kept;
  for (int i = 0; i < all.size(); ++i) {
    const Key& key = all.key(i);
    if (key.type != Tag("pose") || key == maps.front().anchor.keys[0]) kept.push_back(i);
  }
  return subset(all, kept);
}

/// What a filter did, in the words of a report.
std::string note_of(const FilterReport& report) {
  const Fusion sum = report.total();
  return fmt::format(
      "{} maps fused, the state reordered {} times; {} scalars, {} non-zeros of the information "
      "matrix; seconds: {:.3f} adding, {:.3f} ordering, {:.3f} factorising, {:.3f} recovering the "
      "estimate",
      report.fusions.size(), report.reordered(), report.scalars, report.nonzeros,
      sum.seconds_update, sum.seconds_order, sum.seconds_factor, sum.seconds_recover);
}

template <int D>
JoinResult<D> join_by_filter(Method method, const LocalMapSet<D>& set, const JoinOptions& options) {
  MethodOptions all;
  all.join.progress = options.progress;
  FilterResult<D> result = join_by(method, std::span<const LocalMap<D>>(set.maps), all);
  JoinResult<D> out;
  out.report.chi2 = out.report.chi2_linear = result.report.chi2;
  out.report.refine_solves = result.report.refine_solves;
  out.report.seconds_refine = result.report.seconds_refine;
  out.report.minimum = result.report.minimum;
  out.report.joins = static_cast<int>(result.report.fusions.size()) - 1;
  for (const auto& column : result.map.variables().columns()) {
    (column.kind->tag == Tag("pose") ? out.report.poses : out.report.features) += column.size();
  }
  out.report.notes.push_back(note_of(result.report));
  out.maps.push_back(std::move(result.map));
  return out;
}

/// Finds out which features of the local maps are the same, or tests what their names say.
template <int D>
void associate(const JoinCommand& a, LocalMapSet<D>& set, Job& job) {
  const bool find = a.associate != "given";
  if (!find && !a.check_matches) return;
  const Interruptible interruptible;
  ProgressBar bar;
  const Strategy strategy = join_options(a.join).strategy;
  AssociationSummary summary{a.associate, {}, {}};
  if (!find) {
    summary.report = check_given_matches<D>(set.maps, kFalseAlarm, strategy, bar.callback());
  } else {
    AssociatedMaps<D> found =
        join_associating<D>(set.maps, association_options(a), strategy, bar.callback());
    if (a.judge) {
      std::vector<Key> named;
      for (const Sighting& sighting : found.sightings) named.push_back(sighting.original);
      summary.score = score(found.names, named);
    }
    set.maps = std::move(found.local_maps);
    summary.report = std::move(found.report);
  }
  job.association = std::move(summary);
}

}  // namespace

void join_local_maps(const JoinCommand& a) {
  if (!a.links.empty()) {
    throw InputError("--links goes with native maps: join the folder into a .map first");
  }
  const Stopwatch reading;
  LocalMapOptions options;
  options.session = a.join.session;
  options.indefinite = information_policy(a.join.indefinite);
  AnyLocalMapSet any = read_sequence(a.inputs[0], options);
  std::visit(
      [&]<int D>(LocalMapSet<D>& set) {
        Job job{a.join, reading.seconds(), static_cast<std::int64_t>(set.maps.size()), {}, true,
                {}};
        G2oCounts counts;
        counts.repaired = set.repaired;
        job.notes = notes_of(counts);
        associate(a, set, job);
        if (a.features_only) return join_features(a, set, std::move(job));
        MeasurementGraphBuilder<D> builder;  // for the variables alone
        for (const LocalMap<D>& map : set.maps) builder.add(map);
        const VariableSet<D> variables = std::move(builder).build().variables;
        if (const Method method = parse_method(a.join.method); method != Method::kLinear) {
          return run<D>(std::move(job), variables_of(method, variables, set.maps),
                        [&](const JoinOptions& o) { return join_by_filter(method, set, o); });
        }
        run<D>(std::move(job), variables, [&](const JoinOptions& o) {
          return join_all(std::span<const LocalMap<D>>(set.maps), o);
        });
      },
      any);
}

}  // namespace mapjoin::cli
