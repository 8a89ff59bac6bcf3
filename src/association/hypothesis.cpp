#include "mapjoin/association/hypothesis.h"

#include <cmath>
#include <numbers>

#include "mapjoin/graph/index.h"

namespace mapjoin {

namespace {

/// Less variance than this of what there was at first is rounding.
constexpr double kNoVariance = 1e-12;

/// Replaces S by its lower Cholesky factor L; columns without variance become zero. `variances` are
/// those of the scalars before anything was taken.
template <class Matrix, class Vector>
void factorize(Matrix& S, const Vector& variances) {
  const Eigen::Index n = S.rows();
  for (Eigen::Index j = 0; j < n; ++j) {
    const bool certain = !(S(j, j) > kNoVariance * variances(j));
    const double root = certain ? 0.0 : std::sqrt(S(j, j));
    for (Eigen::Index i = j; i < n; ++i) S(i, j) = certain ? 0.0 : S(i, j) / root;
    for (Eigen::Index k = j + 1; k < n; ++k) {
      for (Eigen::Index i = k; i < n; ++i) S(i, k) -= S(i, j) * S(k, j);
    }
  }
}

/// y = L^-1 r in place, zero where L has zero columns.
template <class Matrix, class Vector>
void solve(const Matrix& L, Vector&& r) {
  for (Eigen::Index j = 0; j < L.rows(); ++j) {
    double sum = r(j);
    for (Eigen::Index k = 0; k < j; ++k) sum -= L(j, k) * r(k);
    r(j) = L(j, j) == 0.0 ? 0.0 : sum / L(j, j);
  }
}

}  // namespace

Hypothesis::Hypothesis(const CandidatePairs& pairs)
    : pairs_(pairs),
      innovations_(pairs.innovations),
      variances_(pairs.innovations.size()),
      added_(pairs.pairs.size()),
      log_likelihood_(pairs.pairs.size()) {
  for (int p = 0; p < pairs.size(); ++p) {
    block_start_.push_back(blocks_.size());
    const Eigen::MatrixXd S = pairs.covariance(p, p);
    variances_.segment(pairs.pairs[at(p)].row, S.rows()) = S.diagonal();
    blocks_.insert(blocks_.end(), S.data(), S.data() + S.size());
  }
  for (int p = 0; p < pairs.known; ++p) condition(p);
  chi2_ = 0.0;
  dimension_ = 0;
  judge_pairs();
}

Eigen::Map<const Eigen::MatrixXd> Hypothesis::spread(int p) const {
  const int n = pairs_.pairs[at(p)].dim;
  return {blocks_.data() + block_start_[at(p)], n, n};
}

void Hypothesis::condition(int p) {
  const CandidatePairs::Pair& pair = pairs_.pairs[at(p)];
  Eigen::MatrixXd L = spread(p);
  factorize(L, variances_.segment(pair.row, pair.dim));
  Eigen::VectorXd y = innovations_.segment(pair.row, pair.dim);
  solve(L, y);

  Eigen::MatrixXd column = pairs_.covariance_with(p);
  if (columns_ > 0)
    column.noalias() -=
        factor_.leftCols(columns_) * factor_.block(pair.row, 0, pair.dim, columns_).transpose();
  for (Eigen::Index i = 0; i < column.rows(); ++i) solve(L, column.row(i));
  innovations_.noalias() -= column * y;
  for (std::size_t q = 0; q < pairs_.pairs.size(); ++q) {
    const CandidatePairs::Pair& other = pairs_.pairs[q];
    Eigen::Map<Eigen::MatrixXd> S(blocks_.data() + block_start_[q], other.dim, other.dim);
    const auto rows = column.middleRows(other.row, other.dim);
    S -= rows.lazyProduct(rows.transpose());
  }
  if (factor_.cols() < columns_ + pair.dim)
    factor_.conservativeResize(innovations_.size(), 2 * (columns_ + pair.dim));
  factor_.middleCols(columns_, pair.dim) = column;
  columns_ += pair.dim;
  chi2_ += y.squaredNorm();
  dimension_ += pair.dim;
}

void Hypothesis::judge_pairs() {
  Eigen::MatrixXd L;
  Eigen::VectorXd y;
  for (std::size_t q = 0; q < pairs_.pairs.size(); ++q) {
    const CandidatePairs::Pair& pair = pairs_.pairs[q];
    L = spread(static_cast<int>(q));
    factorize(L, variances_.segment(pair.row, pair.dim));
    y = innovations_.segment(pair.row, pair.dim);
    solve(L, y);
    added_[q] = y.squaredNorm();
    log_likelihood_[q] = -0.5 * added_[q];
    for (Eigen::Index k = 0; k < L.rows(); ++k) {
      if (L(k, k) > 0.0)
        log_likelihood_[q] -= std::log(L(k, k)) + 0.5 * std::log(2.0 * std::numbers::pi);
    }
  }
}

void Hypothesis::take(int p) {
  saved_.push_back({innovations_, blocks_, added_, log_likelihood_, chi2_, dimension_, columns_});
  condition(p);
  judge_pairs();
  taken_.push_back(p);
}

void Hypothesis::drop() {
  Saved& last = saved_.back();
  innovations_ = std::move(last.innovations);
  blocks_ = std::move(last.blocks);
  added_ = std::move(last.added);
  log_likelihood_ = std::move(last.log_likelihood);
  chi2_ = last.chi2;
  dimension_ = last.dimension;
  columns_ = last.columns;
  saved_.pop_back();
  taken_.pop_back();
}

}  // namespace mapjoin
