#include "mapjoin/evaluation/evaluate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "mapjoin/frames/align.h"
#include "mapjoin/graph/index.h"

namespace mapjoin {

namespace {

constexpr std::size_t kBatch = 4096;

/// Numbers in the estimate of the graph's variables.
template <int D>
std::vector<int> places_of(const Values<D>& estimate, const VariableSet<D>& variables) {
  std::vector<int> places = numbers_in(variables, estimate.variables());
  const auto missing = std::find(places.begin(), places.end(), -1);
  if (missing != places.end()) {
    const Key& key = variables.key(static_cast<int>(missing - places.begin()));
    throw InputError(fmt::format(
        "the measurements speak of {} but the map has no such variable ({} of {} are missing): are "
        "map and measurements of the same data?",
        to_string(key), std::count(places.begin(), places.end(), -1), places.size()));
  }
  return places;
}

/// Which column of the estimate holds a type, and the number of its first variable.
template <int D>
std::pair<const double*, int> column_of(const Values<D>& estimate, Tag tag) {
  const int c = estimate.variables().find_column(tag);
  return {estimate.data(c), estimate.variables().column(c).first};
}

template <int D>
double chi2_relative(const Values<D>& estimate, const std::vector<int>& places,
                     const RelativeMeasurements<D>& measurements) {
  if (measurements.size() == 0) return 0.0;
  const auto [poses, first_pose] = column_of(estimate, Tag("pose"));
  const auto [values, first_value] = column_of(estimate, measurements.kind->tag);
  std::vector<std::int32_t> id(std::min(kBatch, measurements.size()));
  std::vector<std::int32_t> slots(2 * id.size());
  double sum = 0.0;
  for (std::size_t start = 0; start < measurements.size(); start += kBatch) {
    const std::size_t count = std::min(kBatch, measurements.size() - start);
    for (std::size_t k = 0; k < count; ++k) {
      id[k] = static_cast<std::int32_t>(start + k);
      const auto from = static_cast<std::size_t>(measurements.from[start + k]);
      const auto to = static_cast<std::size_t>(measurements.to[start + k]);
      slots[2 * k] = places[from] - first_pose;
      slots[2 * k + 1] = places[to] - first_value;
    }
    RelativeBatch<D> batch;
    batch.size = count;
    batch.id = id.data();
    batch.z = measurements.z.data();
    batch.info = measurements.info.data();
    batch.poses = poses;
    batch.values = values;
    batch.slots = slots.data();
    sum += measurements.kind->chi2_relative(batch);
  }
  return sum;
}

/// Residuals of the terms of one local map, at the estimate written in its anchor's frame.
template <int D>
class SubmapResiduals {
 public:
  SubmapResiduals(const Values<D>& estimate, const std::vector<int>& places,
                  const SubmapObservations<D>& maps)
      : estimate_(estimate), places_(places), maps_(maps) {}

  double chi2(std::size_t k) {
    evaluate(k);
    double sum = 0.0;
    for (auto b = at(maps_.block_start[k]); b < at(maps_.block_start[k + 1]); ++b) {
      const auto row = at(maps_.block_row[b]);
      const auto column = at(maps_.block_column[b]);
      const Eigen::Map<const Eigen::MatrixXd> block(maps_.information.data() + maps_.block_value[b],
                                                    dim(row), dim(column));
      const double part = residual(row).dot(block * residual(column));
      sum += row == column ? part : 2.0 * part;
    }
    return sum;
  }

 private:
  int place(std::int32_t variable) const { return places_[static_cast<std::size_t>(variable)]; }

  void evaluate(std::size_t k) {
    const Rigid<D> T = frame(k);
    start_.assign(1, 0);
    residuals_.clear();
    for (auto t = at(maps_.term_start[k]); t < at(maps_.term_start[k + 1]); ++t) {
      const int here = place(maps_.term_variable[t]);
      const VariableKind<D>& kind = estimate_.variables().kind(here);
      seen_.assign(estimate_.value(here), estimate_.value(here) + kind.value_size);
      kind.transform(T, seen_.data(), 1);
      residuals_.resize(residuals_.size() + static_cast<std::size_t>(kind.dim));
      kind.local(maps_.values.data() + maps_.term_value[t], seen_.data(), 1,
                 residuals_.data() + start_.back());
      start_.push_back(static_cast<int>(residuals_.size()));
    }
  }
  Rigid<D> frame(std::size_t k) const {
    std::vector<const double*> values;
    std::vector<Key> keys;
    for (auto a = at(maps_.anchor_start[k]); a < at(maps_.anchor_start[k + 1]); ++a) {
      const int here = place(maps_.anchor_variables[a]);
      values.push_back(estimate_.value(here));
      keys.push_back(estimate_.variables().key(here));
    }
    return maps_.anchors[k]->frame(values.data(), keys.data());
  }
  int dim(std::size_t term) const { return start_[term + 1] - start_[term]; }
  Eigen::Map<const Eigen::VectorXd> residual(std::size_t term) const {
    return {residuals_.data() + start_[term], dim(term)};
  }

  const Values<D>& estimate_;
  const std::vector<int>& places_;
  const SubmapObservations<D>& maps_;
  std::vector<int> start_;
  std::vector<double> residuals_;
  std::vector<double> seen_;
};

/// Pairs of values of one type that both maps have.
template <VariableType T, int D>
std::vector<std::pair<ValueOf<T>, ValueOf<T>>> common(const Values<D>& a, const Values<D>& b) {
  std::vector<std::pair<ValueOf<T>, ValueOf<T>>> out;
  const int ca = a.variables().find_column(Tag(T::name));
  const int cb = b.variables().find_column(Tag(T::name));
  if (ca < 0 || cb < 0) return out;
  const auto& ka = a.variables().column(ca).keys;
  const auto& kb = b.variables().column(cb).keys;
  for (std::size_t i = 0, j = 0; i < ka.size() && j < kb.size();) {
    if (ka[i] == kb[j]) out.emplace_back(a.template column<T>()[i], b.template column<T>()[j]);
    const bool step_a = ka[i] <= kb[j];
    const bool step_b = kb[j] <= ka[i];
    i += step_a ? 1 : 0;
    j += step_b ? 1 : 0;
  }
  return out;
}

/// Root of the mean squared coordinate of what `difference` says of 0 .. n-1.
template <int D, class F>
double rms(std::size_t n, const F& difference) {
  double sum = 0.0;
  for (std::size_t k = 0; k < n; ++k) sum += Vec<D>(difference(k)).squaredNorm();
  return n == 0 ? 0.0 : std::sqrt(sum / static_cast<double>(n * static_cast<std::size_t>(D)));
}

template <int D>
double rmse_after_fit(const std::vector<std::pair<Vec<D>, Vec<D>>>& pairs) {
  Eigen::Matrix<double, D, Eigen::Dynamic> a(D, static_cast<Eigen::Index>(pairs.size())), b = a;
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    a.col(static_cast<Eigen::Index>(k)) = pairs[k].first;
    b.col(static_cast<Eigen::Index>(k)) = pairs[k].second;
  }
  // Not align(): a fit exists and has an error even where the points leave the motion open.
  a.colwise() -= a.rowwise().mean().eval();
  b.colwise() -= b.rowwise().mean().eval();
  const Mat<D, D> R = nearest_rotation<D>(b * a.transpose());
  return std::sqrt((R * a - b).squaredNorm() / static_cast<double>(b.size()));
}

}  // namespace

template <int D>
double chi2(const Values<D>& estimate, const MeasurementGraph<D>& graph) {
  const std::vector<int> places = places_of(estimate, graph.variables);
  double sum = 0.0;
  for (const auto& measurements : graph.relative) {
    sum += chi2_relative(estimate, places, measurements);
  }
  SubmapResiduals<D> submaps(estimate, places, graph.submaps);
  for (std::size_t k = 0; k < graph.submaps.size(); ++k) sum += submaps.chi2(k);
  return sum;
}

template <int D>
Deviation deviation(const Values<D>& estimate, const Values<D>& reference) {
  const auto poses = common<PoseType<D>>(estimate, reference);
  const auto points = common<PointType<D>>(estimate, reference);
  Deviation out;
  out.poses = poses.size();
  out.features = points.size();
  if (!poses.empty()) {
    const Rigid<D> into_a = poses[0].first.inverse();
    const Rigid<D> into_b = poses[0].second.inverse();
    out.pose_rmse = rms<D>(poses.size() - 1, [&](std::size_t k) {
      return Vec<D>(into_a * poses[k + 1].first.t - into_b * poses[k + 1].second.t);
    });
    out.feature_rmse = rms<D>(points.size(), [&](std::size_t k) {
      return Vec<D>(into_a * points[k].first - into_b * points[k].second);
    });
    out.relative_rmse = rms<D>(poses.size() - 1, [&](std::size_t k) {
      return Vec<D>(poses[k].first.inverse() * poses[k + 1].first.t -
                    poses[k].second.inverse() * poses[k + 1].second.t);
    });
  }
  if (!points.empty()) out.aligned_feature_rmse = rmse_after_fit<D>(points);
  return out;
}

#define MAPJOIN_INSTANTIATE(D)                                           \
  template double chi2<D>(const Values<D>&, const MeasurementGraph<D>&); \
  template Deviation deviation<D>(const Values<D>&, const Values<D>&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
