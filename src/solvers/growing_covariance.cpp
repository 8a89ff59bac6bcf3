#include "mapjoin/solvers/growing_covariance.h"

#include <algorithm>

#include "mapjoin/solvers/dense_blas.h"

namespace mapjoin {

int GrowingCovariance::add(int dim) {
  const auto fits = [&](const std::pair<int, int>& slot) { return slot.second == dim; };
  const auto slot = std::find_if(free_.begin(), free_.end(), fits);
  if (slot != free_.end()) {
    const int row = slot->first;
    free_.erase(slot);
    return row;
  }
  const int row = size_;
  if (size_ + dim > P_.rows()) {
    const Eigen::Index capacity = std::max<Eigen::Index>(64, 3 * (size_ + dim) / 2);
    P_.conservativeResize(capacity, capacity);
  }
  size_ += dim;
  P_.block(row, 0, dim, size_).setZero();
  return row;
}

void GrowingCovariance::remove(int row, int dim) {
  set_columns(row, Eigen::MatrixXd::Zero(size_, dim));
  free_.emplace_back(row, dim);
}

Eigen::MatrixXd GrowingCovariance::columns(int row, int dim) const {
  Eigen::MatrixXd out(size_, dim);
  out.topRows(row) = P_.block(row, 0, dim, row).transpose();
  out.middleRows(row, dim) = P_.block(row, row, dim, dim).selfadjointView<Eigen::Lower>();
  const int below = size_ - row - dim;
  out.bottomRows(below) = P_.block(row + dim, row, below, dim);
  return out;
}

void GrowingCovariance::set_columns(int row, const Eigen::MatrixXd& columns) {
  const auto dim = static_cast<int>(columns.cols());
  const int below = size_ - row - dim;
  P_.block(row, 0, dim, row) = columns.topRows(row).transpose();
  P_.block(row, row, dim, dim) = columns.middleRows(row, dim);
  P_.block(row + dim, row, below, dim) = columns.bottomRows(below);
}

void GrowingCovariance::turn(int row, const Eigen::MatrixXd& T) {
  const auto dim = static_cast<int>(T.rows());
  Eigen::MatrixXd turned = columns(row, dim) * T.transpose();
  turned.middleRows(row, dim) = (T * turned.middleRows(row, dim)).eval();
  set_columns(row, turned);
}

void GrowingCovariance::subtract_square(const Eigen::MatrixXd& X) {
  add_square(-1.0, X, P_.topLeftCorner(size_, size_));
}

Eigen::MatrixXd GrowingCovariance::of(const std::vector<int>& rows) const {
  const auto n = static_cast<Eigen::Index>(rows.size());
  Eigen::MatrixXd out(n, n);
  for (Eigen::Index c = 0; c < n; ++c) {
    const int column = rows[static_cast<std::size_t>(c)];
    for (Eigen::Index r = 0; r < n; ++r) {
      const int row = rows[static_cast<std::size_t>(r)];
      out(r, c) = P_(std::max(row, column), std::min(row, column));
    }
  }
  return out;
}

std::optional<Eigen::MatrixXd> GrowingCovariance::information(const std::vector<int>& rows) const {
  Eigen::MatrixXd L = of(rows);
  if (factor_lower(L) >= 0) return std::nullopt;
  Eigen::MatrixXd inverse = Eigen::MatrixXd::Identity(L.rows(), L.cols());
  solve_lower_left(L, inverse);
  L.setZero();
  add_square(1.0, inverse.transpose().eval(), L);
  return Eigen::MatrixXd(L.selfadjointView<Eigen::Lower>());
}

}  // namespace mapjoin
