#include "mapjoin/solvers/observation_list.h"

#include <algorithm>

#include "mapjoin/graph/index.h"

namespace mapjoin {

template <int D>
ObservationList<D>::ObservationList(const MeasurementGraph<D>& graph, const Piece<D>& piece,
                                    Places& places)
    : graph_(graph) {
  for (std::size_t c = 0; c < piece.data.size(); ++c) {
    dims_.insert(dims_.end(), at(piece.column_size(c)),
                 graph_.variables.column(static_cast<int>(c)).kind->dim);
  }
  observations_ = piece.observations;
  if (!std::is_sorted(observations_.begin(), observations_.end()))
    std::sort(observations_.begin(), observations_.end());
  places.mark(piece.variables);
  cliques_.start.reserve(observations_.size() + 1);
  cliques_.variables.reserve(2 * observations_.size());  // at least
  const auto add = [&](std::int32_t variable) { cliques_.variables.push_back(places[variable]); };
  std::int64_t first = 0;
  std::size_t k = 0;
  for (const auto& column : graph_.relative) {
    for (; k < observations_.size() &&
           observations_[k] < first + static_cast<std::int64_t>(column.size());
         ++k) {
      add(column.from[at(observations_[k] - first)]);
      add(column.to[at(observations_[k] - first)]);
      cliques_.start.push_back(static_cast<std::int64_t>(cliques_.variables.size()));
    }
    first += static_cast<std::int64_t>(column.size());
  }
  const auto& maps = graph_.submaps;
  for (; k < observations_.size(); ++k) {
    const std::size_t m = at(observations_[k] - first);
    const std::size_t begin = cliques_.variables.size();
    const auto anchors = static_cast<std::size_t>(maps.anchor_start[m + 1] - maps.anchor_start[m]);
    for (auto a = maps.anchor_start[m]; a < maps.anchor_start[m + 1]; ++a)
      add(maps.anchor_variables[at(a)]);
    for (auto t = maps.term_start[m]; t < maps.term_start[m + 1]; ++t) {
      const std::int32_t v = places[maps.term_variable[at(t)]];
      const auto anchors_begin = cliques_.variables.begin() + static_cast<std::ptrdiff_t>(begin);
      const auto anchors_end = anchors_begin + static_cast<std::ptrdiff_t>(anchors);
      const bool repeated =
          cliques_.variables.size() > begin + anchors && cliques_.variables.back() == v;
      if (!repeated && std::find(anchors_begin, anchors_end, v) == anchors_end)
        cliques_.variables.push_back(v);
    }
    cliques_.start.push_back(static_cast<std::int64_t>(cliques_.variables.size()));
  }
  places.clear(piece.variables);
}

template <int D>
std::span<const std::int32_t> ObservationList<D>::clique(std::int64_t k) const {
  return std::span(cliques_.variables)
      .subspan(at(cliques_.start[at(k)]), at(cliques_.start[at(k) + 1] - cliques_.start[at(k)]));
}

template <int D>
const double* ObservationList<D>::value(const Piece<D>& piece, int place) const {
  std::size_t c = 0;
  while (place >= piece.column_start[c + 1]) ++c;
  return piece.data[c].data() + static_cast<std::ptrdiff_t>(place - piece.column_start[c]) *
                                    graph_.variables.column(static_cast<int>(c)).kind->value_size;
}

template <int D>
std::vector<PieceScalar> ObservationList<D>::anchor_scalars(std::int64_t k) const {
  const auto& maps = graph_.submaps;
  const std::size_t m = at(observation(k)) - (graph_.size() - maps.size());
  std::vector<PieceScalar> out;
  for (std::int64_t a = 0; a < maps.anchor_start[m + 1] - maps.anchor_start[m]; ++a) {
    const std::int32_t variable = clique(k)[at(a)];
    for (int s = 0; s < dims_[at(variable)]; ++s) out.push_back({variable, s});
  }
  return out;
}

template <int D>
double ObservationList<D>::evaluate_values(std::int64_t k, std::span<const double* const> values,
                                           std::span<const std::int32_t> rows,
                                           const DenseTarget* target,
                                           SubmapScratch& scratch) const {
  std::int64_t observation = observations_[at(k)];
  for (const auto& column : graph_.relative) {
    if (observation >= static_cast<std::int64_t>(column.size())) {
      observation -= static_cast<std::int64_t>(column.size());
      continue;
    }
    const auto id = static_cast<std::int32_t>(observation);
    const std::int32_t slots[2] = {0, 0};
    RelativeBatch<D> one{1,         &id,       column.z.data(), column.info.data(),
                         values[0], values[1], slots,           rows.data()};
    return target == nullptr ? column.kind->chi2_relative(one)
                             : column.kind->linearize_relative(one, *target);
  }
  return linearize_submap(graph_, at(observation), values.data(), rows, target, scratch);
}

template <int D>
double ObservationList<D>::evaluate(std::int64_t k, const Piece<D>& piece,
                                    std::span<const std::int32_t> rows, const DenseTarget* target,
                                    SubmapScratch& scratch) const {
  std::vector<const double*> values;
  for (const std::int32_t place : clique(k)) values.push_back(value(piece, place));
  return evaluate_values(k, values, rows, target, scratch);
}

template <int D>
double ObservationList<D>::evaluate_at(std::int64_t k, const Piece<D>& other, const Places& places,
                                       std::span<const std::int32_t> rows,
                                       const DenseTarget* target, SubmapScratch& scratch) const {
  std::vector<const double*> values;
  for (const std::int32_t variable : clique(k)) values.push_back(value(other, places[variable]));
  return evaluate_values(k, values, rows, target, scratch);
}

template <int D>
double ObservationList<D>::evaluate_alone(std::int64_t k, const Piece<D>& piece, Eigen::MatrixXd& H,
                                          SubmapScratch& scratch) const {
  std::vector<std::int32_t> rows{0};
  for (const std::int32_t v : clique(k)) rows.push_back(rows.back() + dims_[at(v)]);
  H.setZero(rows.back() + 1, rows.back());
  const DenseTarget target{H.data(), H.rows(), H.cols(), nullptr, 0, rows.back()};
  return evaluate(k, piece, rows, &target, scratch);
}

template <int D>
SymmetricBlockMatrix ObservationList<D>::information(const Piece<D>& piece) const {
  std::vector<std::pair<int, int>> pairs;
  for (std::size_t k = 0; k < observations_.size(); ++k) {
    for (std::int64_t i = cliques_.start[k]; i < cliques_.start[k + 1]; ++i) {
      for (std::int64_t j = i + 1; j < cliques_.start[k + 1]; ++j) {
        pairs.emplace_back(cliques_.variables[at(i)], cliques_.variables[at(j)]);
      }
    }
  }
  std::vector<int> offsets{0};
  for (const std::int32_t d : dims_) offsets.push_back(offsets.back() + d);
  SymmetricBlockMatrix out(offsets, pairs);
  Eigen::MatrixXd H;
  SubmapScratch scratch;
  for (std::size_t k = 0; k < observations_.size(); ++k) {
    evaluate_alone(static_cast<std::int64_t>(k), piece, H, scratch);
    const Eigen::MatrixXd lower = H.topRows(H.cols());
    const Eigen::MatrixXd full = lower.selfadjointView<Eigen::Lower>();
    int row = 0;
    for (std::int64_t i = cliques_.start[k]; i < cliques_.start[k + 1]; ++i) {
      const int a = cliques_.variables[at(i)];
      int column = 0;
      for (std::int64_t j = cliques_.start[k]; j <= i; ++j) {
        const int b = cliques_.variables[at(j)];
        out.add(a, b, full.block(row, column, dims_[at(a)], dims_[at(b)]));
        column += dims_[at(b)];
      }
      row += dims_[at(a)];
    }
  }
  return out;
}

template <int D>
double ObservationList<D>::chi2(const Piece<D>& piece) const {
  static constexpr std::int32_t kNowhere[2] = {0, 0};
  SubmapScratch scratch;
  double sum = 0.0;
  for (std::int64_t k = 0; k < static_cast<std::int64_t>(size()); ++k)
    sum += evaluate(k, piece, kNowhere, nullptr, scratch);
  return sum;
}

template class ObservationList<2>;
template class ObservationList<3>;

}  // namespace mapjoin
