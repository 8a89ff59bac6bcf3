#pragma once

#include <Eigen/Core>
#include <vector>

#include "mapjoin/association/candidates.h"

namespace mapjoin {

/// A set of pairs taken to be right, and what that makes of all the others.
///
/// Taking pairs as right conditions the innovations of the rest on theirs:
///
///     r_p | H,  S_pp | H,   chi2 that p would add = (r_p | H)^T (S_pp | H)^-1 (r_p | H)
///
/// and the sum of what its pairs added is the joint chi2 of the hypothesis, in whatever order they
/// were taken. One block column of a Cholesky factor a pair: O(rows of all pairs * scalars taken).
/// Directions without variance (what the frame pins) say nothing and add nothing.
class Hypothesis {
 public:
  /// The known pairs taken, none of the candidates.
  explicit Hypothesis(const CandidatePairs& pairs);

  void take(int p);
  /// Takes back the last one taken.
  void drop();

  const std::vector<int>& taken() const { return taken_; }  ///< candidates, in order
  double chi2() const { return chi2_; }  ///< joint, of the taken candidates given the known ones
  int dimension() const { return dimension_; }  ///< degrees of freedom of it

  /// The chi2 that p would add given what is taken.
  double added(int p) const { return added_[static_cast<std::size_t>(p)]; }
  /// log N(r; 0, S) of the innovation of p given what is taken; without the directions that have no
  /// variance.
  double log_likelihood(int p) const { return log_likelihood_[static_cast<std::size_t>(p)]; }
  /// Covariance of the innovation of p given what is taken: dim x dim.
  Eigen::Map<const Eigen::MatrixXd> spread(int p) const;

 private:
  void condition(int p);
  void judge_pairs();

  struct Saved {
    Eigen::VectorXd innovations;
    std::vector<double> blocks, added, log_likelihood;
    double chi2;
    int dimension;
    Eigen::Index columns;
  };

  const CandidatePairs& pairs_;
  Eigen::VectorXd innovations_;  // given what is taken
  std::vector<double> blocks_;   // S_pp given what is taken, one after another
  std::vector<std::size_t> block_start_;
  Eigen::VectorXd variances_;                   // of the innovations before anything was taken
  std::vector<double> added_, log_likelihood_;  // per pair
  Eigen::MatrixXd factor_;  // first columns_ columns: rows of all pairs of the Cholesky factor
  Eigen::Index columns_ = 0;
  std::vector<int> taken_;
  std::vector<Saved> saved_;
  double chi2_ = 0.0;
  int dimension_ = 0;
};

}  // namespace mapjoin
