// Selected inversion: blocks of the inverse of a factored matrix, without the inverse.
//
// For a front with pivots 1 and update variables 2, H^-1 = Z satisfies (Takahashi's equations)
//
//     W    =  L21 L11^-1
//     Z21  = -Z22 W
//     Z11  =  L11^-T L11^-1 - W' Z21
//
// and the update variables of a front all lie in its parent's front. So one walk down the tree,
// which hands each child its Z22, gives Z wherever the factor has an entry, and never more than
// the fronts on hand: about twice the work of the factorisation.
#pragma once

#include <cstdint>
#include <span>

#include "mapjoin/solvers/frontal_cholesky.h"

namespace mapjoin {

/// Diagonal blocks of H^-1. `place[v]` says where in `out` the block of variable v goes
/// (column-major, dims[v] x dims[v]); -1 where it is not wanted. Fronts with nothing wanted in or
/// below them are passed over, so a few variables of a large system cost the path to the root. The
/// right-hand side is not used.
///
/// Memory: one dense front, and Z22 of the siblings of those on the way to the root. No recursion.
void selected_inverse(const FrontalCholesky& factor, std::span<const std::int64_t> place,
                      double* out);

}  // namespace mapjoin
