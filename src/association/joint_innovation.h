#pragma once

#include <Eigen/Core>
#include <vector>

#include "mapjoin/association/candidates.h"

namespace mapjoin {

/// The joint innovation of the pairs that a join fuses, and what each pair's innovation is given
/// all the others.
///
/// With the innovations r of the pairs, their joint covariance S and K = S^-1, pair p given all
/// others has the innovation K_pp^-1 (K r)_p with covariance K_pp^-1. What the frame pins has no
/// variance and is left out: such a pair has fewer dimensions, or none. O(scalars^3) to set up.
class JointInnovation {
 public:
  /// Of these pairs, all of them believed.
  JointInnovation(const CandidatePairs& pairs, const std::vector<int>& chosen);

  int size() const { return static_cast<int>(start_.size()) - 1; }
  int dimension(int k) const {
    return start_[static_cast<std::size_t>(k) + 1] - start_[static_cast<std::size_t>(k)];
  }
  bool believed(int k) const { return believed_[static_cast<std::size_t>(k)]; }

  /// Chi2 of a believed pair given all others that are.
  double chi2(int k) const;
  /// Its log-likelihood given all others that are: log N(r; 0, S), of the innovation.
  double log_likelihood(int k) const;
  /// No longer believes pair k: what it says of the others no longer counts. O(scalars^2).
  void doubt(int k);
  /// Chi2 of a doubted pair given all that are believed.
  double chi2_of_doubted(int k) const;

 private:
  Eigen::MatrixXd block(int k) const;

  std::vector<bool> believed_;
  std::vector<int> start_;  // per pair: first row; and the end
  Eigen::VectorXd r_, y_;   // y = K r
  Eigen::MatrixXd S_, K_;   // K has zero rows and columns where nothing is believed
};

}  // namespace mapjoin
