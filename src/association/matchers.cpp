#include "mapjoin/association/matchers.h"

#include <algorithm>
#include <utility>

#include "mapjoin/association/assignment.h"
#include "mapjoin/association/hypothesis.h"
#include "mapjoin/graph/disjoint_sets.h"
#include "mapjoin/graph/index.h"

namespace mapjoin {

namespace {

/// Candidates within the gate given the known pairs.
std::vector<int> within_gate(const CandidatePairs& pairs, const Hypothesis& given) {
  std::vector<int> out;
  for (int p = pairs.known; p < pairs.size(); ++p) {
    if (given.added(p) <= pairs.gate_of(p)) out.push_back(p);
  }
  return out;
}

/// Pairs that have variables in common, directly or through others: groups, each in ascending
/// order.
std::vector<std::vector<int>> connected(const CandidatePairs& pairs, const std::vector<int>& some) {
  DisjointSets groups(static_cast<int>(some.size()));
  for (const bool by_a : {true, false}) {
    std::vector<std::pair<int, int>> users;  // (variable, place in `some`)
    for (std::size_t k = 0; k < some.size(); ++k) {
      const CandidatePairs::Pair& pair = pairs.pairs[at(some[k])];
      users.emplace_back(by_a ? pair.a : pair.b, static_cast<int>(k));
    }
    std::sort(users.begin(), users.end());
    for (std::size_t k = 1; k < users.size(); ++k) {
      if (users[k].first == users[k - 1].first) groups.unite(users[k].second, users[k - 1].second);
    }
  }
  std::vector<std::vector<int>> of_root(some.size());
  for (std::size_t k = 0; k < some.size(); ++k)
    of_root[at(groups.root(static_cast<int>(k)))].push_back(some[k]);
  std::erase_if(of_root, [](const std::vector<int>& group) { return group.empty(); });
  return of_root;
}

template <class Member>
std::vector<int> variables_of(const CandidatePairs& pairs, const std::vector<int>& group,
                              Member member) {
  std::vector<int> out;
  for (const int p : group) out.push_back(pairs.pairs[at(p)].*member);
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

int place_in(const std::vector<int>& sorted, int value) {
  return static_cast<int>(std::lower_bound(sorted.begin(), sorted.end(), value) - sorted.begin());
}

/// The least sum of chi2 for one group; each variable of B may also take a column that means none.
void assign_group(const CandidatePairs& pairs, const Hypothesis& given,
                  const std::vector<int>& group, std::vector<int>& chosen) {
  using Pair = CandidatePairs::Pair;
  const std::vector<int> in_a = variables_of(pairs, group, &Pair::a);
  const std::vector<int> in_b = variables_of(pairs, group, &Pair::b);
  const auto rows = static_cast<Eigen::Index>(in_b.size());
  const auto columns = static_cast<Eigen::Index>(in_a.size());
  double highest = 0.0;
  for (const int p : group) highest = std::max(highest, pairs.gate_of(p));
  // No pair: more than any assignment that leaves all of them unmatched.
  const double never = (static_cast<double>(rows) + 1.0) * (highest + 1.0);
  Eigen::MatrixXd cost = Eigen::MatrixXd::Constant(rows, columns + rows, never);
  Eigen::MatrixXi number = Eigen::MatrixXi::Constant(rows, columns, -1);
  for (const int p : group) {
    const Pair& pair = pairs.pairs[at(p)];
    const int i = place_in(in_b, pair.b);
    const int j = place_in(in_a, pair.a);
    cost(i, j) = given.added(p);
    number(i, j) = p;
    cost(i, columns + i) = pairs.gate_of(p);
  }
  const std::vector<int> column = assign(cost);
  for (Eigen::Index i = 0; i < rows; ++i) {
    const int j = column[at(i)];
    if (j < columns && number(i, j) >= 0) chosen.push_back(number(i, j));
  }
}

}  // namespace

Matching match_nearest(const CandidatePairs& pairs) {
  const Hypothesis given(pairs);
  std::vector<int> nearest = within_gate(pairs, given);
  std::sort(nearest.begin(), nearest.end(), [&](int p, int q) {
    return std::pair(given.added(p), p) < std::pair(given.added(q), q);
  });
  int most_a = -1, most_b = -1;
  for (const CandidatePairs::Pair& pair : pairs.pairs) {
    most_a = std::max(most_a, pair.a);
    most_b = std::max(most_b, pair.b);
  }
  std::vector<bool> used_a(at(most_a + 1), false), done_b(at(most_b + 1), false);
  Matching out;
  for (const int p : nearest) {
    const CandidatePairs::Pair& pair = pairs.pairs[at(p)];
    if (done_b[at(pair.b)]) continue;
    done_b[at(pair.b)] = true;  // its nearest: this or none
    if (used_a[at(pair.a)]) continue;
    used_a[at(pair.a)] = true;
    out.pairs.push_back(p);
  }
  std::sort(out.pairs.begin(), out.pairs.end());
  out.hypotheses = 1;
  return out;
}

Matching match_globally(const CandidatePairs& pairs) {
  const Hypothesis given(pairs);
  Matching out;
  for (const std::vector<int>& group : connected(pairs, within_gate(pairs, given)))
    assign_group(pairs, given, group, out.pairs);
  std::sort(out.pairs.begin(), out.pairs.end());
  out.hypotheses = 1;
  return out;
}

Matching match(const CandidatePairs& pairs, Matcher matcher, const JointOptions& options) {
  switch (matcher) {
    case Matcher::kNearest:
      return match_nearest(pairs);
    case Matcher::kGlobal:
      return match_globally(pairs);
    case Matcher::kJoint:
      break;
  }
  return match_jointly(pairs, options);
}

}  // namespace mapjoin
