#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "mapjoin/building/raw_log.h"
#include "mapjoin/graph/map.h"
#include "mapjoin/joining/options.h"

namespace mapjoin {

/// EKF SLAM over a whole recording: the classical filter that submap joining replaces, to measure
/// against (SLSJF section IV, D-SLAM map joining section VII).
///
///     EkfSlam<2> slam(log);
///     while (slam.step()) watch(slam.values(), slam.covariance(point_key(84)));
///     const Map<2> map = slam.map();
///
/// The state is the present pose and every feature so far, in the frame of the first pose; poses
/// are dropped when nothing refers to them any more (a loop closure to a pose keeps it until then).
/// Its covariance is dense: of n scalars 8 n^2 bytes, and n^2 m operations at every pose that
/// measures m scalars. Everything is linearised once, so errors in heading stay in the map. What it
/// does pose by pose is in building/kalman_filter.h.
template <int D>
class EkfSlam {
 public:
  /// Refers to the recording as long as it lives. \throws DisconnectedError when the recording's
  /// poses fall apart: a filter has one frame.
  explicit EkfSlam(const RawLog<D>& log);
  explicit EkfSlam(RawLog<D>&&) = delete;
  ~EkfSlam();
  EkfSlam(EkfSlam&&) noexcept;
  EkfSlam& operator=(EkfSlam&&) noexcept;

  /// The next pose and all that is measured there. \returns false when there was none left.
  /// \throws SingularError when the covariance has lost its definiteness.
  bool step();

  /// How many poses there are, and how many were taken.
  int poses() const;
  int taken() const;
  /// Scalars of the state.
  int scalars() const;
  /// Measurements of features that nothing places: not used.
  std::int64_t refused() const;
  bool knows(const Key& key) const;
  /// Estimates of what is in the state, and the first pose.
  Values<D> values() const;
  /// Covariance of one variable in its tangent at the estimate. \throws InputError for a key that
  /// is not in the state.
  Eigen::MatrixXd covariance(const Key& key) const;
  /// The state with its information, P^-1, in the frame of the first pose. O(n^3).
  Map<D> map() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// What a filter that ran over a whole recording ends with.
template <int D>
struct SlamResult {
  Map<D> map;
  std::vector<double> seconds;  ///< of every pose, in order of time
  std::int64_t refused = 0;     ///< measurements not used
};

/// Runs EkfSlam to the end. \throws as it does; CancelledError.
template <int D>
SlamResult<D> ekf_slam(const RawLog<D>& log, const ProgressCallback& progress = {});

extern template class EkfSlam<2>;
extern template class EkfSlam<3>;

}  // namespace mapjoin
