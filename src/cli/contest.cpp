#include "mapjoin/cli/contest.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <map>
#include <set>
#include <string_view>
#include <utility>

#include "mapjoin/association/arrivals.h"
#include "mapjoin/building/ekf_slam.h"
#include "mapjoin/cli/progress.h"
#include "mapjoin/filtering/map_stream.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/joining/process_memory.h"

namespace mapjoin::cli {

namespace {

constexpr const char* kWholeRun = "ekf-slam";

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
  constexpr std::string_view kAnew = "slsjf:anew:";
  if (word.starts_with(kAnew)) {
    FilterOptions filter;
    const char* const end = word.data() + word.size();
    const auto read = std::from_chars(word.data() + kAnew.size(), end, filter.relinearise_every);
    if (read.ec != std::errc() || read.ptr != end || filter.relinearise_every < 1)
      throw InputError(fmt::format("'{}': after how many local maps? As in slsjf:anew:50", word));
    return {word, Method::kSlsjf, Mode::kOptimal, filter};
  }
  if (word == kWholeRun) return {word, Method::kEkf, Mode::kOptimal, {}, true};
  return {word, parse_method(word), Mode::kOptimal, {}};
}

}  // namespace

std::vector<Contestant> contestants(const std::string& list, bool recording) {
  std::vector<Contestant> out;
  if (list == "all") {
    for (const auto& linear : kLinearModes) out.push_back(contestant(linear.first));
    for (const Method method : kMethods) {
      if (method != Method::kLinear) out.push_back(contestant(std::string(name(method))));
    }
    if (recording) out.push_back(contestant(kWholeRun));
    return out;
  }
  std::size_t at = 0;
  while (at <= list.size()) {
    const std::size_t end = std::min(list.find(',', at), list.size());
    out.push_back(contestant(list.substr(at, end - at)));
    if (out.back().whole_run && !recording)
      throw InputError(
          "ekf-slam filters a recording, and local maps are none: give the recording and --segment "
          "instead of the folder of local maps");
    at = end + 1;
  }
  return out;
}

namespace {

template <int D>
FilterResult<D> filter_whole_run(const RawLog<D>& log, const ProgressCallback& progress) {
  SlamResult<D> slam = ekf_slam(log, progress);
  FilterResult<D> out;
  out.map = std::move(slam.map);
  for (const double seconds : slam.seconds) {
    Fusion fusion;
    fusion.seconds_factor = seconds;
    out.report.fusions.push_back(fusion);
  }
  out.report.scalars = out.map.variables().scalars() - kGauge<D>;
  out.report.nonzeros = static_cast<std::int64_t>(out.report.scalars) * out.report.scalars;
  return out;
}

/// Names that are judged by: of every variable of a stream's map, the number it first came with.
class Judge {
 public:
  /// `matched`: pairs of a local map's key and the map's.
  template <int D>
  void see(const LocalMap<D>& map, const MapStream<D>& stream, MatchScore& score) {
    std::map<Key, Key> names;
    for (const auto& [ours, theirs] : stream.renamed()) names[ours] = theirs;
    std::set<Key> matched;
    for (const auto& [ours, theirs] : stream.matched()) {
      matched.insert(ours);
      ++score.matches;
      score.right += came_as_[theirs] == ours ? 1 : 0;
    }
    for (const Key& key : map.keys) {
      if (key.type == Tag("pose")) continue;
      score.seen_before += seen_.insert(key).second ? 0 : 1;
      if (matched.count(key) > 0) continue;
      const auto renamed = names.find(key);
      came_as_[renamed == names.end() ? key : renamed->second] = key;
      if (renamed != names.end()) score.renamed.push_back(renamed->second);
    }
  }

 private:
  std::map<Key, Key> came_as_;
  std::set<Key> seen_;
};

StreamMethod stream_method(const Contestant& contestant) {
  if (contestant.whole_run ||
      (contestant.method != Method::kSlsjf && contestant.method != Method::kEkf))
    throw InputError("takes its features as they are numbered: leave --associate out");
  return contestant.method == Method::kSlsjf ? StreamMethod::kSlsjf : StreamMethod::kEkf;
}

template <int D>
FilterResult<D> join_arriving(const Contestant& contestant, std::span<const LocalMap<D>> maps,
                              const AssociationOptions& association,
                              const ProgressCallback& progress, MatchScore& score) {
  StreamOptions<D> options;
  options.method = stream_method(contestant);
  options.filter = contestant.filter;
  options.associate = associate_arrivals<D>(association);
  MapStream<D> stream(options);
  FilterResult<D> out;
  Judge judge;
  for (const LocalMap<D>& map : maps) {
    if (progress &&
        !progress({"fuse", static_cast<double>(stream.size()) / static_cast<double>(maps.size())}))
      throw CancelledError("cancelled while fusing local maps");
    out.report.fusions.push_back(stream.add(map));
    judge.see(map, stream, score);
  }
  out.map = stream.current();
  out.report.scalars = out.map.variables().scalars() - kGauge<D>;
  return out;
}

}  // namespace

template <int D>
Row<D> run_one(const Contestant& contestant, const Subject<D>& subject,
               const std::optional<AssociationOptions>& association) {
  Row<D> row;
  row.contestant = contestant;
  MethodOptions options;
  options.join.mode = contestant.mode;
  options.filter = contestant.filter;
  options.join.tree = contestant.mode == Mode::kPaper ? TreeShape::kOrder : TreeShape::kGraph;
  ProgressBar bar;
  options.join.progress = bar.callback();
  reset_peak_memory();
  const std::int64_t before = resident_memory();
  const Stopwatch clock;
  try {
    const std::span<const LocalMap<D>> maps(subject.maps);
    if (association) row.matches.emplace();
    row.result = association ? join_arriving(contestant, maps, *association, options.join.progress,
                                             *row.matches)
                 : contestant.whole_run ? filter_whole_run(*subject.log, options.join.progress)
                                        : join_by(contestant.method, maps, options);
  } catch (const CancelledError&) {
    throw;
  } catch (const Error& error) {  // a method that cannot join these maps says so in its row
    row.failure = error.what();
  }
  row.seconds = clock.seconds();
  row.memory = std::max<std::int64_t>(0, peak_memory() - before);
  return row;
}

template Row<2> run_one<2>(const Contestant&, const Subject<2>&,
                           const std::optional<AssociationOptions>&);
template Row<3> run_one<3>(const Contestant&, const Subject<3>&,
                           const std::optional<AssociationOptions>&);

}  // namespace mapjoin::cli
