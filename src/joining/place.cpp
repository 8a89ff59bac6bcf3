#include "mapjoin/joining/place.h"

#include <algorithm>
#include <cstring>
#include <optional>

#include "mapjoin/frames/align.h"

namespace mapjoin {

namespace {

/// Which pieces hold each variable that more than one holds.
struct Sharing {
  std::vector<std::int64_t> start{0};  // per piece, into `others`
  struct Common {
    int here;   // place in this piece
    int piece;  // another piece that holds the variable
    int there;  // place in it
  };
  std::vector<Common> common;
};

template <int D>
Sharing find_sharing(const std::vector<Piece<D>>& pieces, Places& places) {
  // Chain the occurrences of each variable through the pieces: places[v] is the latest occurrence.
  struct Occurrence {
    int piece;
    int place;
    int previous;
  };
  std::vector<Occurrence> occurrences;
  std::vector<std::vector<Sharing::Common>> lists(pieces.size());
  for (std::size_t p = 0; p < pieces.size(); ++p) {
    for (int k = 0; k < pieces[p].size(); ++k) {
      const int v = pieces[p].variables[static_cast<std::size_t>(k)];
      for (int at = places[v]; at >= 0; at = occurrences[static_cast<std::size_t>(at)].previous) {
        const Occurrence& o = occurrences[static_cast<std::size_t>(at)];
        lists[p].push_back({k, o.piece, o.place});
        lists[static_cast<std::size_t>(o.piece)].push_back({o.place, static_cast<int>(p), k});
      }
      occurrences.push_back({static_cast<int>(p), k, places[v]});
      places.set(v, static_cast<int>(occurrences.size()) - 1);
    }
  }
  for (const Piece<D>& piece : pieces) places.clear(piece.variables);
  Sharing out;
  for (const auto& list : lists) {
    out.common.insert(out.common.end(), list.begin(), list.end());
    out.start.push_back(static_cast<std::int64_t>(out.common.size()));
  }
  return out;
}

/// The best fit of piece p onto what is placed: `holder[k]` says which placed piece to compare
/// variable k with.
template <int D>
std::optional<Rigid<D>> fit(const VariableSet<D>& all, const std::vector<Piece<D>>& pieces,
                            std::size_t p, std::span<const Sharing::Common> common,
                            const std::vector<int>& group, int target) {
  // The first placed holder of each common variable gives its value.
  const Piece<D>& piece = pieces[p];
  std::vector<std::vector<double>> placed(piece.data.size());
  std::vector<std::vector<int>> in_a(piece.data.size()), in_b(piece.data.size());
  int last = -1;
  std::size_t c = 0;
  std::vector<Sharing::Common> sorted;
  for (const Sharing::Common& s : common) {
    if (group[static_cast<std::size_t>(s.piece)] == target) sorted.push_back(s);
  }
  std::stable_sort(sorted.begin(), sorted.end(),
                   [](const auto& x, const auto& y) { return x.here < y.here; });
  for (const Sharing::Common& s : sorted) {
    if (s.here == last) continue;
    last = s.here;
    while (s.here >= piece.column_start[c + 1]) ++c;
    const auto size = static_cast<std::ptrdiff_t>(all.column(static_cast<int>(c)).kind->value_size);
    const Piece<D>& other = pieces[static_cast<std::size_t>(s.piece)];
    const double* x = other.data[c].data() + (s.there - other.column_start[c]) * size;
    in_a[c].push_back(static_cast<int>(in_b[c].size()));
    in_b[c].push_back(s.here - piece.column_start[c]);
    placed[c].insert(placed[c].end(), x, x + size);
  }
  std::vector<CommonColumn<D>> columns;
  for (c = 0; c < piece.data.size(); ++c) {
    if (in_b[c].empty()) continue;
    columns.push_back({all.column(static_cast<int>(c)).kind, placed[c].data(), piece.data[c].data(),
                       in_a[c], in_b[c]});
  }
  return align<D>(columns);
}

/// A variable as one of several pieces holds it.
struct Held {
  int variable;
  int member;  // of the pieces that are united
  int place;   // in that piece
};

/// Everything that the pieces hold, by variable, then by member: each piece is in order, so
/// neighbours are merged until one run is left.
template <int D>
std::vector<Held> merge_held(const std::vector<Piece<D>>& pieces, const std::vector<int>& members) {
  std::size_t total = 0;
  for (const int m : members) total += pieces[static_cast<std::size_t>(m)].variables.size();
  std::vector<Held> held, merged(total);
  held.reserve(total);
  std::vector<std::ptrdiff_t> start{0};  // of each run
  for (std::size_t m = 0; m < members.size(); ++m) {
    const Piece<D>& piece = pieces[static_cast<std::size_t>(members[m])];
    for (int k = 0; k < piece.size(); ++k)
      held.push_back({piece.variables[static_cast<std::size_t>(k)], static_cast<int>(m), k});
    start.push_back(static_cast<std::ptrdiff_t>(held.size()));
  }
  while (start.size() > 2) {
    std::vector<std::ptrdiff_t> next{0};
    for (std::size_t r = 0; r + 1 < start.size(); r += 2) {
      const std::ptrdiff_t middle = start[r + 1];
      const std::ptrdiff_t end = r + 2 < start.size() ? start[r + 2] : middle;
      std::merge(held.begin() + start[r], held.begin() + middle, held.begin() + middle,
                 held.begin() + end, merged.begin() + start[r],
                 [](const Held& a, const Held& b) { return a.variable < b.variable; });
      next.push_back(end);
    }
    held.swap(merged);
    start = std::move(next);
  }
  return held;
}

}  // namespace

template <int D>
Piece<D> unite(const VariableSet<D>& all, std::vector<Piece<D>>& pieces,
               const std::vector<int>& members) {
  if (members.size() == 1) return std::move(pieces[static_cast<std::size_t>(members[0])]);
  const std::vector<Held> held = merge_held(pieces, members);
  std::vector<int> variables;
  variables.reserve(held.size());
  for (const Held& h : held) {
    if (variables.empty() || variables.back() != h.variable) variables.push_back(h.variable);
  }
  Piece<D> out = make_piece(all, std::move(variables));
  auto h = held.begin();
  for (std::size_t c = 0; c < out.data.size(); ++c) {
    const auto size = static_cast<std::size_t>(all.column(static_cast<int>(c)).kind->value_size);
    double* to = out.data[c].data();
    for (int k = out.column_start[c]; k < out.column_start[c + 1]; ++k, to += size) {
      const int v = out.variables[static_cast<std::size_t>(k)];
      const Piece<D>& from =
          pieces[static_cast<std::size_t>(members[static_cast<std::size_t>(h->member)])];
      std::memcpy(
          to,
          from.data[c].data() + static_cast<std::size_t>(h->place - from.column_start[c]) * size,
          size * sizeof(double));
      while (h != held.end() && h->variable == v) ++h;
    }
  }
  std::size_t observations = 0;
  for (const int m : members)
    observations += pieces[static_cast<std::size_t>(m)].observations.size();
  out.observations.reserve(observations);
  for (const int m : members) {
    const Piece<D>& piece = pieces[static_cast<std::size_t>(m)];
    out.observations.insert(out.observations.end(), piece.observations.begin(),
                            piece.observations.end());
  }
  return out;
}

template <int D>
std::vector<PlacedGroup<D>> place_groups(const VariableSet<D>& all, std::vector<Piece<D>>& pieces,
                                         Places& places) {
  const Sharing sharing = find_sharing(pieces, places);
  const auto common_of = [&](std::size_t p) {
    return std::span(sharing.common)
        .subspan(static_cast<std::size_t>(sharing.start[p]),
                 static_cast<std::size_t>(sharing.start[p + 1] - sharing.start[p]));
  };
  std::vector<PlacedGroup<D>> out;
  std::vector<int> group(pieces.size(), -1);
  for (int g = 0;; ++g) {
    // The largest piece that is left starts a group.
    int seed = -1;
    for (std::size_t p = 0; p < pieces.size(); ++p) {
      if (group[p] < 0 &&
          (seed < 0 || pieces[p].size() > pieces[static_cast<std::size_t>(seed)].size()))
        seed = static_cast<int>(p);
    }
    if (seed < 0) break;
    PlacedGroup<D> placed{{seed}, {Rigid<D>()}};
    group[static_cast<std::size_t>(seed)] = g;
    std::vector<int> shared(pieces.size(), 0);
    std::vector<int> refused(pieces.size(), -1);  // the overlap at which a fit was refused last
    const auto count_from = [&](int p) {
      for (const auto& s : common_of(static_cast<std::size_t>(p)))
        ++shared[static_cast<std::size_t>(s.piece)];
    };
    count_from(seed);
    for (;;) {
      int best = -1;
      for (std::size_t p = 0; p < pieces.size(); ++p) {
        if (group[p] >= 0 || shared[p] == 0 || refused[p] == shared[p]) continue;
        if (best < 0 || shared[p] > shared[static_cast<std::size_t>(best)])
          best = static_cast<int>(p);
      }
      if (best < 0) break;
      const auto p = static_cast<std::size_t>(best);
      if (const auto T = fit(all, pieces, p, common_of(p), group, g)) {
        move(all, pieces[p], *T);
        group[p] = g;
        placed.members.push_back(best);
        placed.motions.push_back(*T);
        count_from(best);
      } else {
        refused[p] = shared[p];
      }
    }
    out.push_back(std::move(placed));
  }
  return out;
}

template <int D>
std::vector<Piece<D>> place(const VariableSet<D>& all, std::vector<Piece<D>> pieces,
                            Places& places) {
  for (;;) {  // grown pieces together may share what none of their parts did
    const std::size_t before = pieces.size();
    if (before <= 1) return pieces;
    std::vector<Piece<D>> united;
    for (const PlacedGroup<D>& group : place_groups(all, pieces, places))
      united.push_back(unite(all, pieces, group.members));
    pieces = std::move(united);
    if (pieces.size() == before) return pieces;
  }
}

#define MAPJOIN_INSTANTIATE(D)                                                           \
  template std::vector<PlacedGroup<D>> place_groups<D>(const VariableSet<D>&,            \
                                                       std::vector<Piece<D>>&, Places&); \
  template Piece<D> unite<D>(const VariableSet<D>&, std::vector<Piece<D>>&,              \
                             const std::vector<int>&);                                   \
  template std::vector<Piece<D>> place<D>(const VariableSet<D>&, std::vector<Piece<D>>, Places&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
