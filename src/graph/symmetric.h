// Eigenvalues of small dense symmetric matrices, compiled once: Eigen's solver costs the compiler
// ten seconds wherever it is named, so other files ask here.
#pragma once

#include <Eigen/Core>

namespace mapjoin {

/// Of a symmetric n x n matrix, whose lower triangle is read: from the smallest, all finite where
/// the matrix is. Cost: O(n^3).
Eigen::VectorXd eigenvalues(const Eigen::Ref<const Eigen::MatrixXd>& symmetric);

struct Spectrum {
  Eigen::VectorXd values;   ///< from the smallest
  Eigen::MatrixXd vectors;  ///< orthonormal columns, in the order of the values
};

/// The same with eigenvectors.
Spectrum spectrum(const Eigen::Ref<const Eigen::MatrixXd>& symmetric);

}  // namespace mapjoin
