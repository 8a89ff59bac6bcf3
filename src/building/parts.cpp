#include "mapjoin/building/parts.h"

#include <Eigen/Dense>
#include <algorithm>
#include <iterator>
#include <utility>

namespace mapjoin {

template <int D>
std::vector<LocalProblem<D>> parts_of(const RawLog<D>& log, const LocalProblem<D>& problem) {
  const int poses = problem.last_pose() - problem.first_pose() + 1;
  std::vector<std::vector<std::int64_t>> members(
      static_cast<std::size_t>(std::max(1, (poses - 1) / kPartPoses)));
  for (const auto& m : problem.measurements) {
    const int time = problem.time_of(m) - problem.first_pose();
    const auto part = static_cast<std::size_t>(std::max(0, time - 1) / kPartPoses);
    members[std::min(part, members.size() - 1)].push_back(m.number);  // the last is a bit longer
  }
  std::vector<LocalProblem<D>> out;
  for (const auto& part : members) {
    std::vector<LocalProblem<D>> pieces = local_problems(log, std::span(part));
    std::move(pieces.begin(), pieces.end(), std::back_inserter(out));
  }
  return out;
}

template <int D>
double cost(const LocalProblem<D>& problem, const RobustLoss& loss, const InitialValues<D>& at,
            const InitialValues<D>& other) {
  double sum = 0.0;
  Eigen::VectorXd r;
  for (const auto& m : problem.measurements) {
    const auto to = static_cast<std::size_t>(m.to);
    if (!at.known[to] || !other.known[to]) continue;
    r.resize(m.model->dim);
    m.model->residual(m.z, at.values.value(m.from), nullptr, at.values.value(m.to), nullptr,
                      r.data());
    const double s = r.dot(Eigen::Map<const Eigen::MatrixXd>(m.info, r.size(), r.size()) * r);
    double rho[3] = {s, 1.0, 0.0};
    if (!problem.is_odometry(m)) loss.evaluate(s, rho);
    sum += rho[0];
  }
  return sum;
}

#define MAPJOIN_INSTANTIATE(D)                                                                 \
  template std::vector<LocalProblem<D>> parts_of<D>(const RawLog<D>&, const LocalProblem<D>&); \
  template double cost<D>(const LocalProblem<D>&, const RobustLoss&, const InitialValues<D>&,  \
                          const InitialValues<D>&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
