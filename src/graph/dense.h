// A few operations on dense matrices of any size, compiled once: Eigen's decompositions and
// products cost the compiler up to seconds wherever they are named, so files that are not about
// speed ask here. Symmetric eigenvalues are in graph/symmetric.h.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

namespace mapjoin {

using ConstMatrixRef = Eigen::Ref<const Eigen::MatrixXd>;

/// A B.
Eigen::MatrixXd times(const ConstMatrixRef& A, const ConstMatrixRef& B);

/// J P J^T.
Eigen::MatrixXd carried(const ConstMatrixRef& J, const ConstMatrixRef& P);

/// (A + A^T) / 2.
Eigen::MatrixXd symmetric_part(const ConstMatrixRef& A);

/// Rows and columns `place` of A.
Eigen::MatrixXd picked(const ConstMatrixRef& A, std::span<const int> place);
/// n x n: A in rows and columns `place`, zero elsewhere.
Eigen::MatrixXd embedded(const ConstMatrixRef& A, std::span<const int> place, Eigen::Index n);

/// Does A have an inverse, as far as rounding lets one tell?
bool is_regular(const ConstMatrixRef& A);

/// A^-1 by elimination with partial pivoting, for a regular A.
Eigen::MatrixXd inverse_of(const ConstMatrixRef& A);

/// A^-1 B by elimination with full pivoting, for a regular A.
Eigen::MatrixXd solve_regular(const ConstMatrixRef& A, const ConstMatrixRef& B);

/// A^-1 by Cholesky's factorisation; nothing when A is not positive definite.
std::optional<Eigen::MatrixXd> inverse_of_definite(const ConstMatrixRef& A);

/// A^-1 B for a positive definite A, whose lower triangle is read.
Eigen::MatrixXd solve_definite(const ConstMatrixRef& A, const ConstMatrixRef& B);
/// D of A = P^T L D L^T P, likewise.
Eigen::VectorXd pivots_of(const ConstMatrixRef& A);

}  // namespace mapjoin
