#include "mapjoin/cli/watch.h"

#include <algorithm>

#include "mapjoin/building/ekf_slam.h"
#include "mapjoin/building/time_order.h"
#include "mapjoin/filtering/dslam.h"
#include "mapjoin/filtering/ekf_join.h"

namespace mapjoin::cli {

namespace {

/// When each local map is complete: at its last pose.
template <int D>
std::vector<int> times_of(const Subject<D>& subject) {
  std::vector<int> out;
  for (std::size_t k = 0; k < subject.maps.size(); ++k) out.push_back(static_cast<int>(k) + 1);
  if (!subject.log) return out;
  const TimeOrder order(*subject.log);
  for (std::size_t k = 0; k < out.size(); ++k) {
    out[k] = 0;
    for (const Key& key : subject.maps[k].keys) {
      const auto number = subject.log->variables.find(key);
      if (number && key.type == Tag("pose")) out[k] = std::max(out[k], order.time(*number));
    }
  }
  return out;
}

template <int D>
class Watch {
 public:
  explicit Watch(std::span<const Key> points) {
    for (const Key& key : points) watched_.push_back({key, {}});
  }
  /// `covariance_of`: of one key, in a filter that has these values now.
  template <class CovarianceOf>
  void look(int time, const Values<D>& values, const CovarianceOf& covariance_of) {
    for (Watched<D>& w : watched_) {
      if (!values.contains(w.key)) continue;
      if (!w.sights.empty() && w.sights.back().time == time) w.sights.pop_back();
      const Eigen::MatrixXd P = covariance_of(w.key);
      w.sights.push_back({time, values.point(w.key), P.diagonal().cwiseMax(0.0).cwiseSqrt()});
    }
  }
  std::vector<Watched<D>> result() && { return std::move(watched_); }

 private:
  std::vector<Watched<D>> watched_;
};

/// One of the filters that take local maps one by one.
template <int D, class Filter, class Map>
void fuse_and_look(Filter& filter, const Map& map, int time, Watch<D>& watch) {
  filter.fuse(map);
  watch.look(time, filter.values(),
             [&](const Key& key) { return filter.covariance(std::span(&key, 1)); });
}

}  // namespace

template <int D>
std::vector<Watched<D>> watch(Method method, bool whole_run, const FilterOptions& options,
                              const Subject<D>& subject, std::span<const Key> points) {
  Watch<D> watch(points);
  if (whole_run) {
    EkfSlam<D> slam(*subject.log);
    while (slam.step())
      watch.look(slam.taken() - 1, slam.values(),
                 [&](const Key& key) { return slam.covariance(key); });
    return std::move(watch).result();
  }
  const std::vector<int> times = times_of(subject);
  const std::span<const LocalMap<D>> maps(subject.maps);
  if (method == Method::kSlsjf) {
    Slsjf<D> filter(options);
    for (std::size_t k = 0; k < maps.size(); ++k) fuse_and_look(filter, maps[k], times[k], watch);
  } else if (method == Method::kEkf) {
    EkfJoin<D> filter;
    for (std::size_t k = 0; k < maps.size(); ++k) fuse_and_look(filter, maps[k], times[k], watch);
  } else if (method == Method::kDslam) {
    DslamJoin<D> filter(options);
    const DslamInput<D> input = dslam_input(maps);
    std::size_t k = static_cast<std::size_t>(input.parts[0]) - 1;  // the last local map of each
    fuse_and_look(filter, input.first, times[k], watch);
    for (std::size_t m = 0; m < input.further.size(); ++m) {
      k += static_cast<std::size_t>(input.parts[m + 1]);
      fuse_and_look(filter, input.further[m], times[k], watch);
    }
  } else {
    return {};
  }
  return std::move(watch).result();
}

template std::vector<Watched<2>> watch<2>(Method, bool, const FilterOptions&, const Subject<2>&,
                                          std::span<const Key>);
template std::vector<Watched<3>> watch<3>(Method, bool, const FilterOptions&, const Subject<3>&,
                                          std::span<const Key>);

}  // namespace mapjoin::cli
