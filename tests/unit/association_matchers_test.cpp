#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numeric>

#include "mapjoin/association/assignment.h"
#include "mapjoin/association/hypothesis.h"
#include "mapjoin/association/joint_innovation.h"
#include "mapjoin/association/matchers.h"
#include "mapjoin/association/rivals.h"
#include "mapjoin/evaluation/chi_squared.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/graph/index.h"
#include "tests/support/dense.h"
#include "tests/support/random_maps.h"

namespace mapjoin {
namespace {

using namespace test;  // NOLINT

/// Pairs over n variables of A and as many of B, each of `dim`, with dense joint covariances; which
/// pairs there are is drawn.
CandidatePairs random_pairs(Dice& dice, int n, int dim, double share, double shift = 1.0) {
  CandidatePairs out;
  out.covariance_a = dice.definite(n * dim, 0.3);
  out.covariance_b = dice.definite(n * dim, 0.3);
  int row = 0;
  for (int b = 0; b < n; ++b) {
    for (int a = 0; a < n; ++a) {
      if (a != b && dice.uniform() > share) continue;
      out.pairs.push_back(
          {a, b, dim, row, a * dim, b * dim, static_cast<std::int64_t>(out.slopes.size())});
      const Eigen::MatrixXd J = Eigen::MatrixXd::Identity(dim, dim) + 0.05 * dice.matrix(dim, dim);
      out.slopes.insert(out.slopes.end(), J.data(), J.data() + J.size());
      row += dim;
    }
  }
  out.innovations = shift * dice.matrix(row, 1);
  out.gates.push_back(0.0);
  for (int k = 1; k <= dim; ++k) out.gates.push_back(chi_squared_quantile(0.99, k));
  out.log_density.assign(out.pairs.size(), -10.0);
  return out;
}

/// The joint covariance of the innovations of some pairs, and the innovations, stacked.
std::pair<Eigen::MatrixXd, Eigen::VectorXd> stacked(const CandidatePairs& pairs,
                                                    const std::vector<int>& some) {
  const int dim = pairs.pairs[0].dim;
  const auto n = static_cast<Eigen::Index>(some.size()) * dim;
  Eigen::MatrixXd S(n, n);
  Eigen::VectorXd r(n);
  for (std::size_t i = 0; i < some.size(); ++i) {
    for (std::size_t j = 0; j < some.size(); ++j)
      S.block(static_cast<Eigen::Index>(i) * dim, static_cast<Eigen::Index>(j) * dim, dim, dim) =
          pairs.covariance(some[i], some[j]);
    r.segment(static_cast<Eigen::Index>(i) * dim, dim) = pairs.innovation(some[i]);
  }
  return {S, r};
}

double joint_chi2(const CandidatePairs& pairs, const std::vector<int>& some) {
  if (some.empty()) return 0.0;
  const auto [S, r] = stacked(pairs, some);
  const Eigen::VectorXd solved = S.fullPivLu().solve(r);
  return r.dot(solved);
}

bool one_to_one(const CandidatePairs& pairs, const std::vector<int>& some) {
  for (std::size_t i = 0; i < some.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (pairs.pairs[at(some[i])].a == pairs.pairs[at(some[j])].a ||
          pairs.pairs[at(some[i])].b == pairs.pairs[at(some[j])].b)
        return false;
    }
  }
  return true;
}

TEST(Assignment, IsTheBestOfAllPermutations) {
  Dice dice(1);
  for (int round = 0; round < 50; ++round) {
    const int rows = 1 + dice.below(5);
    const int columns = rows + dice.below(3);
    const Eigen::MatrixXd cost = dice.matrix(rows, columns);
    const std::vector<int> found = assign(cost);
    double sum = 0.0;
    for (int i = 0; i < rows; ++i) sum += cost(i, found[at(i)]);
    std::vector<int> order(at(columns));
    std::iota(order.begin(), order.end(), 0);
    double least = std::numeric_limits<double>::infinity();
    do {
      double here = 0.0;
      for (int i = 0; i < rows; ++i) here += cost(i, order[at(i)]);
      least = std::min(least, here);
    } while (std::next_permutation(order.begin(), order.end()));
    EXPECT_NEAR(sum, least, 1e-12);
  }
}

TEST(Assignment, RefusesWhatHasNoAnswer) {
  EXPECT_THROW(assign(Eigen::MatrixXd::Zero(3, 2)), InputError);
  Eigen::MatrixXd cost = Eigen::MatrixXd::Zero(1, 1);
  cost(0, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(assign(cost), InputError);
}

TEST(Hypothesis, ConditionsAsTheDenseFormulaDoes) {
  Dice dice(2);
  for (int round = 0; round < 20; ++round) {
    CandidatePairs pairs = random_pairs(dice, 4, 2, 0.5);
    pairs.known = round % 3 == 0 ? 1 : 0;
    Hypothesis hypothesis(pairs);
    std::vector<int> given;
    if (pairs.known > 0) given.push_back(0);
    for (int p = pairs.known; p < pairs.size(); ++p) {
      given.push_back(p);
      if (one_to_one(pairs, given)) {
        hypothesis.take(p);
      } else {
        given.pop_back();
      }
    }
    ASSERT_GE(given.size(), 3U);
    const auto [S, r] = stacked(pairs, given);
    const double chi2 = joint_chi2(pairs, given);
    EXPECT_NEAR(hypothesis.chi2(), chi2 - (pairs.known > 0 ? joint_chi2(pairs, {0}) : 0.0),
                1e-8 * (1.0 + chi2));
    for (int q = pairs.known; q < pairs.size(); ++q) {
      if (std::find(given.begin(), given.end(), q) != given.end()) continue;
      std::vector<int> with = given;
      with.push_back(q);
      const auto [all, unused] = stacked(pairs, with);
      const Eigen::MatrixXd C = all.bottomLeftCorner(2, S.cols());
      const Eigen::MatrixXd spread =
          all.bottomRightCorner(2, 2) - C * test::dense_solve(S, C.transpose());
      EXPECT_LT((hypothesis.spread(q) - spread).norm(), 1e-10);
      const double sum = joint_chi2(pairs, with);
      EXPECT_NEAR(hypothesis.added(q), sum - chi2, 1e-8 * (1.0 + sum));
      const double log_likelihood =
          -0.5 * (hypothesis.added(q) + std::log(test::dense_determinant(2 * M_PI * spread)));
      EXPECT_NEAR(hypothesis.log_likelihood(q), log_likelihood, 1e-6 * (1.0 + sum));
    }
  }
}

TEST(Hypothesis, ForgetsWhatIsTakenBack) {
  Dice dice(3);
  const CandidatePairs pairs = random_pairs(dice, 4, 2, 0.6);
  Hypothesis hypothesis(pairs);
  std::vector<double> before;
  hypothesis.take(0);
  for (int p = 0; p < pairs.size(); ++p) before.push_back(hypothesis.added(p));
  hypothesis.take(3);
  hypothesis.take(5);
  hypothesis.drop();
  hypothesis.drop();
  for (int p = 0; p < pairs.size(); ++p) EXPECT_EQ(hypothesis.added(p), before[at(p)]);
  EXPECT_EQ(hypothesis.taken(), std::vector<int>{0});
  EXPECT_EQ(hypothesis.dimension(), 2);
}

TEST(JointInnovation, IsThatOfOnePairGivenTheRest) {
  Dice dice(4);
  const CandidatePairs pairs = random_pairs(dice, 4, 2, 0.4);
  const std::vector<int> chosen{0, 2, 3, 5};
  JointInnovation joint(pairs, chosen);
  for (int k = 0; k < 4; ++k) {
    std::vector<int> rest = chosen;
    rest.erase(rest.begin() + k);
    const double all = joint_chi2(pairs, chosen);
    EXPECT_NEAR(joint.chi2(k), all - joint_chi2(pairs, rest), 1e-8 * (1.0 + all));
  }
  joint.doubt(1);
  const double rest = joint_chi2(pairs, {0, 3, 5});
  const double all = joint_chi2(pairs, chosen);
  EXPECT_NEAR(joint.chi2_of_doubted(1), all - rest, 1e-8 * (1.0 + all));
  EXPECT_NEAR(joint.chi2(0), rest - joint_chi2(pairs, {3, 5}), 1e-8 * (1.0 + rest));
}

TEST(NearestNeighbour, GivesEachTheNearestAndNoneTwice) {
  Dice dice(5);
  for (int round = 0; round < 20; ++round) {
    const CandidatePairs pairs = random_pairs(dice, 6, 2, 0.5, 1.5);
    const Hypothesis alone(pairs);
    const Matching found = match_nearest(pairs);
    EXPECT_TRUE(one_to_one(pairs, found.pairs));
    EXPECT_TRUE(found.complete);
    for (const int p : found.pairs) {
      EXPECT_LE(alone.added(p), pairs.gate_of(p));
      for (int q = 0; q < pairs.size(); ++q) {
        if (pairs.pairs[at(q)].b != pairs.pairs[at(p)].b) continue;
        EXPECT_GE(alone.added(q), alone.added(p));
      }
    }
  }
}

TEST(GlobalNearestNeighbour, HasTheLeastCostOfAllAssignments) {
  Dice dice(6);
  for (int round = 0; round < 30; ++round) {
    const CandidatePairs pairs = random_pairs(dice, 4, 2, 0.4, 1.5);
    const Hypothesis alone(pairs);
    const auto cost = [&](const std::vector<int>& some) {
      double sum = 0.0;
      std::vector<int> matched;
      for (const int p : some) {
        sum += alone.added(p);
        matched.push_back(pairs.pairs[at(p)].b);
      }
      for (int b = 0; b < 4; ++b) {
        if (std::find(matched.begin(), matched.end(), b) == matched.end()) sum += pairs.gates[2];
      }
      return sum;
    };
    std::vector<int> within;
    for (int p = 0; p < pairs.size(); ++p) {
      if (alone.added(p) <= pairs.gate_of(p)) within.push_back(p);
    }
    double least = std::numeric_limits<double>::infinity();
    for (unsigned subset = 0; subset < (1U << within.size()); ++subset) {
      std::vector<int> some;
      for (std::size_t k = 0; k < within.size(); ++k) {
        if ((subset >> k & 1U) != 0) some.push_back(within[k]);
      }
      if (one_to_one(pairs, some)) least = std::min(least, cost(some));
    }
    const Matching found = match_globally(pairs);
    EXPECT_TRUE(one_to_one(pairs, found.pairs));
    EXPECT_NEAR(cost(found.pairs), least, 1e-9);
  }
}

/// Is there an order in which every pair is within its gate given those before, and the whole
/// within the joint one?
bool jointly_compatible(const CandidatePairs& pairs, std::vector<int> some, double gate) {
  if (!one_to_one(pairs, some)) return false;
  std::sort(some.begin(), some.end());
  do {
    bool ok = true;
    std::vector<int> before;
    for (const int p : some) {
      const double without = joint_chi2(pairs, before);
      before.push_back(p);
      const double with = joint_chi2(pairs, before);
      ok = ok && with - without <= pairs.gate_of(p) &&
           with <= chi_squared_quantile(gate, 2 * static_cast<int>(before.size()));
      if (!ok) break;
    }
    if (ok) return true;
  } while (std::next_permutation(some.begin(), some.end()));
  return false;
}

TEST(JointCompatibility, FindsAsManyPairsAsLookingAtAllHypotheses) {
  Dice dice(7);
  JointOptions options;
  options.gate = 0.99;
  int most_seen = 0;
  for (int round = 0; round < 25; ++round) {
    const CandidatePairs pairs = random_pairs(dice, 4, 2, 0.25, 1.3);
    std::size_t most = 0;
    for (unsigned subset = 0; subset < (1U << pairs.pairs.size()); ++subset) {
      std::vector<int> some;
      for (int k = 0; k < pairs.size(); ++k) {
        if ((subset >> static_cast<unsigned>(k) & 1U) != 0) some.push_back(k);
      }
      if (some.size() > most && jointly_compatible(pairs, some, options.gate)) most = some.size();
    }
    const Matching found = match_jointly(pairs, options);
    EXPECT_TRUE(found.complete);
    EXPECT_TRUE(jointly_compatible(pairs, found.pairs, options.gate));
    // Which orders are tried depends on what is most certain: it may miss one, never more.
    EXPECT_GE(found.pairs.size() + 1, most);
    EXPECT_LE(found.pairs.size(), most);
    most_seen = std::max(most_seen, static_cast<int>(most));
  }
  EXPECT_GE(most_seen, 3);
}

TEST(JointCompatibility, SaysWhenItWasCutShort) {
  Dice dice(8);
  const CandidatePairs pairs = random_pairs(dice, 8, 2, 0.9, 0.3);
  JointOptions options;
  options.most_hypotheses = 3;
  const Matching found = match_jointly(pairs, options);
  EXPECT_FALSE(found.complete);
  EXPECT_LE(found.hypotheses, 4);
  EXPECT_TRUE(one_to_one(pairs, found.pairs));
}

TEST(JointCompatibility, RefusesAGateThatIsNoProbability) {
  Dice dice(9);
  JointOptions options;
  options.gate = 1.0;
  EXPECT_THROW(match_jointly(random_pairs(dice, 2, 2, 0.5), options), InputError);
}

TEST(Matchers, HaveNothingToSayOfNothing) {
  const CandidatePairs none;
  for (const Matcher m : {Matcher::kNearest, Matcher::kGlobal, Matcher::kJoint}) {
    EXPECT_TRUE(match(none, m).pairs.empty());
    EXPECT_TRUE(match(none, m).complete);
  }
  EXPECT_TRUE(certain_matches(none, {}, 1000.0).empty());
}

}  // namespace
}  // namespace mapjoin
