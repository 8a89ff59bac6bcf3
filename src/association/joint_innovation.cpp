#include "mapjoin/association/joint_innovation.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <numbers>

#include "mapjoin/graph/index.h"

namespace mapjoin {

namespace {

/// Variances smaller than this, of the pair's largest, are what the frame pins.
constexpr double kPinned = 1e-12;

}  // namespace

JointInnovation::JointInnovation(const CandidatePairs& pairs, const std::vector<int>& chosen)
    : believed_(chosen.size(), true) {
  int rows = 0;
  for (const int p : chosen) rows += pairs.pairs[at(p)].dim;
  Eigen::MatrixXd S(rows, rows);
  Eigen::VectorXd r(rows);
  std::vector<int> kept;
  int row = 0;
  for (const int p : chosen) {
    const int dim = pairs.pairs[at(p)].dim;
    int column = 0;
    for (const int q : chosen) {
      const int width = pairs.pairs[at(q)].dim;
      S.block(row, column, dim, width) = pairs.covariance(p, q);
      column += width;
    }
    r.segment(row, dim) = pairs.innovation(p);
    const double most = S.diagonal().segment(row, dim).maxCoeff();
    start_.push_back(static_cast<int>(kept.size()));
    for (int k = row; k < row + dim; ++k) {
      if (S(k, k) > kPinned * most) kept.push_back(k);
    }
    row += dim;
  }
  start_.push_back(static_cast<int>(kept.size()));
  S_ = S(kept, kept);
  r_ = r(kept);
  K_ = S_.ldlt().solve(Eigen::MatrixXd::Identity(S_.rows(), S_.cols()));
  y_ = K_ * r_;
}

Eigen::MatrixXd JointInnovation::block(int k) const {
  return K_.block(start_[at(k)], start_[at(k)], dimension(k), dimension(k));
}

double JointInnovation::chi2(int k) const {
  const Eigen::VectorXd y = y_.segment(start_[at(k)], dimension(k));
  return y.dot(block(k).ldlt().solve(y));
}

double JointInnovation::log_likelihood(int k) const {
  const Eigen::VectorXd pivots = block(k).ldlt().vectorD();  // of K_kk = S^-1
  double log_det = 0.0;
  for (const double d : pivots) log_det += std::log(d);
  return 0.5 * (log_det - chi2(k) - dimension(k) * std::log(2.0 * std::numbers::pi));
}

void JointInnovation::doubt(int k) {
  believed_[at(k)] = false;
  const int first = start_[at(k)];
  const int dim = dimension(k);
  // K of the others becomes K - K_.k K_kk^-1 K_k. .
  const Eigen::MatrixXd columns = K_.middleCols(first, dim);
  const Eigen::MatrixXd solved = block(k).ldlt().solve(columns.transpose());
  y_ -= solved.transpose() * Eigen::VectorXd(y_.segment(first, dim));
  K_.noalias() -= columns * solved;
  K_.middleCols(first, dim).setZero();
  K_.middleRows(first, dim).setZero();
  y_.segment(first, dim).setZero();
}

double JointInnovation::chi2_of_doubted(int k) const {
  const int first = start_[at(k)];
  const int dim = dimension(k);
  const Eigen::MatrixXd C = S_.middleCols(first, dim);
  const Eigen::VectorXd r = r_.segment(first, dim) - C.transpose() * y_;
  const Eigen::MatrixXd S = S_.block(first, first, dim, dim) - C.transpose() * K_ * C;
  return r.dot(S.ldlt().solve(r));
}

}  // namespace mapjoin
