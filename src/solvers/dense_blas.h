// Large dense products and factorisations by the BLAS and LAPACK of the system, which choose their
// kernels at run time (Eigen is kept from seeing wide registers, see src/CMakeLists.txt). One
// thread; results do not depend on how many there are.
#pragma once

#include <Eigen/Core>

namespace mapjoin {

/// C = beta C + alpha A B. C must not overlap A or B.
void multiply(double alpha, const Eigen::Ref<const Eigen::MatrixXd>& A,
              const Eigen::Ref<const Eigen::MatrixXd>& B, double beta,
              Eigen::Ref<Eigen::MatrixXd> C);

/// Lower triangle of C = C + alpha A A^T.
void add_square(double alpha, const Eigen::Ref<const Eigen::MatrixXd>& A,
                Eigen::Ref<Eigen::MatrixXd> C);

/// The lower triangle of A becomes L, A = L L^T. \returns -1, or the first row whose pivot is not
/// positive: it and what follows are then of no use.
int factor_lower(Eigen::Ref<Eigen::MatrixXd> A);

/// B := L^-1 B, B := L^-T B, and B := B L^-T, for the lower triangle L.
void solve_lower_left(const Eigen::Ref<const Eigen::MatrixXd>& L, Eigen::Ref<Eigen::MatrixXd> B);
void solve_transposed_left(const Eigen::Ref<const Eigen::MatrixXd>& L,
                           Eigen::Ref<Eigen::MatrixXd> B);
void solve_lower_right(const Eigen::Ref<const Eigen::MatrixXd>& L, Eigen::Ref<Eigen::MatrixXd> B);

}  // namespace mapjoin
