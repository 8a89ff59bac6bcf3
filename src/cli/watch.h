#pragma once

#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "mapjoin/building/raw_log.h"
#include "mapjoin/filtering/methods.h"

namespace mapjoin::cli {

/// What there is to compare methods on.
template <int D>
struct Subject {
  std::vector<LocalMap<D>> maps;
  std::optional<RawLog<D>> log;  ///< the recording that they were built from
};

/// What a method knew of a feature at some time.
template <int D>
struct Sight {
  int time = 0;  ///< poses that were before; without a recording, local maps fused
  Vec<D> estimate;
  Vec<D> sigma;  ///< standard deviations of its coordinates
};

/// A feature over time (as in Fig. 4 of D-SLAM map joining).
template <int D>
struct Watched {
  Key key;
  std::vector<Sight<D>> sights;
};

/// Runs a method that has a map after every local map (slsjf, dslam, ekf), or EKF SLAM over the
/// recording (`whole_run`), once more and looks at some points of it all the time. Of other methods
/// nothing can be watched: empty. \throws as the method does.
template <int D>
std::vector<Watched<D>> watch(Method method, bool whole_run, const FilterOptions& options,
                              const Subject<D>& subject, std::span<const Key> points);

}  // namespace mapjoin::cli
