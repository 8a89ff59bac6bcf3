#include "mapjoin/association/rivals.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "mapjoin/association/hypothesis.h"
#include "mapjoin/association/joint_innovation.h"
#include "mapjoin/graph/index.h"

namespace mapjoin {

namespace {

/// Follows hypotheses and what they are worth.
class Follower {
 public:
  Follower(const CandidatePairs& pairs, const std::vector<int>& matched)
      : pairs_(pairs), hypothesis_(pairs), open_(matched) {
    int most_a = -1, most_b = -1;
    for (const CandidatePairs::Pair& pair : pairs.pairs) {
      most_a = std::max(most_a, pair.a);
      most_b = std::max(most_b, pair.b);
    }
    used_a_.assign(at(most_a + 1), false);
    used_b_.assign(at(most_b + 1), false);
    first_.assign(at(most_b + 2), pairs.size());
    for (int p = pairs.size() - 1; p >= pairs.known; --p) first_[at(pairs.pairs[at(p)].b)] = p;
  }

  std::vector<int> run(double odds) {
    std::vector<int> kept;
    while (!open_.empty()) {
      const auto next = most_certain();
      const int p = open_[next.first];
      open_.erase(open_.begin() + static_cast<std::ptrdiff_t>(next.first));
      if (next.second > 1 && has_rival(p, std::log(odds))) continue;
      take(p);
      kept.push_back(p);
    }
    std::sort(kept.begin(), kept.end());
    return kept;
  }

 private:
  bool possible(int p) const {
    const CandidatePairs::Pair& pair = pairs_.pairs[at(p)];
    return !used_a_[at(pair.a)] && !used_b_[at(pair.b)] &&
           hypothesis_.added(p) <= pairs_.gate_of(p);
  }
  template <class F>
  void for_candidates_of(int b, F&& f) const {
    for (int p = first_[at(b)]; p < pairs_.size() && pairs_.pairs[at(p)].b == b; ++p) {
      if (possible(p)) f(p);
    }
  }
  double worth(int p) const { return hypothesis_.log_likelihood(p) - pairs_.log_density[at(p)]; }
  void take(int p) {
    used_a_[at(pairs_.pairs[at(p)].a)] = used_b_[at(pairs_.pairs[at(p)].b)] = true;
    hypothesis_.take(p);
  }
  void drop() {
    const CandidatePairs::Pair& pair = pairs_.pairs[at(hypothesis_.taken().back())];
    used_a_[at(pair.a)] = used_b_[at(pair.b)] = false;
    hypothesis_.drop();
  }
  void drop_to(std::size_t count) {
    while (hypothesis_.taken().size() > count) drop();
  }

  /// The place in open_ of the match with the fewest alternatives, of equals the one predicted
  /// best, and how many candidates its variable has.
  std::pair<std::size_t, int> most_certain() const {
    std::size_t best = 0;
    int fewest = std::numeric_limits<int>::max();
    double least = 0.0;
    for (std::size_t k = 0; k < open_.size(); ++k) {
      int count = 0;
      for_candidates_of(pairs_.pairs[at(open_[k])].b, [&](int) { ++count; });
      const double variance = hypothesis_.spread(open_[k]).trace();
      if (count > fewest || (count == fewest && variance >= least)) continue;
      best = k;
      fewest = count;
      least = variance;
    }
    return {best, fewest};
  }

  /// Does q contradict at least half of the matches that are still open?
  bool lays_otherwise(int q) {
    take(q);
    std::size_t contradicted = 0;
    for (const int p : open_) contradicted += possible(p) ? 0 : 1;
    drop();
    return !open_.empty() && 2 * contradicted >= open_.size();
  }

  /// What p and the open matches are worth.
  double worth_of_matches(int p) {
    const std::size_t before = hypothesis_.taken().size();
    double sum = worth(p);
    take(p);
    for (const int q : open_) {
      sum += worth(q);
      take(q);
    }
    drop_to(before);
    return sum;
  }

  /// What q is worth with all that follows: always the variable with the fewest candidates, and the
  /// nearest of them.
  double worth_of_consequences(int q) {
    const std::size_t before = hypothesis_.taken().size();
    double sum = 0.0;
    while (q >= 0) {
      sum += worth(q);
      take(q);
      q = -1;
      int fewest = std::numeric_limits<int>::max();
      for (int p = pairs_.known; p < pairs_.size();) {
        const int b = pairs_.pairs[at(p)].b;
        int count = 0;
        int nearest = -1;
        for (; p < pairs_.size() && pairs_.pairs[at(p)].b == b; ++p) {
          if (!possible(p)) continue;
          ++count;
          if (nearest < 0 || hypothesis_.added(p) < hypothesis_.added(nearest)) nearest = p;
        }
        if (count == 0 || count >= fewest) continue;
        fewest = count;
        q = nearest;
      }
      if (q >= 0 && worth(q) < 0.0) break;  // it would not be matched
    }
    drop_to(before);
    return sum;
  }

  bool has_rival(int p, double log_odds) {
    std::vector<int> others;
    for_candidates_of(pairs_.pairs[at(p)].b, [&](int q) {
      if (q != p) others.push_back(q);
    });
    std::erase_if(others, [&](int q) { return !lays_otherwise(q); });
    if (others.empty()) return false;
    const double least = worth_of_matches(p) - log_odds;
    return std::any_of(others.begin(), others.end(),
                       [&](int q) { return worth_of_consequences(q) > least; });
  }

  const CandidatePairs& pairs_;
  Hypothesis hypothesis_;
  std::vector<int> open_;  // matches not yet decided on
  std::vector<bool> used_a_, used_b_;
  std::vector<int> first_;  // per variable of B: its first candidate
};

/// Those that are likelier than chance.
std::vector<int> significant(const CandidatePairs& pairs, const std::vector<int>& matched) {
  std::vector<int> all;
  for (int p = 0; p < pairs.known; ++p) all.push_back(p);
  all.insert(all.end(), matched.begin(), matched.end());
  if (matched.empty()) return {};
  JointInnovation joint(pairs, all);
  for (;;) {
    int worst = -1;
    double least = 0.0;
    for (int k = pairs.known; k < joint.size(); ++k) {
      if (!joint.believed(k) || joint.dimension(k) < pairs.pairs[at(all[at(k)])].dim) continue;
      const double worth = joint.log_likelihood(k) - pairs.log_density[at(all[at(k)])];
      if (worth >= least) continue;
      least = worth;
      worst = k;
    }
    if (worst < 0) break;
    joint.doubt(worst);
  }
  std::vector<int> kept;
  for (int k = pairs.known; k < joint.size(); ++k) {
    if (joint.believed(k)) kept.push_back(all[at(k)]);
  }
  return kept;
}

}  // namespace

std::vector<int> certain_matches(const CandidatePairs& pairs, std::vector<int> matched,
                                 double odds) {
  for (;;) {
    const std::size_t before = matched.size();
    matched = Follower(pairs, significant(pairs, matched)).run(odds);
    if (matched.size() == before) return matched;
  }
}

}  // namespace mapjoin
