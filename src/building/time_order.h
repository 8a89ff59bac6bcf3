// The measurements of a recording in order of time.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mapjoin/building/raw_log.h"

namespace mapjoin {

/// Poses are times 0, 1, 2, ... in the order of their keys. A measurement belongs to the pose that
/// takes it, a relative pose to the later of both.
class TimeOrder {
 public:
  template <int D>
  explicit TimeOrder(const RawLog<D>& log);

  int poses() const { return static_cast<int>(start_.size()) - 1; }
  /// The time of a pose, by its number in the recording.
  int time(int variable) const { return variable - first_pose_; }
  /// Measurements of time t, ascending.
  std::span<const std::int64_t> at(int t) const {
    const auto first = static_cast<std::size_t>(start_[static_cast<std::size_t>(t)]);
    const auto end = static_cast<std::size_t>(start_[static_cast<std::size_t>(t) + 1]);
    return std::span(members_).subspan(first, end - first);
  }
  /// The first time after t at which a variable is a target, -1 when there is none.
  int next_sight(int variable, int t) const;

 private:
  int first_pose_ = 0;
  std::vector<std::int64_t> start_{0};
  std::vector<std::int64_t> members_;
  std::vector<std::int64_t> sight_start_;  ///< per variable, into sights_
  std::vector<int> sights_;                ///< times, ascending
};

}  // namespace mapjoin
