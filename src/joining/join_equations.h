#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <span>
#include <vector>

#include "mapjoin/graph/anchor.h"
#include "mapjoin/graph/block_matrix.h"
#include "mapjoin/graph/piece.h"

namespace mapjoin {

/// A map on its way through summary joins: values, gauge-free information over them, nothing else.
template <int D>
struct Summary {
  Piece<D> piece;
  SymmetricBlockMatrix information;  ///< in the order of piece.variables
  Anchor<D> solved_in{};  ///< what the last solve held; none: a pose, or not solved in any frame
};

/// The linear least squares problem of a join, equations (12)-(15) of Linear SLAM: min |A d - Z|^2
/// in the norm of I_Z.
///
/// The unknowns d are increments of the joined map's variables about x_0. Every map contributes one
/// row of blocks for each of its variables: in A, at the variable's column, S = d local(value_k,
/// x_0 [+] d) / dd, which is E where the map agrees with x_0 (for points always; for planar poses
/// up to a rotation of the block); in Z, -local(value_k, x_0). I_Z is block diagonal, the maps'
/// information matrices.
struct JoinEquations {
  struct Rows {               ///< of one map
    std::vector<int> column;  ///< block column of each of its variables
    std::vector<int> offset;  ///< first scalar row of each, within the map, and their number
    std::vector<std::int64_t> block;  ///< first double of each S in `blocks`
    std::vector<double> blocks;
    Eigen::VectorXd z;
    const SymmetricBlockMatrix* information = nullptr;
  };
  std::vector<Rows> maps;
  std::vector<int>
      column_offset;  ///< first scalar column of each joined variable, and their number

  Eigen::SparseMatrix<double> A() const;
  Eigen::VectorXd Z() const;
  Eigen::SparseMatrix<double> I_Z() const;  ///< symmetric, both triangles

  /// A^T I_Z A (17), computed on the blocks: what the join solves, and the joined information.
  SymmetricBlockMatrix normal_matrix() const;
  /// A^T I_Z Z.
  Eigen::VectorXd right_hand_side() const;
};

/// The equations of joining placed maps about x0, whose variables are the union of theirs.
/// O(variables + blocks).
template <int D>
JoinEquations join_equations(const VariableSet<D>& all, std::span<const Summary<D>* const> maps,
                             const Piece<D>& x0);

}  // namespace mapjoin
