// A symmetric block matrix as a system for the fronts: its blocks are the cliques.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "mapjoin/graph/block_matrix.h"
#include "mapjoin/solvers/frontal_cholesky.h"

namespace mapjoin {

/// The cliques of a block matrix, one a slot: two variables, or one on the diagonal.
struct BlockCliques {
  std::vector<std::int32_t> dims;
  std::vector<std::int64_t> start{0};
  std::vector<std::int32_t> variables;

  Cliques view() const { return {start, variables}; }
};

/// Slots for which `keep(row, column)` says no are empty cliques, which no front owns.
template <class Keep>
BlockCliques block_cliques(const SymmetricBlockMatrix& matrix, Keep&& keep) {
  BlockCliques out;
  out.start.reserve(static_cast<std::size_t>(matrix.blocks()) + 1);
  for (int j = 0; j < matrix.size(); ++j) {
    out.dims.push_back(matrix.dim(j));
    for (std::int64_t s = matrix.begin(j); s < matrix.end(j); ++s) {
      const int i = matrix.row(s);
      if (keep(i, j)) {
        out.variables.push_back(i);
        if (i != j) out.variables.push_back(j);
      }
      out.start.push_back(static_cast<std::int64_t>(out.variables.size()));
    }
  }
  return out;
}

/// Adds the slots that a front owns.
inline void assemble_blocks(const SymmetricBlockMatrix& matrix, const BlockCliques& cliques,
                            const FrontalStructure& structure, std::int32_t front,
                            const FrontView& view) {
  for (const std::int64_t slot : structure.owned_by(front)) {
    const auto row = structure.clique_rows(slot);
    const std::int32_t* const v = cliques.variables.data() + cliques.start[slot];
    const int j = row.size() == 1 ? v[0] : v[1];
    view.add(
        row[0], row[row.size() - 1],
        Eigen::Map<const Eigen::MatrixXd>(matrix.block(slot), matrix.dim(v[0]), matrix.dim(j)));
  }
}

}  // namespace mapjoin
