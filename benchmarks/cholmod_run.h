#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <span>

#include "benchmarks/measure.h"

namespace mapjoin::benchmarks {

/// Phases of a run, in the order in which they are returned.
inline constexpr const char* kCholmodPhases[] = {"ordering and analysis", "numeric", "solve"};

/// A way of using CHOLMOD.
struct CholmodVariant {
  const char* name;
  bool supernodal;  ///< else column by column
  bool ll;          ///< L L', else L D L' (column by column only)
  bool metis;       ///< nested dissection, else AMD
};

/// Those that are worth comparing with, on the scalar matrix.
std::span<const CholmodVariant> cholmod_variants();

/// Orders, analyses, factors and solves H x = b once: what every step of a nonlinear solver takes
/// at least, and so the yardstick for a whole run. `lower` is the lower triangle of H.
///
/// \throws Error when H is not positive definite or the residual is not small.
Measured run_cholmod(const CholmodVariant& variant, const Eigen::SparseMatrix<double>& lower,
                     const Eigen::VectorXd& b);

}  // namespace mapjoin::benchmarks
