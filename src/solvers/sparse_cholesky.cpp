#include "mapjoin/solvers/sparse_cholesky.h"

#include <cholmod.h>

#include "mapjoin/graph/error.h"
#include "mapjoin/graph/index.h"
#include "mapjoin/solvers/block_ordering.h"

namespace mapjoin {

namespace {

/// The block pattern as cliques of two.
std::vector<std::int32_t> order_of(const SymmetricBlockMatrix& pattern) {
  std::vector<std::int64_t> start{0};
  std::vector<std::int32_t> variables, dims;
  for (int j = 0; j < pattern.size(); ++j) {
    dims.push_back(pattern.dim(j));
    for (std::int64_t s = pattern.begin(j) + 1; s < pattern.end(j); ++s) {
      variables.push_back(pattern.row(s));
      variables.push_back(j);
      start.push_back(static_cast<std::int64_t>(variables.size()));
    }
  }
  return order_blocks(dims, {start, variables});
}

}  // namespace

struct SparseCholesky::State {
  cholmod_common common{};
  cholmod_sparse* matrix = nullptr;
  cholmod_factor* factor = nullptr;
  std::vector<int> place;   // scalar of the matrix -> row of the system, -1: dropped
  std::vector<int> scalar;  // its inverse

  State() { cholmod_start(&common); }
  ~State() {
    cholmod_free_sparse(&matrix, &common);
    cholmod_free_factor(&factor, &common);
    cholmod_finish(&common);
  }
  State(const State&) = delete;
  State& operator=(const State&) = delete;
};

SparseCholesky::SparseCholesky(Method method) : state_(std::make_unique<State>()) {
  cholmod_common& c = state_->common;
  c.supernodal = method == Method::kAutomatic    ? CHOLMOD_AUTO
                 : method == Method::kSimplicial ? CHOLMOD_SIMPLICIAL
                                                 : CHOLMOD_SUPERNODAL;
  c.final_ll = 1;
  c.print = 0;
  c.error_handler = nullptr;
  c.quick_return_if_not_posdef = 1;
  // One given permutation: the block order.
  c.nmethods = 1;
  c.method[0].ordering = CHOLMOD_GIVEN;
  c.postorder = 1;
}
SparseCholesky::~SparseCholesky() = default;
SparseCholesky::SparseCholesky(SparseCholesky&&) noexcept = default;
SparseCholesky& SparseCholesky::operator=(SparseCholesky&&) noexcept = default;

void SparseCholesky::analyze(const SymmetricBlockMatrix& pattern, std::span<const int> dropped) {
  State& s = *state_;
  s.place.assign(at(pattern.scalars()), 0);
  s.scalar.clear();
  for (const int d : dropped) s.place[at(d)] = -1;
  for (int k = 0; k < pattern.scalars(); ++k) {
    if (s.place[at(k)] < 0) continue;
    s.place[at(k)] = static_cast<int>(s.scalar.size());
    s.scalar.push_back(k);
  }
  std::size_t nonzeros = 0;
  for (int j = 0; j < pattern.size(); ++j) {
    for (std::int64_t b = pattern.begin(j); b < pattern.end(j); ++b)
      nonzeros += at(pattern.dim(pattern.row(b)) * pattern.dim(j));
  }
  cholmod_free_sparse(&s.matrix, &s.common);
  cholmod_free_factor(&s.factor, &s.common);
  const std::size_t n = s.scalar.size();
  s.matrix = cholmod_allocate_sparse(n, n, nonzeros, 1, 1, -1, CHOLMOD_REAL, &s.common);
  if (s.matrix == nullptr) throw Error("not enough memory for the sparse system");
  auto* const start = static_cast<int*>(s.matrix->p);
  auto* const row = static_cast<int*>(s.matrix->i);
  int next = 0;
  for (int j = 0; j < pattern.size(); ++j) {
    for (int c = 0; c < pattern.dim(j); ++c) {
      const int column = s.place[at(pattern.offset(j) + c)];
      if (column < 0) continue;
      start[column] = next;
      for (std::int64_t b = pattern.begin(j); b < pattern.end(j); ++b) {
        const int i = pattern.row(b);
        for (int r = i == j ? c : 0; r < pattern.dim(i); ++r) {
          if (s.place[at(pattern.offset(i) + r)] >= 0)
            row[next++] = s.place[at(pattern.offset(i) + r)];
        }
      }
    }
  }
  start[n] = next;

  std::vector<int> permutation;
  permutation.reserve(n);
  for (const std::int32_t v : order_of(pattern)) {
    for (int k = 0; k < pattern.dim(v); ++k) {
      if (s.place[at(pattern.offset(v) + k)] >= 0)
        permutation.push_back(s.place[at(pattern.offset(v) + k)]);
    }
  }
  s.factor = cholmod_analyze_p(s.matrix, permutation.data(), nullptr, 0, &s.common);
  if (s.factor == nullptr)
    throw Error("CHOLMOD could not analyse the sparse system: not enough memory");
}

int SparseCholesky::factorize(const SymmetricBlockMatrix& matrix) {
  State& s = *state_;
  auto* const value = static_cast<double*>(s.matrix->x);
  std::size_t next = 0;
  for (int j = 0; j < matrix.size(); ++j) {
    for (int c = 0; c < matrix.dim(j); ++c) {
      if (s.place[at(matrix.offset(j) + c)] < 0) continue;
      for (std::int64_t b = matrix.begin(j); b < matrix.end(j); ++b) {
        const int i = matrix.row(b);
        const double* const from = matrix.block(b) + static_cast<std::ptrdiff_t>(c) * matrix.dim(i);
        for (int r = i == j ? c : 0; r < matrix.dim(i); ++r) {
          if (s.place[at(matrix.offset(i) + r)] >= 0) value[next++] = from[r];
        }
      }
    }
  }
  cholmod_factorize(s.matrix, s.factor, &s.common);
  if (s.common.status == CHOLMOD_OK) return -1;
  if (s.common.status != CHOLMOD_NOT_POSDEF)
    throw Error("CHOLMOD could not factorise the sparse system: not enough memory");
  return s.scalar[at(static_cast<const int*>(s.factor->Perm)[s.factor->minor])];
}

Eigen::MatrixXd SparseCholesky::solve(const Eigen::MatrixXd& b) const {
  State& s = *state_;
  const auto n = static_cast<Eigen::Index>(s.scalar.size());
  Eigen::MatrixXd right(n, b.cols());
  for (Eigen::Index k = 0; k < n; ++k) right.row(k) = b.row(s.scalar[at(k)]);
  cholmod_dense view{};
  view.nrow = at(n);
  view.ncol = at(b.cols());
  view.d = at(n);
  view.nzmax = at(right.size());
  view.x = right.data();
  view.xtype = CHOLMOD_REAL;
  view.dtype = CHOLMOD_DOUBLE;
  cholmod_dense* x = cholmod_solve(CHOLMOD_A, s.factor, &view, &s.common);
  if (x == nullptr) throw Error("CHOLMOD could not solve the sparse system: not enough memory");
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(b.rows(), b.cols());
  const Eigen::Map<const Eigen::MatrixXd> solution(static_cast<const double*>(x->x), n, b.cols());
  for (Eigen::Index k = 0; k < n; ++k) out.row(s.scalar[at(k)]) = solution.row(k);
  cholmod_free_dense(&x, &s.common);
  return out;
}

double SparseCholesky::factor_nonzeros() const { return state_->common.lnz; }
double SparseCholesky::flops() const { return state_->common.fl; }

}  // namespace mapjoin
