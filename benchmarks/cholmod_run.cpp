#include "benchmarks/cholmod_run.h"

#include <cholmod.h>
#include <fmt/format.h>

#include <array>

#include "mapjoin/graph/error.h"

namespace mapjoin::benchmarks {

namespace {

constexpr std::array kVariants = {
    CholmodVariant{"simplicial LL, AMD", false, true, false},
    CholmodVariant{"simplicial LDL, AMD", false, false, false},
    CholmodVariant{"supernodal, AMD", true, true, false},
    CholmodVariant{"simplicial LL, METIS", false, true, true},
    CholmodVariant{"simplicial LDL, METIS", false, false, true},
    CholmodVariant{"supernodal, METIS", true, true, true},
};

/// CHOLMOD's workspace and results, freed whatever happens.
struct Cholmod {
  cholmod_common common{};
  cholmod_factor* factor = nullptr;
  cholmod_dense* x = nullptr;

  explicit Cholmod(const CholmodVariant& variant) {
    cholmod_start(&common);
    common.print = 0;
    common.supernodal = variant.supernodal ? CHOLMOD_SUPERNODAL : CHOLMOD_SIMPLICIAL;
    common.final_ll = variant.ll ? 1 : 0;
    common.nmethods = 1;
    common.method[0].ordering = variant.metis ? CHOLMOD_METIS : CHOLMOD_AMD;
    common.postorder = 1;
  }
  ~Cholmod() {
    cholmod_free_dense(&x, &common);
    cholmod_free_factor(&factor, &common);
    cholmod_finish(&common);
  }
  Cholmod(const Cholmod&) = delete;
  Cholmod& operator=(const Cholmod&) = delete;
};

// CHOLMOD does not write into what it is given, but does not say so.
cholmod_sparse view_of(const Eigen::SparseMatrix<double>& lower) {
  cholmod_sparse view{};
  view.nrow = view.ncol = static_cast<std::size_t>(lower.rows());
  view.nzmax = static_cast<std::size_t>(lower.nonZeros());
  view.p = const_cast<int*>(lower.outerIndexPtr());
  view.i = const_cast<int*>(lower.innerIndexPtr());
  view.x = const_cast<double*>(lower.valuePtr());
  view.stype = -1;
  view.itype = CHOLMOD_INT;
  view.xtype = CHOLMOD_REAL;
  view.dtype = CHOLMOD_DOUBLE;
  view.sorted = 1;
  view.packed = 1;
  return view;
}

cholmod_dense view_of(const Eigen::VectorXd& b) {
  cholmod_dense view{};
  view.nrow = view.d = view.nzmax = static_cast<std::size_t>(b.size());
  view.ncol = 1;
  view.x = const_cast<double*>(b.data());
  view.xtype = CHOLMOD_REAL;
  view.dtype = CHOLMOD_DOUBLE;
  return view;
}

}  // namespace

std::span<const CholmodVariant> cholmod_variants() { return kVariants; }

Measured run_cholmod(const CholmodVariant& variant, const Eigen::SparseMatrix<double>& lower,
                     const Eigen::VectorXd& b) {
  cholmod_sparse H = view_of(lower);
  cholmod_dense right = view_of(b);
  Cholmod c(variant);
  Laps watch;
  c.factor = cholmod_analyze(&H, &c.common);
  watch.lap();
  if (c.factor != nullptr) cholmod_factorize(&H, c.factor, &c.common);
  watch.lap();
  if (c.common.status == CHOLMOD_OK) c.x = cholmod_solve(CHOLMOD_A, c.factor, &right, &c.common);
  watch.lap();
  if (c.x == nullptr) {
    throw Error(fmt::format("CHOLMOD ({}) did not factor the final information matrix, status {}",
                            variant.name, c.common.status));
  }
  const Eigen::Map<const Eigen::VectorXd> x(static_cast<const double*>(c.x->x), b.size());
  const double residual = (lower.selfadjointView<Eigen::Lower>() * x - b).norm() / b.norm();
  if (!(residual < 1e-6)) {
    throw Error(fmt::format("CHOLMOD ({}) solved with a relative residual of {:.1e}", variant.name,
                            residual));
  }
  return std::move(watch).measured();
}

}  // namespace mapjoin::benchmarks
