// What elimination in a given order will do, found by doing it without numbers.
//
// Position p means: the variable eliminated p-th. Eliminating p couples all the later variables
// that p is coupled with by then: its *pattern*. The first of them takes the rest over; it is the
// parent of p in the elimination tree, and subtrees are independent of each other. Where the parent
// is coupled with nothing else, both have one pattern and form a *supernode*.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mapjoin/solvers/block_graph.h"

namespace mapjoin {

/// Children come before parents.
struct SupernodeTree {
  std::vector<std::int32_t> of;      ///< per position
  std::vector<std::int32_t> parent;  ///< per supernode; -1 at a root
  std::vector<std::int32_t> last;    ///< position
  std::vector<std::int32_t> pivot_dim, update_dim;
  std::vector<std::int32_t> update_blocks;
  std::vector<std::int64_t> start, end;  ///< per supernode, into `entries`
  std::vector<std::int32_t> entries;     ///< positions, in no order

  std::int32_t size() const { return static_cast<std::int32_t>(parent.size()); }
  /// Calls visit(p) for the positions p coupled with the supernode's last one: its update set.
  template <class Visit>
  void for_each_update(std::int32_t supernode, Visit visit) const {
    for (std::int64_t e = start[supernode]; e < end[supernode]; ++e) {
      if (entries[e] > last[supernode]) visit(entries[e]);
    }
  }
};

/// `order` and `position` are inverse permutations. Only the first `eliminated` variables are
/// eliminated (-1: all); each of the others is a supernode without parent or update set. `graph`
/// may be sparser than the block graph as long as elimination makes the same of it: see
/// star_graph. Cost: O(neighbours + the supernodes' patterns), at most blocks of L.
SupernodeTree eliminate_symbolically(std::span<const std::int32_t> dims, const BlockGraph& graph,
                                     std::span<const std::int32_t> order,
                                     std::span<const std::int32_t> position,
                                     std::int32_t eliminated = -1);

/// Links from the earliest variable of each clique to the others, which it couples with one another
/// when it is eliminated. Some may be there twice. Cost: O(sum of clique sizes).
BlockGraph star_graph(std::span<const std::int32_t> position, Cliques cliques);

/// The inverse of a permutation. \throws InputError where it is none.
std::vector<std::int32_t> inverse_permutation(std::span<const std::int32_t> permutation);

/// Floating-point operations of a Cholesky factorization in this order, no zeros made explicit.
double elimination_flops(std::span<const std::int32_t> dims, const BlockGraph& graph,
                         std::span<const std::int32_t> order);

}  // namespace mapjoin
