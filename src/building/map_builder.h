// One local map, from its measurements to its frame.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "mapjoin/building/build.h"
#include "mapjoin/building/local_problem.h"
#include "mapjoin/building/nonlinear.h"

namespace mapjoin {

/// A local map, and what went into it.
template <int D>
struct BuiltMap {
  std::optional<Map<D>> map;       ///< none where nothing can be placed
  std::vector<std::int64_t> used;  ///< measurements, in any order
  SolveSummary summary;
};

/// Builds local maps one by one, by the same options. Thread-safe.
template <int D>
class MapBuilder {
 public:
  /// `maps_of`: in how many local maps a variable of the recording is. All are only referred to.
  MapBuilder(const RawLog<D>& log, const BuildOptions& options, const std::vector<int>& maps_of)
      : log_(log), options_(options), maps_of_(maps_of) {}

  /// \throws as build_local_maps().
  BuiltMap<D> build(LocalProblem<D> problem) const;

 private:
  /// A map in the frame of its first pose, before anything is left out that was not left out on the
  /// way.
  struct Solved {
    LocalProblem<D> problem;  ///< without what could not be placed
    Map<D> map;
    SolveSummary summary;
  };

  Solved solved(LocalProblem<D> problem, const std::vector<char>& keep) const;
  Solved minimised(LocalProblem<D> problem, InitialValues<D> values) const;
  Solved filtered(LocalProblem<D> problem, InitialValues<D> values,
                  const std::vector<char>& keep) const;
  Solved joined_parts(LocalProblem<D> problem, const std::vector<char>& keep) const;
  std::vector<Map<D>> joined_starts(const LocalProblem<D>& problem) const;
  InitialValues<D> start_of(const LocalProblem<D>& problem) const;
  std::vector<char> kept(const LocalProblem<D>& problem) const;
  bool is_large(const LocalProblem<D>& problem, const std::vector<char>& keep) const;
  bool robust() const { return options_.loss.shape != RobustLoss::Shape::kNone; }

  const RawLog<D>& log_;
  const BuildOptions& options_;
  const std::vector<int>& maps_of_;
};

extern template class MapBuilder<2>;
extern template class MapBuilder<3>;

}  // namespace mapjoin
