#include "mapjoin/solvers/dense_blas.h"

#include "mapjoin/solvers/blas_threads.h"

extern "C" {
void dgemm_(const char*, const char*, const int*, const int*, const int*, const double*,
            const double*, const int*, const double*, const int*, const double*, double*,
            const int*);
void dsyrk_(const char*, const char*, const int*, const int*, const double*, const double*,
            const int*, const double*, double*, const int*);
void dpotrf_(const char*, const int*, double*, const int*, int*);
void dtrsm_(const char*, const char*, const char*, const char*, const int*, const int*,
            const double*, const double*, const int*, double*, const int*);
}

namespace mapjoin {

namespace {

int size(Eigen::Index n) { return static_cast<int>(n); }

constexpr double kOne = 1.0;

}  // namespace

void multiply(double alpha, const Eigen::Ref<const Eigen::MatrixXd>& A,
              const Eigen::Ref<const Eigen::MatrixXd>& B, double beta,
              Eigen::Ref<Eigen::MatrixXd> C) {
  if (C.size() == 0) return;
  const SingleThreadedBlas one_thread;
  const int m = size(C.rows()), n = size(C.cols()), k = size(A.cols());
  const int lda = size(A.outerStride()), ldb = size(B.outerStride()), ldc = size(C.outerStride());
  dgemm_("N", "N", &m, &n, &k, &alpha, A.data(), &lda, B.data(), &ldb, &beta, C.data(), &ldc);
}

void add_square(double alpha, const Eigen::Ref<const Eigen::MatrixXd>& A,
                Eigen::Ref<Eigen::MatrixXd> C) {
  if (C.size() == 0 || A.cols() == 0) return;
  const SingleThreadedBlas one_thread;
  const int n = size(C.rows()), k = size(A.cols());
  const int lda = size(A.outerStride()), ldc = size(C.outerStride());
  dsyrk_("L", "N", &n, &k, &alpha, A.data(), &lda, &kOne, C.data(), &ldc);
}

int factor_lower(Eigen::Ref<Eigen::MatrixXd> A) {
  if (A.size() == 0) return -1;
  const SingleThreadedBlas one_thread;
  const int n = size(A.rows()), lda = size(A.outerStride());
  int info = 0;
  dpotrf_("L", &n, A.data(), &lda, &info);
  return info - 1;
}

void solve_lower_left(const Eigen::Ref<const Eigen::MatrixXd>& L, Eigen::Ref<Eigen::MatrixXd> B) {
  if (B.size() == 0) return;
  const SingleThreadedBlas one_thread;
  const int m = size(B.rows()), n = size(B.cols());
  const int lda = size(L.outerStride()), ldb = size(B.outerStride());
  dtrsm_("L", "L", "N", "N", &m, &n, &kOne, L.data(), &lda, B.data(), &ldb);
}

void solve_transposed_left(const Eigen::Ref<const Eigen::MatrixXd>& L,
                           Eigen::Ref<Eigen::MatrixXd> B) {
  if (B.size() == 0) return;
  const SingleThreadedBlas one_thread;
  const int m = size(B.rows()), n = size(B.cols());
  const int lda = size(L.outerStride()), ldb = size(B.outerStride());
  dtrsm_("L", "L", "T", "N", &m, &n, &kOne, L.data(), &lda, B.data(), &ldb);
}

void solve_lower_right(const Eigen::Ref<const Eigen::MatrixXd>& L, Eigen::Ref<Eigen::MatrixXd> B) {
  if (B.size() == 0) return;
  const SingleThreadedBlas one_thread;
  const int m = size(B.rows()), n = size(B.cols());
  const int lda = size(L.outerStride()), ldb = size(B.outerStride());
  dtrsm_("R", "L", "T", "N", &m, &n, &kOne, L.data(), &lda, B.data(), &ldb);
}

}  // namespace mapjoin
