// EKF-SLAM over one rigid piece of a recording, pose by pose.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "mapjoin/building/local_problem.h"
#include "mapjoin/graph/map.h"
#include "mapjoin/solvers/growing_covariance.h"

namespace mapjoin {

/// EKF-SLAM in the frame of the first pose (SLSJF section II-B): the state is predicted by each
/// measurement that reaches a new pose, augmented by the first complete measurement of a feature,
/// and updated once a pose by all others taken there. Every measurement is linearised once, where
/// the filter believes to be then.
///
/// `keep` marks variables; other poses are dropped when nothing refers to them any more, which is
/// what makes a filter cheap. `values` says where features are that no single measurement places
/// (delayed.h): their measurements are the last, when all that is known of the poses is in.
///
/// A pose costs O(n^2 m) for a state of n and m scalars measured there, and P takes 8 n^2 bytes.
template <int D>
class KalmanFilter {
 public:
  /// Refers to `problem` as long as it lives.
  KalmanFilter(const LocalProblem<D>& problem, const InitialValues<D>& values,
               std::span<const char> keep);

  /// Takes all that is measured at the next pose; after the last one, what waited for it.
  /// \returns whether there was anything left to take. \throws SingularError when the covariance
  /// has lost its definiteness.
  bool step();

  /// Poses taken so far.
  int poses() const { return std::min(time_, problem_->last_pose() + 1) - problem_->first_pose(); }
  /// Scalars of the state.
  int scalars() const;
  /// Sum of the normalised innovations squared.
  double chi2() const { return chi2_; }
  bool knows(int variable) const { return row_[static_cast<std::size_t>(variable)] != kAbsent; }
  const double* value(int variable) const { return values_.value(variable); }
  /// Covariance of one variable in its tangent; zero for the first pose.
  Eigen::MatrixXd covariance(int variable) const;
  /// Numbers of the variables in the state and of the first pose, ascending.
  std::vector<int> known() const;

  /// All of them, with exact gauge-free information, J^T P^-1 J. O(n^3). \throws SingularError.
  Map<D> map() const;

 private:
  static constexpr int kAbsent = -1;
  static constexpr int kFixed = -2;

  int first() const { return problem_->first_pose(); }
  const VariableKind<D>& kind(int i) const { return problem_->variables.kind(i); }
  bool waits(int i) const { return waits_[static_cast<std::size_t>(i)] != 0; }
  bool reaches(const LocalMeasurement<D>& m) const { return knows(m.from) && knows(m.to); }
  void take();
  int enter(int variable);
  void augment(const LocalMeasurement<D>& m);
  void update(const std::vector<int>& measurements);
  void move(const Eigen::VectorXd& d);
  void forget();
  [[noreturn]] void throw_indefinite() const;

  const LocalProblem<D>* problem_;
  Values<D> values_;
  std::vector<char> keep_, waits_;
  std::vector<int> row_;              ///< of each variable: first row in P; kAbsent; kFixed
  std::vector<int> present_;          ///< variables that have rows
  std::vector<int> last_use_;         ///< time after which no measurement refers to a variable
  std::vector<std::vector<int>> at_;  ///< measurements by time
  std::vector<int> waiting_;          ///< measurements that do not reach the state yet
  int time_ = 0;
  GrowingCovariance P_;
  double chi2_ = 0.0;
};

extern template class KalmanFilter<2>;
extern template class KalmanFilter<3>;

}  // namespace mapjoin
