#include "mapjoin/association/sessions.h"

#include <fmt/format.h>

#include <optional>

#include "mapjoin/graph/error.h"
#include "mapjoin/graph/rename_keys.h"
#include "mapjoin/joining/join.h"
#include "mapjoin/joining/report.h"

namespace mapjoin {

namespace {

/// In the frame of what they share by key; nothing where that is too little.
template <int D>
std::optional<ComparedMaps<D>> compared(const Map<D>& a, const Map<D>& b) {
  try {
    return in_common_frame(a, b);
  } catch (const DisconnectedError&) {
    return std::nullopt;
  }
}

void add_up(const Association& found, std::size_t map, AssociationReport& report) {
  report.matches += static_cast<std::int64_t>(found.matches.size());
  report.sightings += static_cast<std::int64_t>(found.matches.size() + found.unmatched.size());
  report.variables += static_cast<std::int64_t>(found.unmatched.size());
  report.ambiguous += found.ambiguous();
  report.doubtful += static_cast<std::int64_t>(found.doubtful.size());
  report.suspicious += found.suspicious();
  report.cut_short += found.complete ? 0 : 1;
  for (const Match& match : found.matches) {
    if (!match.suspicious) continue;
    report.warnings.push_back(fmt::format(
        "map {}: {} and {} do not agree with the rest that is common (chi2 {:.1f}, bound {:.1f})",
        map + 1, to_string(match.a), to_string(match.b), match.chi2, match.bound));
  }
}

}  // namespace

template <int D>
AssociatedSessions<D> associate_sessions(std::span<const Map<D>> maps,
                                         const AssociationOptions& options,
                                         const ConstellationOptions& constellations) {
  const auto start = Clock::now();
  AssociatedSessions<D> out;
  if (maps.empty()) return out;
  std::vector<Map<D>> joined{maps[0]};  // the groups that have been found to belong together
  out.maps.push_back(maps[0]);
  for (std::size_t k = 1; k < maps.size(); ++k) {
    std::string reasons;
    bool placed = false;
    for (Map<D>& before : joined) {
      try {
        const auto frame = compared(before, maps[k]);
        const Association found =
            frame ? associate<D>(*frame, options)
                  : associate_unplaced(before, maps[k], options, constellations);
        out.maps.push_back(rename_keys(maps[k], Renaming(names_in_a(found))));
        before = join(before, out.maps.back());
        add_up(found, k, out.report);
        placed = true;
        break;
      } catch (const DisconnectedError& error) {
        reasons += fmt::format("{}{}", reasons.empty() ? "" : "; ", error.what());
      }
    }
    if (placed) continue;
    out.report.warnings.push_back(
        fmt::format("map {} stays apart from those before it: {}", k + 1, reasons));
    out.maps.push_back(maps[k]);
    joined.push_back(maps[k]);
  }
  out.report.seconds = seconds_since(start);
  return out;
}

#define MAPJOIN_INSTANTIATE(D)                          \
  template AssociatedSessions<D> associate_sessions<D>( \
      std::span<const Map<D>>, const AssociationOptions&, const ConstellationOptions&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
