#include <algorithm>
#include <limits>

#include "mapjoin/association/hypothesis.h"
#include "mapjoin/association/matchers.h"
#include "mapjoin/evaluation/chi_squared.h"
#include "mapjoin/graph/index.h"

namespace mapjoin {

namespace {

/// Joint gates by degrees of freedom, computed when they are asked for.
class JointGates {
 public:
  explicit JointGates(double probability) : probability_(probability) {
    chi_squared_quantile(probability, 1);  // is it one?
  }
  double operator()(int dimension) {
    while (static_cast<int>(gates_.size()) <= dimension)
      gates_.push_back(chi_squared_quantile(probability_, static_cast<int>(gates_.size())));
    return gates_[at(dimension)];
  }

 private:
  double probability_;
  std::vector<double> gates_{0.0};
};

class JointSearch {
 public:
  JointSearch(const CandidatePairs& pairs, const JointOptions& options)
      : pairs_(pairs), options_(options), gates_(options.gate), hypothesis_(pairs) {
    int most_a = -1;
    for (int p = pairs.known; p < pairs.size(); ++p) {
      const bool new_variable =
          p == pairs.known || pairs.pairs[at(p)].b != pairs.pairs[at(p) - 1].b;
      if (new_variable) first_.push_back(p);
      most_a = std::max(most_a, pairs.pairs[at(p)].a);
    }
    decided_.assign(first_.size(), false);
    first_.push_back(pairs.size());
    used_.assign(at(most_a + 1), false);
  }

  Matching run() {
    open();
    while (!levels_.empty()) {
      if (best_.hypotheses >= options_.most_hypotheses) {
        best_.complete = false;
        break;
      }
      advance();
    }
    std::sort(best_.pairs.begin(), best_.pairs.end());
    return std::move(best_);
  }

 private:
  /// One variable of B, and what may become of it: each of its candidates, then none.
  struct Level {
    int variable;
    std::vector<int> options;
    std::size_t next = 0;
  };

  bool possible(int p) {
    return !used_[at(pairs_.pairs[at(p)].a)] && hypothesis_.added(p) <= pairs_.gate_of(p) &&
           hypothesis_.chi2() + hypothesis_.added(p) <=
               gates_(hypothesis_.dimension() + pairs_.pairs[at(p)].dim);
  }

  /// What is left to decide: the next variable, and the most that can come of it.
  struct Outlook {
    std::size_t variables = 0;  ///< that have a candidate left
    int next = -1;              ///< the one to decide next
    double chi2 = 0.0;  ///< of the hypothesis and of the best candidate of each, each on its own
  };

  Outlook look_ahead() {
    Outlook out;
    out.chi2 = hypothesis_.chi2();
    int fewest = std::numeric_limits<int>::max();
    double least = 0.0;
    for (std::size_t v = 0; v < decided_.size(); ++v) {
      if (decided_[v]) continue;
      int count = 0;
      double variance = std::numeric_limits<double>::infinity();
      double nearest = variance;
      for (int p = first_[v]; p < first_[v + 1]; ++p) {
        if (!possible(p)) continue;
        ++count;
        variance = std::min(variance, hypothesis_.spread(p).trace());
        nearest = std::min(nearest, hypothesis_.added(p));
      }
      if (count == 0) continue;
      ++out.variables;
      out.chi2 += nearest;
      if (count < fewest || (count == fewest && variance < least)) {
        fewest = count;
        least = variance;
        out.next = static_cast<int>(v);
      }
    }
    return out;
  }

  /// Looks at the hypothesis as it is: is it the best so far, and can more come of it? Of those
  /// that promise as many pairs as the best has, only if it promises less chi2.
  void open() {
    ++best_.hypotheses;
    const std::size_t taken = hypothesis_.taken().size();
    if (taken > best_.pairs.size() ||
        (taken == best_.pairs.size() && hypothesis_.chi2() < best_chi2_)) {
      best_.pairs = hypothesis_.taken();
      best_chi2_ = hypothesis_.chi2();
    }
    const Outlook ahead = look_ahead();
    const std::size_t bound = taken + ahead.variables;
    if (ahead.variables == 0 || bound < best_.pairs.size() ||
        (bound == best_.pairs.size() && ahead.chi2 >= best_chi2_))
      return;
    const int chosen = ahead.next;
    Level level{chosen, {}, 0};
    for (int p = first_[at(chosen)]; p < first_[at(chosen) + 1]; ++p) {
      if (possible(p)) level.options.push_back(p);
    }
    std::stable_sort(level.options.begin(), level.options.end(),
                     [&](int p, int q) { return hypothesis_.added(p) < hypothesis_.added(q); });
    decided_[at(chosen)] = true;
    levels_.push_back(std::move(level));
  }

  /// Takes back what the last level had taken, and tries what comes next there.
  void advance() {
    Level& level = levels_.back();
    if (level.next > 0 && level.next <= level.options.size()) {
      used_[at(pairs_.pairs[at(level.options[level.next - 1])].a)] = false;
      hypothesis_.drop();
    }
    if (level.next > level.options.size()) {
      decided_[at(level.variable)] = false;
      levels_.pop_back();
      return;
    }
    if (level.next < level.options.size()) {
      const int p = level.options[level.next];
      used_[at(pairs_.pairs[at(p)].a)] = true;
      hypothesis_.take(p);
    }
    ++level.next;
    open();
  }

  const CandidatePairs& pairs_;
  const JointOptions& options_;
  JointGates gates_;
  Hypothesis hypothesis_;
  std::vector<int> first_;  // per variable of B: its first candidate; and the end
  std::vector<bool> decided_, used_;
  std::vector<Level> levels_;
  Matching best_;
  double best_chi2_ = std::numeric_limits<double>::infinity();
};

}  // namespace

Matching match_jointly(const CandidatePairs& pairs, const JointOptions& options) {
  return JointSearch(pairs, options).run();
}

}  // namespace mapjoin
