#pragma once

#include <span>
#include <vector>

#include "mapjoin/filtering/information_filter.h"
#include "mapjoin/filtering/observed_map.h"
#include "mapjoin/joining/options.h"

/// \file
/// The Sparse Local Submap Joining Filter (Huang, Wang, Dissanayake, T-RO 2008).
///
/// Local maps are fused one after another. The state is every feature and every local map's end
/// pose, in the frame in which the first local map begins; nothing is marginalised, so the
/// information matrix is exactly sparse. A local map is linearised once, when it arrives, and never
/// again: that is what distinguishes the filter from joining with `observe` or `optimal`, and what
/// it loses on long loops. I-SLSJF makes that good at the end.

namespace mapjoin {

/// Algorithms 1 and 2.
///
///     Slsjf<2> filter;
///     for (const LocalMap<2>& map : set.maps) filter.fuse(map);
///     const Map<2> joined = filter.map();
///
/// Local maps may hold variables of any type, in the plane and in space, anchored at poses or at
/// points. Not thread-safe; different filters are independent.
template <int D>
class Slsjf {
 public:
  explicit Slsjf(const FilterOptions& options = {});

  /// Fuses the next local map (Algorithm 2 without data association: equal keys are equal
  /// variables). Cost: what the order asks for (III-G), and a solve with the whole factor. \throws
  /// InputError; DisconnectedError, before anything has changed; SingularError that names a
  /// variable which the local maps so far do not determine: the filter is then of no more use.
  Fusion fuse(const LocalMap<D>& local_map);

  int fused() const { return fused_; }
  const InformationFilter<D>& filter() const { return filter_; }
  /// The map so far: estimate, and information that is gauge-free, in the frame of the first start
  /// pose.
  Map<D> map() const { return filter_.map(); }
  Values<D> values() const { return filter_.state().values(); }
  /// Joint covariance of some variables, exact, by sparse solves (III-C3), in the frame of the
  /// first start pose; rows are tangents at the estimates. \throws InputError that names an unknown
  /// key.
  Eigen::MatrixXd covariance(std::span<const Key> keys);

  /// Sums up I and i anew at the present estimate and solves (V-G). \throws InputError unless
  /// `relinearise_every` is positive: the local maps are not kept.
  Fusion relinearise();

 private:
  FilterOptions options_;
  InformationFilter<D> filter_;
  std::vector<MeasurementGraph<D>> kept_;  ///< when relinearising is asked for
  int focus_ = -1;
  int fused_ = 0;
};

/// What a sequence of fusions took.
struct FilterReport {
  std::vector<Fusion> fusions;  ///< one for each local map
  std::int64_t nonzeros = 0;    ///< of the information matrix at the end
  std::int64_t factor_nonzeros = 0;
  int scalars = 0;        ///< of the state at the end
  int refine_solves = 0;  ///< of an iterated method
  double seconds_refine = 0.0;
  double chi2 = 0.0;    ///< over all local maps, at the end
  bool minimum = true;  ///< of an iterated method: it ended in one

  /// Seconds of all fusions, by step.
  Fusion total() const {
    Fusion sum;
    for (const Fusion& fusion : fusions) sum.add_seconds(fusion);
    return sum;
  }
  /// How many of them reordered the state.
  int reordered() const {
    int count = 0;
    for (const Fusion& fusion : fusions) count += fusion.reordered ? 1 : 0;
    return count;
  }
};

template <int D>
struct FilterResult {
  Map<D> map;
  FilterReport report;
};

/// Fuses all local maps in their order. \throws as Slsjf::fuse; CancelledError.
template <int D>
FilterResult<D> slsjf(std::span<const LocalMap<D>> local_maps, const FilterOptions& options = {},
                      const ProgressCallback& progress = {});

/// I-SLSJF: the estimate of SLSJF, then smoothing over all local maps as integrated observations:
/// the nonlinear least squares optimum (joining/refine.h). The map keeps them.
template <int D>
FilterResult<D> islsjf(std::span<const LocalMap<D>> local_maps, const FilterOptions& options = {},
                       const ProgressCallback& progress = {});

/// The second half alone, from any estimate of all variables of the local maps; `anchor` is the
/// frame of the result.
template <int D>
FilterResult<D> smooth(std::span<const LocalMap<D>> local_maps, const Values<D>& estimate,
                       const Anchor<D>& anchor, const ProgressCallback& progress = {});

/// chi2 of an estimate of all variables of the local maps: the sum of r^T I r over them.
template <int D>
double chi2_of(std::span<const LocalMap<D>> local_maps, const Values<D>& estimate);

/// The fusions of one report and the smoothing of another.
FilterReport with_fusions(FilterReport fusions, const FilterReport& smoothing);

extern template class Slsjf<2>;
extern template class Slsjf<3>;

}  // namespace mapjoin
