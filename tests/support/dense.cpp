#include "tests/support/dense.h"

#include <Eigen/LU>
#include <Eigen/QR>

namespace mapjoin::test {

Eigen::MatrixXd dense_inverse(const Eigen::MatrixXd& A) { return A.inverse(); }
Eigen::MatrixXd dense_solve(const Eigen::MatrixXd& A, const Eigen::MatrixXd& b) {
  return A.partialPivLu().solve(b);
}
Eigen::MatrixXd dense_least_squares(const Eigen::MatrixXd& A, const Eigen::MatrixXd& b) {
  return A.completeOrthogonalDecomposition().solve(b);
}
double dense_determinant(const Eigen::MatrixXd& A) { return A.determinant(); }

}  // namespace mapjoin::test
