#include "mapjoin/association/associated_join.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "mapjoin/frames/anchors.h"
#include "mapjoin/graph/index.h"
#include "mapjoin/graph/rename_keys.h"
#include "mapjoin/joining/join.h"
#include "mapjoin/joining/report.h"

namespace mapjoin {

namespace {

/// Consecutive local maps, joined.
template <int D>
struct Stretch {
  int first = 0;
  int last = 0;
  Map<D> map;
};

std::string name_of(int first, int last) {
  return last - first == 1 ? fmt::format("local map {}", first + 1)
                           : fmt::format("local maps {} to {}", first + 1, last);
}

/// Walks the joins of a sequence: join_two(first, second) makes one stretch of two neighbours.
template <int D, class JoinTwo>
Map<D> walk(std::span<const LocalMap<D>> maps, Strategy strategy, const ProgressCallback& progress,
            JoinTwo&& join_two) {
  if (maps.empty()) throw InputError("there are no local maps: nothing to join");
  const auto n = static_cast<int>(maps.size());
  int done = 0;
  const auto join_checked = [&](Stretch<D> a, Stretch<D> b) {
    if (progress && !progress({"associate", static_cast<double>(done) / std::max(1, n - 1)}))
      throw CancelledError("cancelled while associating");
    ++done;
    try {
      return join_two(std::move(a), std::move(b));
    } catch (const DisconnectedError& error) {
      throw DisconnectedError(fmt::format("{} and {}: {}", name_of(a.first, a.last),
                                          name_of(b.first, b.last), error.what()));
    }
  };
  const auto leaf = [&](int k) { return Stretch<D>{k, k + 1, to_map(maps[at(k)])}; };
  if (strategy == Strategy::kSequential) {
    Stretch<D> all = leaf(0);
    for (int k = 1; k < n; ++k) all = join_checked(std::move(all), leaf(k));
    return std::move(all.map);
  }
  std::vector<Stretch<D>> level;
  for (int k = 0; k < n; ++k) level.push_back(leaf(k));
  while (level.size() > 1) {
    std::vector<Stretch<D>> next;
    for (std::size_t k = 0; k + 1 < level.size(); k += 2)
      next.push_back(join_checked(std::move(level[k]), std::move(level[k + 1])));
    if (level.size() % 2 == 1) next.push_back(std::move(level.back()));
    level = std::move(next);
  }
  return std::move(level[0].map);
}

/// Says in words that a pair of a join does not agree with the rest of it.
template <class NameOf>
void warn(AssociationReport& report, int first, int middle, int last, const Key& a, const Key& b,
          double chi2, double bound, const NameOf& name) {
  ++report.suspicious;
  report.warnings.push_back(fmt::format(
      "joining {} with {}: {} and {} do not agree with the rest that is common (chi2 {:.1f}, bound "
      "{:.1f})",
      name_of(first, middle), name_of(middle, last), name(a), name(b), chi2, bound));
}

/// What every sighting was found to be: follows matches, each of a key to one of an earlier map.
class Found {
 public:
  explicit Found(const std::vector<Sighting>& sightings) {
    for (const Sighting& s : sightings) names_.emplace_back(s.key, s.key);
  }
  void match(const Key& a, const Key& b) { entry(b).second = a; }
  /// The key that a chain of matches ends at.
  Key operator()(Key key) {
    Key end = key;
    while (entry(end).second != end) end = entry(end).second;
    while (key != end) key = std::exchange(entry(key).second, end);
    return end;
  }

 private:
  std::pair<Key, Key>& entry(const Key& key) {
    return *std::lower_bound(names_.begin(), names_.end(), key,
                             [](const auto& e, const Key& k) { return e.first < k; });
  }
  std::vector<std::pair<Key, Key>> names_;  // ascending
};

void add_up(const Association& found, AssociationReport& report) {
  report.matches += static_cast<std::int64_t>(found.matches.size());
  report.ambiguous += found.ambiguous();
  report.doubtful += static_cast<std::int64_t>(found.doubtful.size());
  report.cut_short += found.complete ? 0 : 1;
}

/// Final names: numbers from 1 in the order of first sightings.
template <int D>
void name_variables(const OwnKeys<D>& own, Found& found, AssociatedMaps<D>& out) {
  std::vector<std::pair<Key, Key>> numbered;  // of the first sightings; ascending
  for (const Sighting& s : own.sightings) {
    if (found(s.key) != s.key) continue;
    const auto number = static_cast<std::uint64_t>(numbered.size()) + 1;
    numbered.emplace_back(s.key, Key{s.key.type, s.key.session, number});
  }
  const Renaming final_name(numbered);
  std::vector<std::pair<Key, Key>> names;
  for (const Sighting& s : own.sightings) {
    out.sightings.push_back(s);
    out.names.push_back(final_name(found(s.key)));
    names.emplace_back(s.key, out.names.back());
  }
  const Renaming renaming(std::move(names));
  for (const LocalMap<D>& map : own.local_maps)
    out.local_maps.push_back(rename_keys(map, renaming));
  out.joined = rename_keys(out.joined, renaming);
  out.report.sightings = static_cast<std::int64_t>(own.sightings.size());
  out.report.variables = static_cast<std::int64_t>(numbered.size());
}

/// "point:5 of local map 3", by what the local map calls it.
std::string sighting_name(const std::vector<Sighting>& sightings, const Key& key) {
  const auto found = std::lower_bound(sightings.begin(), sightings.end(), key,
                                      [](const Sighting& s, const Key& k) { return s.key < k; });
  if (found == sightings.end() || found->key != key) return to_string(key);
  return fmt::format("{} of local map {}", to_string(found->original), found->local_map + 1);
}

}  // namespace

template <int D>
AssociatedMaps<D> join_associating(std::span<const LocalMap<D>> local_maps,
                                   const AssociationOptions& options, Strategy strategy,
                                   const ProgressCallback& progress) {
  const auto start = Clock::now();
  const OwnKeys<D> own = own_keys(local_maps, options.candidates);
  const auto name = [&](const Key& key) { return sighting_name(own.sightings, key); };
  Found names(own.sightings);
  AssociatedMaps<D> out;
  out.joined =
      walk<D>(own.local_maps, strategy, progress, [&](const Stretch<D>& a, const Stretch<D>& b) {
        const ComparedMaps<D> maps = in_common_frame(a.map, b.map);
        const Association found = associate<D>(maps, options);
        add_up(found, out.report);
        for (const TestedPair& pair : found.known) {
          if (pair.flagged)
            warn(out.report, a.first, a.last, b.last, pair.a, pair.b, pair.chi2, pair.bound, name);
        }
        for (const Match& match : found.matches) {
          names.match(match.a, match.b);
          if (match.suspicious)
            warn(out.report, a.first, a.last, b.last, match.a, match.b, match.chi2, match.bound,
                 name);
        }
        return Stretch<D>{a.first, b.last,
                          join(a.map, rename_keys(b.map, Renaming(names_in_a(found))))};
      });
  name_variables(own, names, out);
  out.report.seconds = seconds_since(start);
  return out;
}

template <int D>
AssociationReport check_given_matches(std::span<const LocalMap<D>> local_maps, double false_alarm,
                                      Strategy strategy, const ProgressCallback& progress) {
  const auto start = Clock::now();
  AssociationReport report;
  const auto name = [](const Key& key) { return to_string(key); };
  walk<D>(local_maps, strategy, progress, [&](const Stretch<D>& a, const Stretch<D>& b) {
    for (const TestedPair& pair : check_matches(a.map, b.map, false_alarm)) {
      ++report.matches;
      if (pair.flagged)
        warn(report, a.first, a.last, b.last, pair.a, pair.b, pair.chi2, pair.bound, name);
    }
    return Stretch<D>{a.first, b.last, join(a.map, b.map)};
  });
  report.seconds = seconds_since(start);
  return report;
}

#define MAPJOIN_INSTANTIATE(D)                                                                     \
  template AssociatedMaps<D> join_associating<D>(                                                  \
      std::span<const LocalMap<D>>, const AssociationOptions&, Strategy, const ProgressCallback&); \
  template AssociationReport check_given_matches<D>(std::span<const LocalMap<D>>, double,          \
                                                    Strategy, const ProgressCallback&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
