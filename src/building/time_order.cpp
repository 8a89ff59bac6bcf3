#include "mapjoin/building/time_order.h"

#include <algorithm>
#include <numeric>

namespace mapjoin {

namespace {

/// CSR of `count` keys: where the entries of each begin.
std::vector<std::int64_t> starts(const std::vector<int>& keys, int count) {
  std::vector<std::int64_t> out(static_cast<std::size_t>(count) + 1, 0);
  for (const int k : keys) ++out[static_cast<std::size_t>(k) + 1];
  std::partial_sum(out.begin(), out.end(), out.begin());
  return out;
}

}  // namespace

template <int D>
TimeOrder::TimeOrder(const RawLog<D>& log) {
  const auto& poses = log.variables.column(log.variables.find_column(Tag("pose")));
  first_pose_ = poses.first;
  std::vector<int> times, targets;
  for (const auto& c : log.columns) {
    const bool of_poses = c.model->target->tag == Tag("pose");
    for (std::size_t k = 0; k < c.size(); ++k) {
      times.push_back(time(of_poses ? std::max(c.from[k], c.to[k]) : c.from[k]));
      targets.push_back(c.to[k]);
    }
  }
  start_ = starts(times, poses.size());
  members_.resize(times.size());
  std::vector<std::int64_t> next(start_.begin(), start_.end() - 1);
  for (std::size_t m = 0; m < times.size(); ++m) {
    auto& slot = next[static_cast<std::size_t>(times[m])];
    members_[static_cast<std::size_t>(slot++)] = static_cast<std::int64_t>(m);
  }
  sight_start_ = starts(targets, log.variables.size());
  sights_.resize(targets.size());
  next.assign(sight_start_.begin(), sight_start_.end() - 1);
  for (const std::int64_t m : members_) {  // in order of time
    auto& slot = next[static_cast<std::size_t>(targets[static_cast<std::size_t>(m)])];
    sights_[static_cast<std::size_t>(slot++)] = times[static_cast<std::size_t>(m)];
  }
}

int TimeOrder::next_sight(int variable, int t) const {
  const auto v = static_cast<std::size_t>(variable);
  const auto first = sights_.begin() + sight_start_[v];
  const auto last = sights_.begin() + sight_start_[v + 1];
  const auto found = std::upper_bound(first, last, t);
  return found == last ? -1 : *found;
}

template TimeOrder::TimeOrder(const RawLog<2>&);
template TimeOrder::TimeOrder(const RawLog<3>&);

}  // namespace mapjoin
