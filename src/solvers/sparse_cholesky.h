#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>
#include <vector>

#include "mapjoin/graph/block_matrix.h"

namespace mapjoin {

/// Sparse Cholesky factorisation of a block matrix by CHOLMOD: the choice for the single join of
/// two maps, and the reference that the frontal solver is tested against.
///
/// The fill-reducing order is computed on the block graph (3 to 6 times smaller than the scalar
/// one) and handed over; whether CHOLMOD works column by column or on dense supernodes follows from
/// the plan's operation count. The plan is kept: factorize() again for other numbers in the same
/// pattern.
class SparseCholesky {
 public:
  enum class Method { kAutomatic, kSimplicial, kSupernodal };

  explicit SparseCholesky(Method method = Method::kAutomatic);
  ~SparseCholesky();
  SparseCholesky(SparseCholesky&&) noexcept;
  SparseCholesky& operator=(SparseCholesky&&) noexcept;

  /// Plans for a pattern of blocks. The scalars `dropped` (ascending) are left out: their rows and
  /// columns are not part of the system, and solutions are zero there.
  void analyze(const SymmetricBlockMatrix& pattern, std::span<const int> dropped);

  /// \returns -1, or the first scalar at which the matrix is not positive definite.
  int factorize(const SymmetricBlockMatrix& matrix);

  /// x = H^-1 b, all scalars, one column a right-hand side. After a factorize() that returned -1.
  Eigen::MatrixXd solve(const Eigen::MatrixXd& b) const;

  double factor_nonzeros() const;
  double flops() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace mapjoin
