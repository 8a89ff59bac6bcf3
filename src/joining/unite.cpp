#include "mapjoin/joining/unite.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <numeric>
#include <utility>

#include "mapjoin/graph/index.h"
#include "mapjoin/solvers/pool_loop.h"

namespace mapjoin {

namespace {

/// Values of a variable that are turned by more against one another (rad) have no mean: half way
/// between two orientations that contradict one another both are wrong.
constexpr double kContradiction = 0.5;

/// A variable as one of several pieces holds it.
struct Held {
  int variable;
  int member;  // of the pieces that are united
  int place;   // in that piece
};

/// Everything that the pieces hold, by variable, then by member: sorted by one digit of the
/// variable's number after the other, lowest first.
template <int D>
std::vector<Held> list_held(const std::vector<Piece<D>>& pieces, const std::vector<int>& members) {
  constexpr int kDigitBits = 8;
  constexpr int kDigits = 1 << kDigitBits;
  std::vector<Held> held;
  std::size_t total = 0;
  int largest = 0;
  for (const int m : members) total += pieces[at(m)].variables.size();
  held.reserve(total);
  for (std::size_t m = 0; m < members.size(); ++m) {
    const std::vector<int>& variables = pieces[at(members[m])].variables;
    if (!variables.empty()) largest = std::max(largest, variables.back());
    for (std::size_t k = 0; k < variables.size(); ++k)
      held.push_back({variables[k], static_cast<int>(m), static_cast<int>(k)});
  }
  std::vector<Held> sorted(total);
  for (int shift = 0; shift < 31 && (largest >> shift) > 0; shift += kDigitBits) {
    const auto digit = [&](const Held& h) { return at((h.variable >> shift) & (kDigits - 1)); };
    std::array<std::size_t, kDigits> next{};
    for (const Held& h : held) ++next[digit(h)];
    std::exclusive_scan(next.begin(), next.end(), next.begin(), std::size_t{0});
    for (const Held& h : held) sorted[next[digit(h)]++] = h;
    held.swap(sorted);
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

/// Fills in the variables at places first .. last - 1 of `out`; held[run[k]] is the first that
/// holds the one at place k.
template <int D>
void take_values(const VariableSet<D>& all, const std::vector<Piece<D>>& pieces,
                 const std::vector<int>& members, std::span<const Held> held,
                 std::span<const std::int64_t> run, SharedValue shared, int first, int last,
                 Piece<D>& out) {
  std::vector<const double*> values;  // of one variable
  std::vector<double> scratch;
  for (std::size_t c = 0; c < out.data.size(); ++c) {
    const VariableKind<D>& kind = *all.column(static_cast<int>(c)).kind;
    const auto size = static_cast<std::ptrdiff_t>(kind.value_size);
    const int begin = std::max(first, out.column_start[c]);
    const int end = std::min(last, out.column_start[c + 1]);
    double* to = out.data[c].data() + (begin - out.column_start[c]) * size;
    for (int k = begin; k < end; ++k, to += size) {
      values.clear();
      for (std::int64_t h = run[at(k)]; h < run[at(k + 1)]; ++h) {
        const Piece<D>& from = pieces[at(members[at(held[at(h)].member)])];
        values.push_back(from.data[c].data() + (held[at(h)].place - from.column_start[c]) * size);
      }
      std::memcpy(to, values[0], at(size) * sizeof(double));
      if (shared == SharedValue::kMean && values.size() > 1)
        take_mean<D>(kind, values, to, scratch);
    }
  }
}

}  // namespace

template <int D>
Piece<D> unite(const VariableSet<D>& all, std::vector<Piece<D>>& pieces,
               const std::vector<int>& members, SharedValue shared, LoopRunner loop) {
  constexpr int kChunk = 2048;  // variables
  if (members.size() == 1) return std::move(pieces[at(members[0])]);
  const std::vector<Held> held = list_held(pieces, members);
  std::vector<int> variables;
  std::vector<std::int64_t> run;
  variables.reserve(held.size());
  run.reserve(held.size() + 1);
  for (std::size_t h = 0; h < held.size(); ++h) {
    if (!variables.empty() && variables.back() == held[h].variable) continue;
    variables.push_back(held[h].variable);
    run.push_back(static_cast<std::int64_t>(h));
  }
  run.push_back(static_cast<std::int64_t>(held.size()));
  Piece<D> out = make_piece(all, std::move(variables));
  run_chunks(out.size(), kChunk, loop, [&](int first, int last) {
    take_values(all, pieces, members, std::span(held), std::span(run), shared, first, last, out);
  });
  std::size_t observations = 0;
  for (const int m : members) observations += pieces[at(m)].observations.size();
  out.observations.reserve(observations);
  for (const int m : members) {
    const std::vector<std::int64_t>& from = pieces[at(m)].observations;
    out.observations.insert(out.observations.end(), from.begin(), from.end());
  }
  return out;
}

template Piece<2> unite<2>(const VariableSet<2>&, std::vector<Piece<2>>&, const std::vector<int>&,
                           SharedValue, LoopRunner);
template Piece<3> unite<3>(const VariableSet<3>&, std::vector<Piece<3>>&, const std::vector<int>&,
                           SharedValue, LoopRunner);

}  // namespace mapjoin
