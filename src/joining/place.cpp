#include "mapjoin/joining/place.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <numeric>
#include <optional>
#include <utility>

#include "mapjoin/frames/align.h"

namespace mapjoin {

namespace {

/// Pieces are laid again so often, when they share at most one in so many of their variables.
constexpr int kTimesLaidAgain = 3;
constexpr std::size_t kLarge = 4;
/// Values of a variable that are turned by more against one another (rad) have no mean: half way
/// between two orientations that contradict one another both are wrong.
constexpr double kContradiction = 0.5;

/// Which pieces hold each variable that more than one holds.
struct Sharing {
  std::vector<std::int64_t> start{0};  // per piece, into `common`
  struct Common {
    int here;   // place in this piece
    int piece;  // another piece that holds the variable
    int there;  // place in it
  };
  std::vector<Common> common;

  std::span<const Common> of(int piece) const {
    const auto p = static_cast<std::size_t>(piece);
    return std::span(common).subspan(static_cast<std::size_t>(start[p]),
                                     static_cast<std::size_t>(start[p + 1] - start[p]));
  }
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

/// The best fit of piece p onto the pieces whose entry in `group` is `target`; `common` is what it
/// shares with any.
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

/// Are two values of a type turned by no more than `kContradiction`? True of what has no heading.
template <int D>
bool agree(const VariableKind<D>& kind, const double* x, const double* y) {
  constexpr int kOne = 0;
  std::array<double, D * D> a, b;
  const auto product = [&](int size) {
    return std::inner_product(&a[0], &a[0] + size, &b[0], 0.0);
  };
  if (kind.rotations != nullptr) {
    kind.rotations(x, &kOne, 1, a.data());
    kind.rotations(y, &kOne, 1, b.data());
    if (product(D * D) < D - 2 + 2.0 * std::cos(kContradiction)) return false;  // trace of a^T b
  }
  if (kind.directions != nullptr) {
    kind.directions(x, &kOne, 1, a.data());
    kind.directions(y, &kOne, 1, b.data());
    if (product(D) < std::cos(kContradiction)) return false;
  }
  return true;
}

/// Writes the mean of a variable's values over the first of them, where they agree. `scratch` is a
/// work array.
template <int D>
void take_mean(const VariableKind<D>& kind, std::span<const double* const> values, double* first,
               std::vector<double>& scratch) {
  const auto dim = static_cast<std::size_t>(kind.dim);
  scratch.assign(2 * dim, 0.0);
  double* const sum = scratch.data();
  double* const difference = sum + dim;
  for (const double* const value : values.subspan(1)) {
    if (!agree(kind, first, value)) return;
    kind.local(first, value, 1, difference);
    for (std::size_t i = 0; i < dim; ++i) sum[i] += difference[i];
  }
  for (std::size_t i = 0; i < dim; ++i) sum[i] /= static_cast<double>(values.size());
  kind.retract(first, sum, 1);
}

}  // namespace

template <int D>
Piece<D> unite(const VariableSet<D>& all, std::vector<Piece<D>>& pieces,
               const std::vector<int>& members, SharedValue shared) {
  if (members.size() == 1) return std::move(pieces[static_cast<std::size_t>(members[0])]);
  const std::vector<Held> held = merge_held(pieces, members);
  std::vector<int> variables;
  variables.reserve(held.size());
  for (const Held& h : held) {
    if (variables.empty() || variables.back() != h.variable) variables.push_back(h.variable);
  }
  Piece<D> out = make_piece(all, std::move(variables));
  auto h = held.begin();
  std::vector<const double*> values;  // of one variable
  std::vector<double> scratch;
  for (std::size_t c = 0; c < out.data.size(); ++c) {
    const VariableKind<D>& kind = *all.column(static_cast<int>(c)).kind;
    const auto size = static_cast<std::size_t>(kind.value_size);
    double* to = out.data[c].data();
    for (int k = out.column_start[c]; k < out.column_start[c + 1]; ++k, to += size) {
      const int v = out.variables[static_cast<std::size_t>(k)];
      values.clear();
      for (; h != held.end() && h->variable == v; ++h) {
        const Piece<D>& from =
            pieces[static_cast<std::size_t>(members[static_cast<std::size_t>(h->member)])];
        values.push_back(from.data[c].data() +
                         static_cast<std::size_t>(h->place - from.column_start[c]) * size);
      }
      std::memcpy(to, values[0], size * sizeof(double));
      if (shared == SharedValue::kMean && values.size() > 1)
        take_mean<D>(kind, values, to, scratch);
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

namespace {

/// Lays each piece of a group but the first anew, on all the others. `group` is a work array, zero
/// for every piece, before and after.
template <int D>
void lay_again(const VariableSet<D>& all, std::vector<Piece<D>>& pieces, const Sharing& sharing,
               const std::vector<int>& members, std::vector<int>& group) {
  if (members.size() < 3) return;  // two already lie as they fit best
  std::size_t variables = 0, common = 0;
  for (const int m : members) {
    variables += pieces[static_cast<std::size_t>(m)].variables.size();
    common += sharing.of(m).size();
  }
  if (common > variables / kLarge) return;
  for (const int m : members) group[static_cast<std::size_t>(m)] = 1;
  for (int time = 0; time < kTimesLaidAgain; ++time) {
    for (const int m : std::span(members).subspan(1)) {
      const auto p = static_cast<std::size_t>(m);
      if (const auto T = fit(all, pieces, p, sharing.of(m), group, 1)) move(all, pieces[p], *T);
    }
  }
  for (const int m : members) group[static_cast<std::size_t>(m)] = 0;
}

/// Pieces that share something with those that are placed; most first, then lowest number first.
class Candidates {
 public:
  explicit Candidates(std::size_t pieces) : shared_(pieces, 0), listed_(pieces, -1) {}

  /// Nothing is placed.
  void clear() {
    for (const int p : seen_) shared_[static_cast<std::size_t>(p)] = 0;
    seen_.clear();
    heap_.clear();
  }
  /// Counts what others share with a piece that is placed now.
  void count_from(std::span<const Sharing::Common> common) {
    ++round_;
    for (const Sharing::Common& s : common) {
      if (shared_[static_cast<std::size_t>(s.piece)]++ == 0) seen_.push_back(s.piece);
    }
    for (const Sharing::Common& s : common) {
      const auto p = static_cast<std::size_t>(s.piece);
      if (std::exchange(listed_[p], round_) == round_) continue;
      heap_.push_back(kPieces * shared_[p] + (kPieces - 1 - s.piece));
      std::push_heap(heap_.begin(), heap_.end());
    }
  }
  /// The next one, or -1. Comes again only after it shares more.
  int take() {
    while (!heap_.empty()) {
      std::pop_heap(heap_.begin(), heap_.end());
      const std::int64_t top = heap_.back();
      heap_.pop_back();
      const auto piece = static_cast<int>(kPieces - 1 - top % kPieces);
      if (top / kPieces == shared_[static_cast<std::size_t>(piece)]) return piece;
    }
    return -1;
  }

 private:
  static constexpr std::int64_t kPieces = std::int64_t{1} << 31;

  std::vector<int> shared_;         // with what is placed, per piece
  std::vector<int> listed_;         // the round in which a piece was put on the heap last
  std::vector<int> seen_;           // pieces that share something
  std::vector<std::int64_t> heap_;  // what is shared; then, of as many, the lowest number first
  int round_ = 0;
};

template <int D>
std::vector<PlacedGroup<D>> place_groups(const VariableSet<D>& all, std::vector<Piece<D>>& pieces,
                                         const Sharing& sharing) {
  std::vector<int> by_size(pieces.size());
  std::iota(by_size.begin(), by_size.end(), 0);
  const auto size_of = [&](int p) { return pieces[static_cast<std::size_t>(p)].size(); };
  std::stable_sort(by_size.begin(), by_size.end(),
                   [&](int a, int b) { return size_of(a) > size_of(b); });
  std::vector<PlacedGroup<D>> out;
  std::vector<int> group(pieces.size(), -1);
  Candidates candidates(pieces.size());
  for (const int seed : by_size) {  // the largest piece that is left starts a group
    if (group[static_cast<std::size_t>(seed)] >= 0) continue;
    const auto g = static_cast<int>(out.size());
    PlacedGroup<D> placed{{seed}, {Rigid<D>()}};
    group[static_cast<std::size_t>(seed)] = g;
    candidates.clear();
    candidates.count_from(sharing.of(seed));
    for (int next = candidates.take(); next >= 0; next = candidates.take()) {
      const auto p = static_cast<std::size_t>(next);
      if (group[p] >= 0) continue;
      if (const auto T = fit(all, pieces, p, sharing.of(next), group, g)) {
        move(all, pieces[p], *T);
        group[p] = g;
        placed.members.push_back(next);
        placed.motions.push_back(*T);
        candidates.count_from(sharing.of(next));
      }
    }
    out.push_back(std::move(placed));
  }
  return out;
}

}  // namespace

template <int D>
std::vector<PlacedGroup<D>> place_groups(const VariableSet<D>& all, std::vector<Piece<D>>& pieces,
                                         Places& places) {
  return place_groups(all, pieces, find_sharing(pieces, places));
}

template <int D>
std::vector<Piece<D>> place(const VariableSet<D>& all, std::vector<Piece<D>> pieces,
                            Places& places) {
  for (;;) {  // grown pieces together may share what none of their parts did
    const std::size_t before = pieces.size();
    if (before <= 1) return pieces;
    const Sharing sharing = find_sharing(pieces, places);
    std::vector<Piece<D>> united;
    std::vector<int> laid_now(before, 0);
    for (const PlacedGroup<D>& group : place_groups(all, pieces, sharing)) {
      lay_again(all, pieces, sharing, group.members, laid_now);
      united.push_back(unite(all, pieces, group.members, SharedValue::kMean));
    }
    pieces = std::move(united);
    if (pieces.size() == before) return pieces;
  }
}

#define MAPJOIN_INSTANTIATE(D)                                                           \
  template std::vector<PlacedGroup<D>> place_groups<D>(const VariableSet<D>&,            \
                                                       std::vector<Piece<D>>&, Places&); \
  template Piece<D> unite<D>(const VariableSet<D>&, std::vector<Piece<D>>&,              \
                             const std::vector<int>&, SharedValue);                      \
  template std::vector<Piece<D>> place<D>(const VariableSet<D>&, std::vector<Piece<D>>, Places&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
