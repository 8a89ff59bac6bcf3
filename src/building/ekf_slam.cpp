#include "mapjoin/building/ekf_slam.h"

#include <fmt/format.h>

#include <numeric>
#include <utility>

#include "mapjoin/building/kalman_filter.h"
#include "mapjoin/building/prepared.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/joining/report.h"

namespace mapjoin {

template <int D>
struct EkfSlam<D>::State {
  Prepared<D> prepared;
  KalmanFilter<D> filter;
  std::int64_t refused = 0;

  State(Prepared<D> p, std::int64_t measurements)
      : prepared(std::move(p)),
        filter(prepared.problem, prepared.values, kept(prepared.problem)),
        refused(measurements - static_cast<std::int64_t>(prepared.problem.measurements.size())) {}

  /// All but the poses before the last.
  static std::vector<char> kept(const LocalProblem<D>& problem) {
    std::vector<char> out(static_cast<std::size_t>(problem.variables.size()), 1);
    for (int i = problem.first_pose(); i < problem.last_pose(); ++i)
      out[static_cast<std::size_t>(i)] = 0;
    return out;
  }
  int require(const Key& key) const {
    const auto i = prepared.problem.variables.find(key);
    if (!i || !filter.knows(*i))
      throw InputError(fmt::format("{} is not in the state of the filter", to_string(key)));
    return *i;
  }
};

template <int D>
EkfSlam<D>::EkfSlam(const RawLog<D>& log) {
  std::vector<std::int64_t> all(log.size());
  std::iota(all.begin(), all.end(), 0);
  std::vector<Prepared<D>> pieces = prepare(log, std::span<const std::int64_t>(all), false);
  if (pieces.size() != 1)
    throw DisconnectedError(
        pieces.empty()
            ? std::string(
                  "no feature can be placed by its measurements: there is nothing to filter")
            : fmt::format(
                  "the poses of the recording are {} pieces that no measurement links; the "
                  "one of {} stands apart",
                  pieces.size(),
                  to_string(pieces[1].problem.variables.key(pieces[1].problem.first_pose()))));
  state_ = std::make_unique<State>(std::move(pieces[0]), static_cast<std::int64_t>(all.size()));
}

template <int D>
EkfSlam<D>::~EkfSlam() = default;
template <int D>
EkfSlam<D>::EkfSlam(EkfSlam&&) noexcept = default;
template <int D>
EkfSlam<D>& EkfSlam<D>::operator=(EkfSlam&&) noexcept = default;

template <int D>
bool EkfSlam<D>::step() {
  return state_->filter.step();
}

template <int D>
int EkfSlam<D>::poses() const {
  const LocalProblem<D>& problem = state_->prepared.problem;
  return problem.last_pose() + 1 - problem.first_pose();
}

template <int D>
int EkfSlam<D>::taken() const {
  return state_->filter.poses();
}

template <int D>
int EkfSlam<D>::scalars() const {
  return state_->filter.scalars();
}

template <int D>
std::int64_t EkfSlam<D>::refused() const {
  return state_->refused;
}

template <int D>
bool EkfSlam<D>::knows(const Key& key) const {
  const auto i = state_->prepared.problem.variables.find(key);
  return i && state_->filter.knows(*i);
}

template <int D>
Values<D> EkfSlam<D>::values() const {
  ValuesBuilder<D> builder;
  const VariableSet<D>& variables = state_->prepared.problem.variables;
  for (const int i : state_->filter.known())
    builder.add(variables.kind(i), variables.key(i), state_->filter.value(i));
  return std::move(builder).build();
}

template <int D>
Eigen::MatrixXd EkfSlam<D>::covariance(const Key& key) const {
  return state_->filter.covariance(state_->require(key));
}

template <int D>
Map<D> EkfSlam<D>::map() const {
  return state_->filter.map();
}

template <int D>
SlamResult<D> ekf_slam(const RawLog<D>& log, const ProgressCallback& progress) {
  EkfSlam<D> slam(log);
  SlamResult<D> out;
  out.refused = slam.refused();
  for (bool more = true; more;) {
    if (progress && !progress({"filter", static_cast<double>(slam.taken()) / slam.poses()}))
      throw CancelledError("cancelled while filtering a recording");
    const auto start = Clock::now();
    more = slam.step();
    if (!more) break;
    // What waited for the last pose is part of it.
    if (static_cast<int>(out.seconds.size()) < slam.poses()) out.seconds.push_back(0.0);
    out.seconds.back() += seconds_since(start);
  }
  out.map = slam.map();
  return out;
}

template class EkfSlam<2>;
template class EkfSlam<3>;
template SlamResult<2> ekf_slam<2>(const RawLog<2>&, const ProgressCallback&);
template SlamResult<3> ekf_slam<3>(const RawLog<3>&, const ProgressCallback&);

}  // namespace mapjoin
