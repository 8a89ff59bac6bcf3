#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "mapjoin/filtering/slsjf.h"
#include "mapjoin/solvers/growing_covariance.h"

/// \file
/// Sequential map joining by an extended Kalman filter (Tardos et al. 2002; Williams' CLSF): the
/// dense baseline that SLSJF is measured against.
///
/// The state is the last pose and every feature; the covariance matrix P is kept, dense. It
/// linearises where SLSJF does, so it is SLSJF in another form, without the earlier poses: the two
/// agree to rounding on points of the plane. Fusing a local map costs O(n^2 m) for a state of n and
/// m scalars that the local map has in common with it, and P takes 8 n^2 bytes and room to grow.

namespace mapjoin {

template <int D>
class EkfJoin {
 public:
  EkfJoin() = default;

  /// Writes the local map in the global frame by the last pose, adds it to the state, and makes
  /// what is there twice equal, by one update without noise; earlier poses are dropped. In a
  /// Fusion, seconds_update is the writing and seconds_factor the Kalman update. \throws InputError
  /// when the local map is not in the frame of a pose; DisconnectedError when that is not in the
  /// state; SingularError when the local map has no covariance.
  Fusion fuse(const LocalMap<D>& local_map);

  int fused() const { return fused_; }
  /// Scalars of the state.
  int scalars() const { return estimate_.variables().scalars(); }
  /// Estimates of the last pose and the features, and the first start pose, the frame.
  Values<D> values() const;
  /// The same with its information, P^-1, in the frame of the first start pose. O(n^3).
  Map<D> map() const;
  /// Joint covariance of some variables in their tangents at the estimates; zero for the first
  /// start pose. \throws InputError that names an unknown key.
  Eigen::MatrixXd covariance(std::span<const Key> keys) const;

 private:
  struct Beside;
  std::vector<int> enter(const VariableSet<D>& variables, const Eigen::MatrixXd& cross,
                         const Eigen::MatrixXd& own);
  void update(Beside& beside);
  void move(Values<D>& x, const std::vector<int>& rows, const Eigen::VectorXd& d);
  void keep(const Beside& beside);
  std::vector<int> scalar_rows() const;

  Anchor<D> anchor_;
  Values<D> estimate_;
  std::vector<int> rows_;  ///< of each variable, the first in P
  GrowingCovariance P_;    ///< in the tangents at the estimates
  int fused_ = 0;
};

/// Fuses all local maps in their order. \throws as EkfJoin::fuse; CancelledError.
template <int D>
FilterResult<D> ekf_join(std::span<const LocalMap<D>> local_maps,
                         const ProgressCallback& progress = {});

extern template class EkfJoin<2>;
extern template class EkfJoin<3>;

}  // namespace mapjoin
