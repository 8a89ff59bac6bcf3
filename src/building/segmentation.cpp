#include "mapjoin/building/segmentation.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <utility>

#include "mapjoin/building/delayed.h"
#include "mapjoin/building/time_order.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/graph/symmetric.h"
#include "mapjoin/joining/join_tree.h"

namespace mapjoin {

namespace {

using By = SegmentRule::By;
constexpr std::pair<std::string_view, By> kRules[] = {{"poses", By::kPoses},
                                                      {"maps", By::kMaps},
                                                      {"features", By::kFeatures},
                                                      {"uncertainty", By::kUncertainty},
                                                      {"graph", By::kGraph}};

void check(const SegmentRule& rule) {
  const bool whole = rule.by != By::kUncertainty;
  if (!std::isfinite(rule.amount) || rule.amount <= 0.0 ||
      (whole && (rule.amount < 1.0 || rule.amount != std::floor(rule.amount)))) {
    throw InputError(fmt::format("a local map cannot end after {}: {}", rule.amount,
                                 whole ? "give a whole number above 0" : "give metres above 0"));
  }
}

/// By graph partition: the leaves of the join tree of the same shape.
template <int D>
Segmentation by_graph(const RawLog<D>& log, double maps) {
  MeasurementGraph<D> graph;
  graph.variables = log.variables;
  std::vector<double> information;
  for (const auto& c : log.columns) {
    const int dim = c.model->target->dim;
    RelativeMeasurements<D> column{c.model->target, c.from, c.to, {}, {}};
    column.info.assign(c.size() * static_cast<std::size_t>(dim * dim), 0.0);
    const auto n = static_cast<std::size_t>(c.model->dim);
    for (std::size_t k = 0; k < c.size(); ++k) {  // the stiffness of an edge is its trace
      for (std::size_t i = 0; i < n; ++i)
        column.info[k * static_cast<std::size_t>(dim * dim)] += c.info[k * n * n + i * (n + 1)];
    }
    graph.relative.push_back(std::move(column));
  }
  const int leaf = std::max(1, static_cast<int>(std::lround(log.variables.size() / maps)));
  const JoinTree tree = graph_tree(graph, leaf, 2);
  Segmentation out;
  for (int k = 0; k < tree.leaves(); ++k) {
    const auto members = tree.leaf(k);
    out.maps.emplace_back(members.begin(), members.end());
  }
  return out;
}

/// Walks a recording pose by pose and says where maps end.
template <int D>
class Cutter {
 public:
  Cutter(const RawLog<D>& log, const TimeOrder& order, const SegmentRule& rule, int common_features)
      : log_(log),
        order_(order),
        rule_(rule),
        common_features_(common_features),
        map_of_(static_cast<std::size_t>(log.variables.size()), -1),
        seen_before_(static_cast<std::size_t>(log.variables.size()), 0) {
    for (const auto& c : log.columns) partial_ = partial_ || c.model->seen == nullptr;
  }

  /// Poses at which maps end, ascending; the last is the last pose of all.
  std::vector<int> ends() {
    const int last = order_.poses() - 1;
    std::vector<int> out;
    int start = 0;
    while (start < last || out.empty()) {
      int end = natural_end(start, start + 1);
      if (partial_) end = settled_end(start, end);
      remember(start, end);
      if (end == last && !out.empty() && shared_ < common_features_) out.pop_back();
      out.push_back(end);
      start = end;
    }
    return out;
  }

 private:
  /// The first pose at or after `from` at which a map that starts at `start` may end.
  int natural_end(int start, int from) {
    const int last = order_.poses() - 1;
    ++map_;
    features_ = 0;
    shared_ = 0;
    covariance_.setZero();
    if (start == 0) count_features(0);
    for (int t = start + 1; t < last; ++t) {
      count_features(t);
      if (rule_.by == By::kUncertainty) propagate(t);
      if (t >= from && full(start, t) && (start == 0 || shared_ >= common_features_)) return t;
    }
    if (last > start) count_features(last);
    return last;
  }

  bool full(int start, int t) const {
    switch (rule_.by) {
      case By::kPoses:
        return t - start >= rule_.amount;
      case By::kMaps: {  // the k-th map ends at the first t with t maps / steps >= k
        const std::int64_t steps = order_.poses() - 1;
        const auto maps = static_cast<std::int64_t>(std::min<double>(rule_.amount, order_.poses()));
        return t * maps / steps > start * maps / steps;
      }
      case By::kFeatures:
        return features_ >= rule_.amount;
      case By::kUncertainty:
        return sigma() > rule_.amount;
      case By::kGraph:
        break;
    }
    return false;
  }

  void count_features(int t) {
    for (const std::int64_t m : order_.at(t)) {
      const auto [column, row] = log_.find(m);
      const auto& c = log_.columns[column];
      if (c.model->target->tag == Tag("pose")) continue;
      const auto to = static_cast<std::size_t>(c.to[row]);
      if (map_of_[to] == map_) continue;
      map_of_[to] = map_;
      ++features_;
      shared_ += seen_before_[to];
    }
  }
  void remember(int start, int end) {
    for (int t = start == 0 ? 0 : start + 1; t <= end; ++t) {
      for (const std::int64_t m : order_.at(t)) {
        const auto [column, row] = log_.find(m);
        seen_before_[static_cast<std::size_t>(log_.columns[column].to[row])] = 1;
      }
    }
  }

  /// Dead reckoning from t - 1 to t: dx = J_x^-1 (n - J_a da) for the noise n of the odometry.
  /// Where there is none nothing is known any more.
  void propagate(int t) {
    constexpr int G = kGauge<D>;
    using Square = Eigen::Matrix<double, G, G, Eigen::RowMajor>;
    for (const std::int64_t m : order_.at(t)) {
      const auto [column, row] = log_.find(m);
      const auto& c = log_.columns[column];
      if (c.model->target->tag != Tag("pose") || c.model->seen == nullptr || c.model->dim != G)
        continue;
      const int from = c.from[row];
      const int to = c.to[row];
      if (order_.time(from) != t - 1 || order_.time(to) != t) continue;
      Rigid<D> pose, next;
      const double* const z = &c.z[row * static_cast<std::size_t>(c.model->measured)];
      c.model->seen(z, reinterpret_cast<double*>(&next));
      Vec<G> r;
      Square Ja, Jx;
      c.model->linearize(z, reinterpret_cast<const double*>(&pose), nullptr,
                         reinterpret_cast<const double*>(&next), nullptr, r.data(), Ja.data(),
                         Jx.data());
      const Eigen::Map<const Eigen::Matrix<double, G, G>> info(
          &c.info[row * static_cast<std::size_t>(G * G)]);
      const Eigen::Matrix<double, G, G> step = -Jx.inverse() * Ja;
      covariance_ = step * covariance_ * step.transpose() +
                    Eigen::Matrix<double, G, G>((Jx.transpose() * info * Jx).inverse());
      return;
    }
    covariance_.setConstant(std::numeric_limits<double>::infinity());
  }
  double sigma() const {
    const Eigen::Matrix<double, D, D> position = covariance_.template topLeftCorner<D, D>();
    if (!position.allFinite()) return std::numeric_limits<double>::infinity();
    return std::sqrt(eigenvalues(position)(D - 1));
  }

  /// The measurements of a map, and the first pose (time) that measures a feature which the map
  /// cannot place although it is seen again later; -1 where there is none.
  int first_unsettled(int start, int end) const {
    std::vector<std::int64_t> members;
    for (int t = start == 0 ? 0 : start + 1; t <= end; ++t) {
      const auto at = order_.at(t);
      members.insert(members.end(), at.begin(), at.end());
    }
    std::sort(members.begin(), members.end());
    int first = -1;
    for (const LocalProblem<D>& problem : local_problems(log_, std::span(std::as_const(members)))) {
      InitialValues<D> values = initial_values(problem, false);
      for (const std::int64_t m : place_delayed(problem, values)) {
        const auto [column, row] = log_.find(m);
        const auto& c = log_.columns[column];
        const int later = order_.next_sight(c.to[row], end);
        if (later < 0 || later - end > end - start) continue;  // gone: waiting would be in vain
        const int t = order_.time(c.from[row]);
        first = first < 0 ? t : std::min(first, t);
      }
    }
    return first;
  }

  /// The nearest end before `end` that leaves no feature half seen, or the next one after.
  int settled_end(int start, int end) {
    const int last = order_.poses() - 1;
    constexpr int kLongest = 4;  // times as long as asked for
    const int asked = end - start;
    while (end < last && end - start < kLongest * asked) {
      int cut = end;
      while (cut > start + asked / 2) {
        const int first = first_unsettled(start, cut);
        if (first < 0) return cut;
        cut = std::min(cut - 1, first - 1);
      }
      end = std::min(last, end + std::max(1, asked / 2));
    }
    return end;
  }

  const RawLog<D>& log_;
  const TimeOrder& order_;
  const SegmentRule& rule_;
  int common_features_;
  bool partial_ = false;
  int map_ = 0;
  int features_ = 0;
  int shared_ = 0;
  std::vector<int> map_of_;        ///< the last map that has a feature
  std::vector<char> seen_before_;  ///< in maps that have ended
  Eigen::Matrix<double, kGauge<D>, kGauge<D>> covariance_;
};

}  // namespace

SegmentRule parse_segment_rule(std::string_view text) {
  const std::size_t colon = text.find(':');
  const std::string_view amount = colon == std::string_view::npos ? "" : text.substr(colon + 1);
  for (const auto& [name, by] : kRules) {
    if (text.substr(0, colon) != name) continue;
    SegmentRule rule{by, 0.0};
    const auto [end, error] =
        std::from_chars(amount.data(), amount.data() + amount.size(), rule.amount);
    if (error != std::errc() || end != amount.data() + amount.size()) break;
    check(rule);
    return rule;
  }
  throw InputError(fmt::format(
      "'{}' does not say when a local map ends: write poses:N, maps:N, features:N, uncertainty:X "
      "(metres, one sigma) or graph:N",
      text));
}

template <int D>
Segmentation segment(const RawLog<D>& log, const SegmentRule& rule, int common_features) {
  check(rule);
  if (rule.by == By::kGraph) return by_graph(log, rule.amount);
  const TimeOrder order(log);
  const std::vector<int> ends = Cutter<D>(log, order, rule, common_features).ends();
  Segmentation out;
  int t = 0;
  for (const int end : ends) {
    std::vector<std::int64_t> members;
    for (; t <= end; ++t) {
      const auto at = order.at(t);
      members.insert(members.end(), at.begin(), at.end());
    }
    std::sort(members.begin(), members.end());
    if (!members.empty()) out.maps.push_back(std::move(members));
  }
  return out;
}

template Segmentation segment<2>(const RawLog<2>&, const SegmentRule&, int);
template Segmentation segment<3>(const RawLog<3>&, const SegmentRule&, int);

}  // namespace mapjoin
