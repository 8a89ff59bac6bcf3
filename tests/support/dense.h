// Textbook answers for dense matrices, compiled once: Eigen's decompositions cost the compiler
// seconds wherever they are named.
#pragma once

#include <Eigen/Core>

namespace mapjoin::test {

/// By elimination with partial pivoting: A is square and regular.
Eigen::MatrixXd dense_inverse(const Eigen::MatrixXd& A);
Eigen::MatrixXd dense_solve(const Eigen::MatrixXd& A, const Eigen::MatrixXd& b);
/// The shortest of the x with the smallest |A x - b|; A of any shape and rank.
Eigen::MatrixXd dense_least_squares(const Eigen::MatrixXd& A, const Eigen::MatrixXd& b);
double dense_determinant(const Eigen::MatrixXd& A);

}  // namespace mapjoin::test
