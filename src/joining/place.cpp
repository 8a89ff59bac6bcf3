#include "mapjoin/joining/place.h"

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <optional>
#include <utility>

#include "mapjoin/frames/align.h"
#include "mapjoin/joining/sharing.h"

namespace mapjoin {

namespace {

/// Pieces are laid again so often, when they share at most one in so many of their variables.
constexpr int kTimesLaidAgain = 3;
constexpr std::size_t kLarge = 4;

using Holder = Sharing::Holder;

/// Finds the best fit of one piece after another. Keeps its work arrays.
template <int D>
class Fitter {
 public:
  Fitter(const VariableSet<D>& all, const std::vector<Piece<D>>& pieces, const Sharing& sharing)
      : all_(all), pieces_(pieces), sharing_(sharing) {}

  /// Lays piece p on the values that holder(variable) names of what it shares; piece -1 for none.
  template <class HolderOf>
  std::optional<Rigid<D>> fit(int p, HolderOf&& holder) {
    const Piece<D>& piece = pieces_[static_cast<std::size_t>(p)];
    columns_.resize(piece.data.size());
    for (Column& column : columns_) column.clear();
    std::size_t c = 0;
    for (const Sharing::Shared& shared : sharing_.of(p)) {
      const Holder other = holder(shared.number);
      if (other.piece < 0) continue;
      while (shared.place >= piece.column_start[c + 1]) ++c;
      columns_[c].add(all_, pieces_[static_cast<std::size_t>(other.piece)], c, other.place,
                      shared.place - piece.column_start[c]);
    }
    common_.clear();
    for (c = 0; c < columns_.size(); ++c) {
      const Column& column = columns_[c];
      if (column.in_b.empty()) continue;
      common_.push_back({all_.column(static_cast<int>(c)).kind, column.placed.data(),
                         piece.data[c].data(), column.in_a, column.in_b});
    }
    return align<D>(common_);
  }

 private:
  struct Column {
    std::vector<double> placed;
    std::vector<int> in_a, in_b;

    void clear() {
      placed.clear();
      in_a.clear();
      in_b.clear();
    }
    void add(const VariableSet<D>& all, const Piece<D>& other, std::size_t c, int there, int here) {
      const auto size =
          static_cast<std::ptrdiff_t>(all.column(static_cast<int>(c)).kind->value_size);
      const double* const x = other.data[c].data() + (there - other.column_start[c]) * size;
      in_a.push_back(static_cast<int>(in_b.size()));
      in_b.push_back(here);
      placed.insert(placed.end(), x, x + size);
    }
  };

  const VariableSet<D>& all_;
  const std::vector<Piece<D>>& pieces_;
  const Sharing& sharing_;
  std::vector<Column> columns_;
  std::vector<CommonColumn<D>> common_;
};

/// Lays each piece of a group but the first anew, on all the others. `group` is a work array, zero
/// for every piece, before and after.
template <int D>
void lay_again(const VariableSet<D>& all, std::vector<Piece<D>>& pieces, const Sharing& sharing,
               const std::vector<int>& members, std::vector<int>& group, Fitter<D>& fitter) {
  if (members.size() < 3) return;  // two already lie as they fit best
  std::size_t variables = 0, common = 0;
  for (const int m : members) {
    variables += pieces[static_cast<std::size_t>(m)].variables.size();
    for (const auto& shared : sharing.of(m)) common += sharing.holders(shared.number).size() - 1;
  }
  if (common > variables / kLarge) return;
  for (const int m : members) group[static_cast<std::size_t>(m)] = 1;
  for (int time = 0; time < kTimesLaidAgain; ++time) {
    for (const int m : std::span(members).subspan(1)) {
      const auto on_others = [&](int variable) {
        for (const Holder& h : sharing.holders(variable)) {
          if (h.piece != m && group[static_cast<std::size_t>(h.piece)] != 0) return h;
        }
        return Holder();
      };
      if (const auto T = fitter.fit(m, on_others))
        move(all, pieces[static_cast<std::size_t>(m)], *T);
    }
  }
  for (const int m : members) group[static_cast<std::size_t>(m)] = 0;
}

/// Pieces that share something with those that are placed; most variables first, then lowest number
/// first.
class Candidates {
 public:
  explicit Candidates(std::size_t pieces) : shared_(pieces, 0), listed_(pieces, -1) {}

  /// Nothing is placed.
  void clear() {
    for (const int p : seen_) shared_[static_cast<std::size_t>(p)] = 0;
    seen_.clear();
    heap_.clear();
  }
  /// Counts a variable that is placed now, of all that hold it.
  void count(std::span<const Holder> holders) {
    for (const Holder& h : holders) {
      const auto p = static_cast<std::size_t>(h.piece);
      if (shared_[p]++ == 0) seen_.push_back(h.piece);
      if (std::exchange(listed_[p], round_) != round_) counted_.push_back(h.piece);
    }
  }
  /// Makes those known that share more now.
  void list() {
    for (const int p : counted_) {
      heap_.push_back(kPieces * shared_[static_cast<std::size_t>(p)] + (kPieces - 1 - p));
      std::push_heap(heap_.begin(), heap_.end());
    }
    counted_.clear();
    ++round_;
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

  std::vector<int> shared_;         // variables, with what is placed, per piece
  std::vector<int> listed_;         // the round in which a piece was counted last
  std::vector<int> seen_;           // pieces that share something
  std::vector<int> counted_;        // in this round
  std::vector<std::int64_t> heap_;  // what is shared; then, of as many, the lowest number first
  int round_ = 0;
};

template <int D>
class Placer {
 public:
  Placer(const VariableSet<D>& all, std::vector<Piece<D>>& pieces, const Sharing& sharing,
         Fitter<D>& fitter)
      : all_(all),
        pieces_(pieces),
        sharing_(sharing),
        fitter_(fitter),
        group_(pieces.size(), -1),
        placed_(static_cast<std::size_t>(sharing.variables())),
        candidates_(pieces.size()) {}

  std::vector<PlacedGroup<D>> run() {
    std::vector<int> by_size(pieces_.size());
    std::iota(by_size.begin(), by_size.end(), 0);
    const auto size_of = [&](int p) { return pieces_[static_cast<std::size_t>(p)].size(); };
    std::stable_sort(by_size.begin(), by_size.end(),
                     [&](int a, int b) { return size_of(a) > size_of(b); });
    std::vector<PlacedGroup<D>> out;
    for (const int seed : by_size) {  // the largest piece that is left starts a group
      if (group_of(seed) < 0) out.push_back(grow(seed, static_cast<int>(out.size())));
    }
    return out;
  }

 private:
  int& group_of(int piece) { return group_[static_cast<std::size_t>(piece)]; }
  Holder& placed(int variable) { return placed_[static_cast<std::size_t>(variable)]; }
  bool is_placed(int variable, int group) {
    const int piece = placed(variable).piece;
    return piece >= 0 && group_of(piece) == group;
  }

  PlacedGroup<D> grow(int seed, int g) {
    PlacedGroup<D> out{{seed}, {Rigid<D>()}};
    candidates_.clear();
    add(seed, g);
    for (int next = candidates_.take(); next >= 0; next = candidates_.take()) {
      if (group_of(next) >= 0) continue;
      const auto T = fitter_.fit(
          next, [&](int variable) { return is_placed(variable, g) ? placed(variable) : Holder(); });
      if (!T) continue;
      move(all_, pieces_[static_cast<std::size_t>(next)], *T);
      out.members.push_back(next);
      out.motions.push_back(*T);
      add(next, g);
    }
    return out;
  }

  /// A piece lies where it should: what it shares is placed by it, unless it was before.
  void add(int piece, int g) {
    group_of(piece) = g;
    for (const Sharing::Shared& shared : sharing_.of(piece)) {
      if (is_placed(shared.number, g)) continue;
      placed(shared.number) = {piece, shared.place};
      candidates_.count(sharing_.holders(shared.number));
    }
    candidates_.list();
  }

  const VariableSet<D>& all_;
  std::vector<Piece<D>>& pieces_;
  const Sharing& sharing_;
  Fitter<D>& fitter_;
  std::vector<int> group_;      // per piece, -1 for none yet
  std::vector<Holder> placed_;  // per shared variable: the first that was placed
  Candidates candidates_;
};

}  // namespace

template <int D>
std::vector<PlacedGroup<D>> place_groups(const VariableSet<D>& all, std::vector<Piece<D>>& pieces,
                                         Places& places) {
  const Sharing sharing(pieces, places);
  Fitter<D> fitter(all, pieces, sharing);
  return Placer<D>(all, pieces, sharing, fitter).run();
}

template <int D>
std::vector<Piece<D>> place(const VariableSet<D>& all, std::vector<Piece<D>> pieces, Places& places,
                            LoopRunner loop) {
  for (;;) {  // grown pieces together may share what none of their parts did
    const std::size_t before = pieces.size();
    if (before <= 1) return pieces;
    const Sharing sharing(pieces, places);
    Fitter<D> fitter(all, pieces, sharing);
    std::vector<Piece<D>> united;
    std::vector<int> laid_now(before, 0);
    for (const PlacedGroup<D>& group : Placer<D>(all, pieces, sharing, fitter).run()) {
      lay_again(all, pieces, sharing, group.members, laid_now, fitter);
      united.push_back(unite(all, pieces, group.members, SharedValue::kMean, loop));
    }
    pieces = std::move(united);
    if (pieces.size() == before) return pieces;
  }
}

#define MAPJOIN_INSTANTIATE(D)                                                                   \
  template std::vector<PlacedGroup<D>> place_groups<D>(const VariableSet<D>&,                    \
                                                       std::vector<Piece<D>>&, Places&);         \
  template std::vector<Piece<D>> place<D>(const VariableSet<D>&, std::vector<Piece<D>>, Places&, \
                                          LoopRunner);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
