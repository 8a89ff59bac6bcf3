// What elimination in a given order will do, found without doing it: the elimination tree and the
// column counts.
//
// Position p means: the variable eliminated p-th. The parent of p is the first position above p
// that is coupled with p when p is eliminated. Eliminating p changes only its ancestors, so
// subtrees are independent of each other.
//
// All of it is computed from the *stars* of the cliques (the earliest variable of a clique with
// each other one): eliminating the earliest couples the rest anyway. So the cost is O(sum of clique
// sizes), up to the inverse Ackermann function, and nothing here depends on the fill.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mapjoin/solvers/block_ordering.h"
#include "mapjoin/solvers/worker_pool.h"

namespace mapjoin {

/// The couplings (earliest variable of a clique, another variable of it), listed per variable, both
/// ways. Duplicates stay.
struct Stars {
  std::vector<std::int32_t> owner;  ///< per clique: its earliest variable; -1 for an empty clique
  std::vector<std::int64_t>
      later_start;  ///< per variable v (+ 1): those whose earliest variable is v
  std::vector<std::int32_t> later;
  std::vector<std::int64_t> earlier_start;  ///< the transpose
  std::vector<std::int32_t> earlier;
};
Stars clique_stars(std::span<const std::int32_t> position, Cliques cliques,
                   WorkerPool* pool = nullptr);

/// parent[p] is a position above p, or -1 at a root. `order` and `position` are inverse
/// permutations.
std::vector<std::int32_t> elimination_tree(std::span<const std::int32_t> order,
                                           std::span<const std::int32_t> position,
                                           const Stars& stars);

/// Children before parents, subtrees contiguous; children by ascending index. No recursion: a path
/// of 10^6 nodes is fine. Works on any forest given by parents (parent[i] may also be below i).
std::vector<std::int32_t> postorder(std::span<const std::int32_t> parent);

/// The inverse of a permutation. \throws InputError where it is none.
std::vector<std::int32_t> inverse_permutation(std::span<const std::int32_t> permutation);

/// Renumbers positions by a postorder of their elimination tree; an equivalent order.
void apply_postorder(std::vector<std::int32_t>& order, std::vector<std::int32_t>& position,
                     std::vector<std::int32_t>& parent);

/// The size of column p of the factor, with its own variable: in scalars and in blocks.
struct ColumnCount {
  std::int32_t scalars = 0;
  std::int32_t blocks = 0;
};

/// Counts by the skeleton algorithm of Gilbert, Ng and Peyton (1994), weighted by dimension.
/// `column_dim` is the dimension of the variable at each position. `parent` must be postordered:
/// position p is the p-th node of its own postorder.
std::vector<ColumnCount> column_counts(std::span<const std::int32_t> column_dim,
                                       std::span<const std::int32_t> order,
                                       std::span<const std::int32_t> position,
                                       std::span<const std::int32_t> parent, const Stars& stars);

/// Floating-point operations of a Cholesky factorization in this order, no zeros made explicit.
double elimination_flops(std::span<const std::int32_t> dims, Cliques cliques,
                         std::span<const std::int32_t> order);

}  // namespace mapjoin
