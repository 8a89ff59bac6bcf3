#include "mapjoin/graph/symmetric.h"

#include <Eigen/Eigenvalues>

namespace mapjoin {

Eigen::VectorXd eigenvalues(const Eigen::Ref<const Eigen::MatrixXd>& symmetric) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(symmetric, Eigen::EigenvaluesOnly)
      .eigenvalues();
}

Spectrum spectrum(const Eigen::Ref<const Eigen::MatrixXd>& symmetric) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(symmetric);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

}  // namespace mapjoin
