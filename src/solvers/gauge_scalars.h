#pragma once

#include <Eigen/Core>
#include <compare>
#include <span>
#include <vector>

#include "mapjoin/graph/piece.h"

namespace mapjoin {

/// One scalar of a variable of a piece.
struct PieceScalar {
  int variable = 0;  ///< place in the piece
  int scalar = 0;    ///< of its tangent
  friend auto operator<=>(const PieceScalar&, const PieceScalar&) = default;
};

/// Numbers of the rows that are most independent, by Gram-Schmidt with pivoting: `count` of them,
/// or none where what is left of the last is not longer than `least` of the longest. O(rows *
/// count).
std::vector<int> independent_rows(Eigen::MatrixXd rows, int count, double least = 0.0);

/// kGauge scalars which, held, fix the gauge of a piece: all of the pose at place `pose` when that
/// is not negative, else those whose gauge rows are most independent (Gram-Schmidt with pivoting
/// over all of them). Sorted. O(variables).
template <int D>
std::vector<PieceScalar> gauge_scalars(const VariableSet<D>& all, const Piece<D>& piece, int pose);

/// The place of the lowest pose in a piece, -1 where it has none: what is held of a piece that no
/// other frame is asked for.
template <int D>
int lowest_pose(const VariableSet<D>& all, const Piece<D>& piece);

/// Of the given scalars, the kGauge whose gauge rows are most independent at the values of the
/// piece (Gram-Schmidt with pivoting). Sorted. O(variables).
template <int D>
std::vector<PieceScalar> most_independent(const VariableSet<D>& all, const Piece<D>& piece,
                                          const std::vector<PieceScalar>& candidates);

/// The stacked gauge rows of a piece: scalars x kGauge.
template <int D>
Eigen::MatrixXd gauge_rows(const VariableSet<D>& all, const Piece<D>& piece);

}  // namespace mapjoin
