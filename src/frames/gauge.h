#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <span>
#include <vector>

#include "mapjoin/frames/anchors.h"
#include "mapjoin/graph/map.h"

namespace mapjoin {

/// Gauge-free information from information in a frame: Lambda = J^T I J, J = E - g C^-1 P.
///
/// `anchored` is over all variables, in the tangents at `values` (which are written in the anchor's
/// frame), with zero rows and columns where the anchor pins. The result moves nothing when the
/// whole map moves: Lambda g = 0. It has a row of blocks between the anchor and every variable that
/// has information. O(n + blocks). Works for any anchor.
template <int D>
SymmetricBlockMatrix complete_gauge(const Values<D>& values, const Anchor<D>& anchor,
                                    const SymmetricBlockMatrix& anchored);

/// The same from its parts: the stacked gauge rows g of all variables, and what the anchor does.
SymmetricBlockMatrix complete_gauge(const Eigen::MatrixXd& g, const AnchorRows& anchor,
                                    const SymmetricBlockMatrix& anchored);

/// Sets the rows and columns of the given scalars (ascending) to zero: information over what a
/// frame leaves free, as complete_gauge wants it. O(blocks).
void leave_out(SymmetricBlockMatrix& information, std::span<const int> scalars);

/// The information matrix of the papers: a map's information without the pinned rows and columns of
/// its anchor.
struct AnchoredInformation {
  std::vector<int> scalars;  ///< which scalars of the map's tangent the rows are, ascending
  Eigen::SparseMatrix<double> lower;  ///< lower triangle
  Eigen::MatrixXd dense() const {
    const Eigen::MatrixXd half(lower);
    return half.selfadjointView<Eigen::Lower>();
  }
};

/// Drops what the anchor pins. O(blocks).
/// \throws DegenerateFrameError. \throws InputError when the anchor pins mixtures of scalars, which
/// cannot be dropped.
template <int D>
AnchoredInformation anchored_information(const Map<D>& map);

}  // namespace mapjoin
