#include "mapjoin/evaluation/consistency.h"

#include <fmt/format.h>
#include <Eigen/LU>

#include <cmath>

#include "mapjoin/evaluation/chi_squared.h"
#include "mapjoin/frames/align.h"
#include "mapjoin/frames/anchors.h"
#include "mapjoin/frames/exact_gauge.h"
#include "mapjoin/graph/symmetric.h"
#include "mapjoin/solvers/covariance.h"
#include "mapjoin/solvers/sparse_cholesky.h"

namespace mapjoin {

namespace {

/// The map's error where the truth is known, zero elsewhere, by scalars; and which those are.
struct TrueError {
  Eigen::VectorXd e;
  std::vector<int> known;  ///< scalars, ascending
};

template <int D>
Values<D> in_frame_of(const Map<D>& map, Values<D> truth) {
  if (map.anchor.kind == nullptr) {
    const auto onto = align(map.values, truth);
    if (!onto)
      throw InputError(
          "the map has no anchor, and the truth shares too little with it to be laid on it");
    truth.transform(*onto);
    return truth;
  }
  for (const Key& key : map.anchor.keys) {
    if (!truth.contains(key))
      throw InputError(fmt::format(
          "the truth does not have {}, which fixes the frame of the map; add it, or write the map "
          "in the frame of something that is known",
          to_string(key)));
  }
  truth.transform(motion_into(map.anchor, truth));
  return truth;
}

template <int D>
TrueError error_of(const Map<D>& map, const Values<D>& truth) {
  const VariableSet<D>& variables = map.variables();
  const std::vector<int> there = numbers_in(variables, truth.variables());
  std::vector<int> ours, theirs;
  TrueError out;
  for (const auto& column : variables.columns()) {
    for (int i = column.first; i < column.end(); ++i) {
      if (there[static_cast<std::size_t>(i)] < 0) continue;
      ours.push_back(i);
      theirs.push_back(there[static_cast<std::size_t>(i)]);
      const int first = column.first_scalar + (i - column.first) * column.kind->dim;
      for (int k = 0; k < column.kind->dim; ++k) out.known.push_back(first + k);
    }
  }
  const Eigen::VectorXd e = subset(map.values, std::span<const int>(ours))
                                .local(subset(truth, std::span<const int>(theirs)));
  out.e = Eigen::VectorXd::Zero(variables.scalars());
  for (std::size_t k = 0; k < out.known.size(); ++k)
    out.e(out.known[k]) = e(static_cast<Eigen::Index>(k));
  return out;
}

}  // namespace

template <int D>
Consistency consistency(const Map<D>& given, const Values<D>& truth, double confidence) {
  if (given.information.size() != given.variables().size())
    throw InputError("the map has no information to judge its error by");
  const Map<D> map = exactly_gauge_free(given);
  TrueError error = error_of(map, in_frame_of(map, truth));
  if (map.anchor.kind != nullptr) {  // rounding of what is pinned
    for (const int s : anchor_rows(map.anchor, map.values).pinned) error.e(s) = 0.0;
  }
  Consistency out;
  out.dimension = static_cast<int>(error.known.size()) - kGauge<D>;
  if (out.dimension < 1)
    throw InputError(
        "the truth and the map share nothing but what fixes the frame: there is no error to judge");

  // The least e^T Lambda e over the errors that are not known: the Schur complement, without it.
  Eigen::VectorXd& e = error.e;
  if (static_cast<Eigen::Index>(error.known.size()) < e.size()) {
    SparseCholesky cholesky;
    cholesky.analyze(map.information, error.known);
    const int failed = cholesky.factorize(map.information);
    if (failed >= 0) {
      int i = 0;
      while (map.information.offset(i + 1) <= failed) ++i;
      throw SingularError(
          fmt::format("the information does not determine {}, whose truth is not "
                      "known, from what is known",
                      to_string(map.variables().key(i))));
    }
    e -= cholesky.solve(map.information * e).col(0);
  }
  out.nees = e.dot(map.information * e);
  out.confidence = confidence;
  const double tail = 0.5 * (1.0 - confidence);
  out.lower = chi_squared_quantile(tail, out.dimension);
  out.upper = chi_squared_quantile(1.0 - tail, out.dimension);
  out.one_sided = chi_squared_quantile(confidence, out.dimension);
  return out;
}

template <int D>
Coverage coverage(const Map<D>& map, const Values<D>& truth, double sigmas) {
  const TrueError error = error_of(map, in_frame_of(map, truth));
  std::vector<char> judged(static_cast<std::size_t>(error.e.size()), 0);
  for (const int s : error.known) judged[static_cast<std::size_t>(s)] = 1;
  if (map.anchor.kind != nullptr) {
    for (const int s : anchor_rows(map.anchor, map.values).pinned)
      judged[static_cast<std::size_t>(s)] = 0;
  }
  const CovarianceBlocks blocks = Covariance<D>(map).blocks();
  Coverage out;
  for (std::size_t k = 0; k < blocks.size(); ++k) {
    const int first = map.variables().offset(blocks.variables[k]);
    for (int s = 0; s < blocks.dims[k]; ++s) {
      if (!judged[static_cast<std::size_t>(first + s)]) continue;
      ++out.count;
      out.inside += std::abs(error.e(first + s)) <= sigmas * std::sqrt(blocks.block(k)(s, s));
    }
  }
  return out;
}

template <int D>
ConfidenceRegion<D> confidence_region(const Mat<D, D>& covariance, double confidence) {
  const Spectrum eigen = spectrum(covariance);
  const double scale = chi_squared_quantile(confidence, D);
  ConfidenceRegion<D> out;
  out.semi_axes = (scale * eigen.values.cwiseMax(0.0)).cwiseSqrt().reverse();
  out.axes = eigen.vectors.rowwise().reverse();
  if (out.axes.determinant() < 0.0) out.axes.col(D - 1) *= -1.0;
  return out;
}

#define MAPJOIN_INSTANTIATE(D)                                                  \
  template Consistency consistency<D>(const Map<D>&, const Values<D>&, double); \
  template Coverage coverage<D>(const Map<D>&, const Values<D>&, double);       \
  template ConfidenceRegion<D> confidence_region<D>(const Mat<D, D>&, double);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
