#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "mapjoin/graph/block_matrix.h"
#include "mapjoin/graph/piece.h"
#include "mapjoin/solvers/gauge_scalars.h"
#include "mapjoin/solvers/submap_kernel.h"

namespace mapjoin {

/// The observations of a piece, each as a clique of places in the piece, ready to be evaluated at
/// its values.
template <int D>
class ObservationList {
 public:
  /// O(observations).
  ObservationList(const MeasurementGraph<D>& graph, const Piece<D>& piece, Places& places);

  const MeasurementGraph<D>& graph() const { return graph_; }
  std::size_t size() const { return observations_.size(); }
  const std::vector<std::int32_t>& dims() const { return dims_; }
  const CliqueList& cliques() const { return cliques_; }
  /// Number in the graph of the k-th observation; ascending in k.
  std::int64_t observation(std::int64_t k) const {
    return observations_[static_cast<std::size_t>(k)];
  }
  /// The places of the variables of the k-th observation, its anchor's first.
  std::span<const std::int32_t> clique(std::int64_t k) const;

  /// All scalars of the variables that the k-th observation, a local map, is anchored at.
  std::vector<PieceScalar> anchor_scalars(std::int64_t k) const;

  /// Adds the k-th observation's normal equations to a target in which its variables start at
  /// `rows`; a null target only computes. \returns r^T I r.
  double evaluate(std::int64_t k, const Piece<D>& piece, std::span<const std::int32_t> rows,
                  const DenseTarget* target, SubmapScratch& scratch) const;
  /// The same at the values of another piece, whose variables stand at `places` (this list's piece
  /// being all variables of the graph).
  double evaluate_at(std::int64_t k, const Piece<D>& other, const Places& places,
                     std::span<const std::int32_t> rows, const DenseTarget* target,
                     SubmapScratch& scratch) const;
  /// The same into a dense matrix over its own variables: lower triangle; the last row is the
  /// right-hand side.
  double evaluate_alone(std::int64_t k, const Piece<D>& piece, Eigen::MatrixXd& H,
                        SubmapScratch& scratch) const;

  /// The sum of r^T I r over all of them.
  double chi2(const Piece<D>& piece) const;

  /// Gauge-free information over the piece's variables at its values: the sum over all
  /// observations.
  SymmetricBlockMatrix information(const Piece<D>& piece) const;
  /// The doubles of a variable of a piece.
  const double* value(const Piece<D>& piece, int place) const;

 private:
  double evaluate_values(std::int64_t k, std::span<const double* const> values,
                         std::span<const std::int32_t> rows, const DenseTarget* target,
                         SubmapScratch& scratch) const;

  const MeasurementGraph<D>& graph_;
  std::vector<std::int64_t> observations_;
  std::vector<std::int32_t> dims_;
  CliqueList cliques_;
};

}  // namespace mapjoin
