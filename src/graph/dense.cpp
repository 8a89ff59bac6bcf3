#include "mapjoin/graph/dense.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "mapjoin/graph/index.h"

namespace mapjoin {

Eigen::MatrixXd times(const ConstMatrixRef& A, const ConstMatrixRef& B) { return A * B; }

Eigen::MatrixXd carried(const ConstMatrixRef& J, const ConstMatrixRef& P) {
  const Eigen::MatrixXd transposed = J.transpose();
  return times(times(J, P), transposed);
}

Eigen::MatrixXd symmetric_part(const ConstMatrixRef& A) { return 0.5 * (A + A.transpose()); }

Eigen::MatrixXd picked(const ConstMatrixRef& A, std::span<const int> place) {
  const auto n = static_cast<Eigen::Index>(place.size());
  Eigen::MatrixXd out(n, n);
  for (Eigen::Index c = 0; c < n; ++c) {
    for (Eigen::Index r = 0; r < n; ++r) out(r, c) = A(place[at(r)], place[at(c)]);
  }
  return out;
}

Eigen::MatrixXd embedded(const ConstMatrixRef& A, std::span<const int> place, Eigen::Index n) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index c = 0; c < A.cols(); ++c) {
    for (Eigen::Index r = 0; r < A.rows(); ++r) out(place[at(r)], place[at(c)]) = A(r, c);
  }
  return out;
}

bool is_regular(const ConstMatrixRef& A) {
  return Eigen::FullPivLU<Eigen::MatrixXd>(A).isInvertible();
}

Eigen::MatrixXd inverse_of(const ConstMatrixRef& A) {
  return Eigen::PartialPivLU<Eigen::MatrixXd>(A).inverse();
}

Eigen::MatrixXd solve_regular(const ConstMatrixRef& A, const ConstMatrixRef& B) {
  return Eigen::FullPivLU<Eigen::MatrixXd>(A).solve(B);
}

std::optional<Eigen::MatrixXd> inverse_of_definite(const ConstMatrixRef& A) {
  const Eigen::LLT<Eigen::MatrixXd> llt(A);
  if (llt.info() != Eigen::Success) return std::nullopt;
  return llt.solve(Eigen::MatrixXd::Identity(A.rows(), A.rows()));
}

Eigen::MatrixXd solve_definite(const ConstMatrixRef& A, const ConstMatrixRef& B) {
  return Eigen::LDLT<Eigen::MatrixXd>(A).solve(B);
}

Eigen::VectorXd pivots_of(const ConstMatrixRef& A) {
  return Eigen::LDLT<Eigen::MatrixXd>(A).vectorD();
}

}  // namespace mapjoin
