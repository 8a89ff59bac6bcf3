// The measurements of one local map, and values to start from.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "mapjoin/building/raw_log.h"
#include "mapjoin/building/robust_loss.h"
#include "mapjoin/graph/values.h"

namespace mapjoin {

/// One measurement of a local map, between its variables.
template <int D>
struct LocalMeasurement {
  const ModelKind<D>* model = nullptr;
  int from = 0;  ///< numbers in the local map
  int to = 0;
  const double* z = nullptr;  ///< in the recording
  const double* info = nullptr;
  std::int64_t number = 0;  ///< in the recording
};

/// A part of a recording that is one rigid piece: its poses hang together by relative poses.
///
/// Numbers of poses ascend in time; the first is where the local map starts.
template <int D>
struct LocalProblem {
  VariableSet<D> variables;
  std::vector<int> numbers;                       ///< of the variables, in the recording
  std::vector<LocalMeasurement<D>> measurements;  ///< ascending by number

  bool is_pose(int i) const { return variables.kind(i).tag == Tag("pose"); }
  int first_pose() const { return variables.column(variables.find_column(Tag("pose"))).first; }
  /// From a pose to a neighbour in time: what holds the trajectory together, and what robust losses
  /// leave alone.
  bool is_odometry(const LocalMeasurement<D>& m) const {
    return is_pose(m.to) && (m.to == m.from + 1 || m.from == m.to + 1);
  }
  /// How often a measurement counts whose r^T I r is s.
  double weight(const LocalMeasurement<D>& m, const RobustLoss& loss, double s) const {
    return is_odometry(m) ? 1.0 : loss.weight(s);
  }
  /// The pose that takes a measurement; of a relative pose, the later of both.
  int time_of(const LocalMeasurement<D>& m) const {
    return is_pose(m.to) ? std::max(m.from, m.to) : m.from;
  }
  int last_pose() const { return variables.column(variables.find_column(Tag("pose"))).end() - 1; }
};

/// Measurements as one problem, or several where their poses fall apart. Features seen from several
/// pieces are in each. In order of their first poses. O(n log n).
template <int D>
std::vector<LocalProblem<D>> local_problems(const RawLog<D>& log,
                                            std::span<const std::int64_t> measurements);

/// The problem without some of its measurements (ascending numbers of the recording), and without
/// the variables that nothing is left to say of; the first pose stays.
template <int D>
LocalProblem<D> without(const LocalProblem<D>& problem, std::span<const std::int64_t> measurements);

/// Where the chain of measurements puts everything, in the frame of the first pose.
template <int D>
struct InitialValues {
  Values<D> values;
  std::vector<char> known;  ///< of each variable: is it placed yet?
};

/// Poses along the fewest measurements from the first (`in_order`: along the odometry, where wrong
/// loop closures must not be trusted), features from their first complete measurement (`in_order`:
/// from the one that agrees best with the others). Features without one stay unknown.
template <int D>
InitialValues<D> initial_values(const LocalProblem<D>& problem, bool in_order);

}  // namespace mapjoin
