#include "mapjoin/association/association.h"

#include <algorithm>

#include "mapjoin/association/hypothesis.h"
#include "mapjoin/association/rivals.h"
#include "mapjoin/graph/index.h"

namespace mapjoin {

namespace {

/// What would also fit, given everything that was matched: numbers of candidate pairs, ascending.
std::vector<int> also_possible(const CandidatePairs& pairs, const Matching& matching) {
  Hypothesis matched(pairs);
  for (const int p : matching.pairs) matched.take(p);
  std::vector<int> out;
  for (int p = pairs.known; p < pairs.size(); ++p) {
    if (!std::binary_search(matching.pairs.begin(), matching.pairs.end(), p) &&
        matched.added(p) <= pairs.gate_of(p))
      out.push_back(p);
  }
  return out;
}

/// Variables of B that may be matched and are no known ones, ascending.
template <int D>
std::vector<int> to_be_matched(const ComparedMaps<D>& maps, const CandidateOptions& options) {
  const std::vector<int> there = numbers_in(maps.b.variables(), maps.a.variables());
  std::vector<int> out;
  for (const auto& column : maps.b.variables().columns()) {
    if (!may_be_matched(*column.kind, options)) continue;
    for (int j = column.first; j < column.end(); ++j) {
      if (there[at(j)] < 0) out.push_back(j);
    }
  }
  return out;
}

}  // namespace

int Association::ambiguous() const {
  return static_cast<int>(
      std::count_if(matches.begin(), matches.end(), [](const Match& m) { return m.ambiguous; }));
}

int Association::suspicious() const {
  const auto flagged =
      std::count_if(known.begin(), known.end(), [](const TestedPair& p) { return p.flagged; });
  return static_cast<int>(flagged + std::count_if(matches.begin(), matches.end(),
                                                  [](const Match& m) { return m.suspicious; }));
}

template <int D>
Association associate(const ComparedMaps<D>& maps, const AssociationOptions& options) {
  const CandidatePairs pairs = candidate_pairs(maps, options.candidates);
  Matching matching = match(pairs, options.matcher, options.joint);
  if (options.odds > 0.0)
    matching.pairs = certain_matches(pairs, std::move(matching.pairs), options.odds);
  const std::vector<int> others = also_possible(pairs, matching);
  const auto tested = test_pairs<D>(maps, pairs, matching.pairs, options.false_alarm);

  Association out;
  out.complete = matching.complete;
  out.hypotheses = matching.hypotheses;
  out.candidates = pairs.size() - pairs.known;
  out.known.assign(tested.begin(), tested.begin() + pairs.known);
  std::vector<int> rivals;  // variables of B that another pair would do for
  for (const int p : others) rivals.push_back(pairs.pairs[at(p)].b);  // ascending, as pairs are
  std::vector<int> matched;
  for (std::size_t k = 0; k < matching.pairs.size(); ++k) {
    const TestedPair& test = tested[at(pairs.known) + k];
    matched.push_back(pairs.pairs[at(matching.pairs[k])].b);
    out.matches.push_back({test.a, test.b, test.chi2, test.dimension, test.bound,
                           std::binary_search(rivals.begin(), rivals.end(), matched.back()),
                           test.flagged});
  }
  for (const int j : to_be_matched(maps, options.candidates)) {
    if (std::binary_search(matched.begin(), matched.end(), j)) continue;
    out.unmatched.push_back(maps.b.variables().key(j));
    if (std::binary_search(rivals.begin(), rivals.end(), j))
      out.doubtful.push_back(out.unmatched.back());
  }
  return out;
}

template <int D>
Association associate(const Map<D>& a, const Map<D>& b, const AssociationOptions& options) {
  return associate<D>(in_common_frame(a, b), options);
}

std::vector<std::pair<Key, Key>> names_in_a(const Association& association) {
  std::vector<std::pair<Key, Key>> out;
  for (const Match& match : association.matches) out.emplace_back(match.b, match.a);
  return out;
}

#define MAPJOIN_INSTANTIATE(D)                                                                \
  template Association associate<D>(const Map<D>&, const Map<D>&, const AssociationOptions&); \
  template Association associate<D>(const ComparedMaps<D>&, const AssociationOptions&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
