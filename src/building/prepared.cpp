#include "mapjoin/building/prepared.h"

#include <utility>

#include "mapjoin/building/delayed.h"

namespace mapjoin {

template <int D>
LocalProblem<D> with_all_placed(LocalProblem<D> problem, InitialValues<D>& values) {
  const std::vector<std::int64_t> refused = place_delayed(problem, values);
  if (refused.empty()) return problem;
  LocalProblem<D> rest = without(problem, std::span(refused));
  std::vector<int> kept = numbers_in(rest.variables, problem.variables);
  values.values = subset(values.values, std::span<const int>(kept));
  values.known.assign(kept.size(), 1);
  return rest;
}

template <int D>
std::vector<Prepared<D>> prepare(const RawLog<D>& log, std::span<const std::int64_t> measurements,
                                 bool in_order) {
  std::vector<Prepared<D>> out;
  for (LocalProblem<D>& problem : local_problems(log, measurements)) {
    InitialValues<D> values = initial_values(problem, in_order);
    problem = with_all_placed(std::move(problem), values);
    if (!problem.measurements.empty()) out.push_back({std::move(problem), std::move(values)});
  }
  return out;
}

template LocalProblem<2> with_all_placed<2>(LocalProblem<2>, InitialValues<2>&);
template LocalProblem<3> with_all_placed<3>(LocalProblem<3>, InitialValues<3>&);
template std::vector<Prepared<2>> prepare<2>(const RawLog<2>&, std::span<const std::int64_t>, bool);
template std::vector<Prepared<3>> prepare<3>(const RawLog<3>&, std::span<const std::int64_t>, bool);

}  // namespace mapjoin
