#include "mapjoin/association/check_matches.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>

#include "mapjoin/evaluation/chi_squared.h"
#include "mapjoin/graph/error.h"

namespace mapjoin {

namespace {

std::size_t at(std::int64_t k) { return static_cast<std::size_t>(k); }

/// Variances smaller than this, of the largest of the pair's two maps, are what the frame pins.
constexpr double kNoVariance = 1e-12;

/// The joint innovation of the pairs of one join, without what the frame pins, and K = S^-1 of those
/// that are still believed.
class JointInnovation {
 public:
  JointInnovation(const CandidatePairs& pairs, std::vector<int> chosen)
      : pairs_(pairs), chosen_(std::move(chosen)), believed_(chosen_.size(), true) {
    int rows = 0;
    for (const int p : chosen_) rows += pairs.pairs[at(p)].dim;
    Eigen::MatrixXd S(rows, rows);
    r_.resize(rows);
    std::vector<int> kept;
    int row = 0;
    for (const int p : chosen_) {
      int column = 0;
      for (const int q : chosen_) {
        const Eigen::MatrixXd block = pairs.covariance(p, q);
        S.block(row, column, block.rows(), block.cols()) = block;
        column += static_cast<int>(block.cols());
      }
      const int dim = pairs.pairs[at(p)].dim;
      r_.segment(row, dim) = pairs.innovation(p);
      const double most = S.diagonal().segment(row, dim).maxCoeff();
      start_.push_back(static_cast<int>(kept.size()));
      for (int k = row; k < row + dim; ++k) {
        if (S(k, k) > kNoVariance * most) kept.push_back(k);
      }
      row += dim;
    }
    start_.push_back(static_cast<int>(kept.size()));
    S_ = S(kept, kept);
    r_ = Eigen::VectorXd(r_(kept));
    K_ = S_.ldlt().solve(Eigen::MatrixXd::Identity(S_.rows(), S_.cols()));
    y_ = K_ * r_;
  }

  int size() const { return static_cast<int>(chosen_.size()); }
  int dimension(int k) const { return start_[at(k) + 1] - start_[at(k)]; }
  bool believed(int k) const { return believed_[at(k)]; }

  /// Chi2 of pair k given all others that are believed.
  double chi2(int k) const {
    const Eigen::VectorXd y = y_.segment(start_[at(k)], dimension(k));
    return y.dot(block(k).ldlt().solve(y));
  }

  /// Leaves pair k out: K of the others becomes K - K_.k K_kk^-1 K_k. .
  void doubt(int k) {
    believed_[at(k)] = false;
    const int first = start_[at(k)];
    const int dim = dimension(k);
    const Eigen::MatrixXd columns = K_.middleCols(first, dim);
    const Eigen::MatrixXd solved = block(k).ldlt().solve(columns.transpose());
    y_ -= solved.transpose() * y_.segment(first, dim).eval();
    K_ -= columns * solved;
    K_.middleCols(first, dim).setZero();
    K_.middleRows(first, dim).setZero();
    y_.segment(first, dim).setZero();
  }

  /// Chi2 of a doubted pair given all that are believed.
  double chi2_of_doubted(int k) const {
    const int first = start_[at(k)];
    const int dim = dimension(k);
    const Eigen::MatrixXd C = S_.middleCols(first, dim);  // K is zero where nothing is believed
    const Eigen::VectorXd r = r_.segment(first, dim) - C.transpose() * y_;
    const Eigen::MatrixXd S = S_.block(first, first, dim, dim) - C.transpose() * K_ * C;
    return r.dot(S.ldlt().solve(r));
  }

 private:
  Eigen::MatrixXd block(int k) const {
    return K_.block(start_[at(k)], start_[at(k)], dimension(k), dimension(k));
  }

  const CandidatePairs& pairs_;
  std::vector<int> chosen_;
  std::vector<bool> believed_;
  std::vector<int> start_;
  Eigen::VectorXd r_, y_;
  Eigen::MatrixXd S_, K_;
};

/// The bounds of n tests that together raise a false alarm with the given probability.
std::vector<double> bounds_of(const JointInnovation& joint, double false_alarm) {
  if (!(false_alarm > 0.0 && false_alarm < 1.0))
    throw InputError(fmt::format(
        "the probability of a false alarm must be between 0 and 1, not {}", false_alarm));
  std::vector<double> by_dimension;
  std::vector<double> out;
  for (int k = 0; k < joint.size(); ++k) {
    const int n = joint.dimension(k);
    while (static_cast<int>(by_dimension.size()) <= n) {
      const int m = static_cast<int>(by_dimension.size());
      by_dimension.push_back(
          m == 0 ? 0.0 : chi_squared_quantile(1.0 - false_alarm / joint.size(), m));
    }
    out.push_back(by_dimension[at(n)]);
  }
  return out;
}

/// Doubts the worst pair, as often as one is above its bound.
void doubt_the_worst(JointInnovation& joint, const std::vector<double>& bounds) {
  for (;;) {
    int worst = -1;
    double excess = 1.0;
    for (int k = 0; k < joint.size(); ++k) {
      if (!joint.believed(k) || joint.dimension(k) == 0) continue;
      const double here = joint.chi2(k) / bounds[at(k)];
      if (here <= excess) continue;
      excess = here;
      worst = k;
    }
    if (worst < 0) return;
    joint.doubt(worst);
  }
}

}  // namespace

template <int D>
std::vector<TestedPair> test_pairs(const ComparedMaps<D>& maps, const CandidatePairs& pairs,
                                   std::span<const int> chosen, double false_alarm) {
  std::vector<int> all;
  for (int p = 0; p < pairs.known; ++p) all.push_back(p);
  all.insert(all.end(), chosen.begin(), chosen.end());
  if (all.empty()) return {};
  JointInnovation joint(pairs, all);
  const std::vector<double> bounds = bounds_of(joint, false_alarm);
  doubt_the_worst(joint, bounds);
  std::vector<TestedPair> out;
  for (int k = 0; k < joint.size(); ++k) {
    const CandidatePairs::Pair& pair = pairs.pairs[at(all[at(k)])];
    TestedPair tested{maps.a.variables().key(pair.a), maps.b.variables().key(pair.b), 0.0,
                      joint.dimension(k), bounds[at(k)], false};
    if (tested.dimension > 0)
      tested.chi2 = joint.believed(k) ? joint.chi2(k) : joint.chi2_of_doubted(k);
    tested.flagged = !joint.believed(k) && tested.chi2 > tested.bound;
    out.push_back(tested);
  }
  return out;
}

template <int D>
std::vector<TestedPair> check_matches(const Map<D>& a, const Map<D>& b, double false_alarm) {
  const ComparedMaps<D> maps = in_common_frame(a, b);
  return test_pairs<D>(maps, common_pairs(maps), {}, false_alarm);
}

#define MAPJOIN_INSTANTIATE(D)                                                                \
  template std::vector<TestedPair> test_pairs<D>(const ComparedMaps<D>&, const CandidatePairs&, \
                                                 std::span<const int>, double);               \
  template std::vector<TestedPair> check_matches<D>(const Map<D>&, const Map<D>&, double);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
