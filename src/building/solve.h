#pragma once

#include "mapjoin/building/build.h"
#include "mapjoin/joining/join_all.h"

namespace mapjoin {

/// A recording solved by local maps.
template <int D>
struct SolvedLog {
  JoinResult<D> result;
  std::size_t local_maps = 0;
  std::size_t refused = 0;     ///< measurements, see BuiltMaps
  double seconds_build = 0.0;  ///< recording to local maps
  double seconds_join = 0.0;   ///< local maps to one
};

/// Builds local maps and joins them.
///
/// The local maps are all that `paper`, `summary` and `observe` join: each is one integrated
/// observation of all its variables. Observing joins end with three solves at the root instead of
/// two: large local maps meet at larger angles there than the measurements of a graph do. In
/// `optimal` they are joined in observe mode, and the result is refined over the measurements
/// themselves where those are integrated observations (relative poses, points: as_graph()) and the
/// maps keep everything: the answer then does not depend on how the recording was cut. Otherwise
/// the optimum is that over the local maps. chi2 in the report is over the measurements where they
/// are such observations, else over the local maps.
template <int D>
SolvedLog<D> solve_by_local_maps(const RawLog<D>& log, const Segmentation& segmentation,
                                 const BuildOptions& building, const JoinOptions& joining);

/// Moves a joined map to the least squares optimum over other measurements of its variables, by
/// repeated linear solves (I-SLSJF): `graph` is what the map will carry as its observations.
/// \throws InputError when the graph has a variable that no map has. \returns what refine() says.
template <int D>
void refine_over(const std::shared_ptr<const MeasurementGraph<D>>& graph, JoinResult<D>& result,
                 const JoinOptions& options);

}  // namespace mapjoin
