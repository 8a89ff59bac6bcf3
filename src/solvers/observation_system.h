#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "mapjoin/graph/block_matrix.h"
#include "mapjoin/graph/measurement_graph.h"
#include "mapjoin/graph/piece.h"
#include "mapjoin/solvers/frontal_cholesky.h"
#include "mapjoin/solvers/observation_list.h"

namespace mapjoin {

/// Buffers of ObservationSystem::solve_subtree, one for each thread.
struct SubtreeScratch {
  explicit SubtreeScratch(const FactorOptions& options = {})
      : cholesky(std::make_unique<FrontalCholesky>(options)) {}
  std::unique_ptr<FrontalCholesky> cholesky;
  std::vector<double> by_position;
  std::vector<std::vector<std::int32_t>> slots;  ///< per type of measurement
  std::vector<double> parts;                     ///< of a sum
};

/// The linear least squares problem of one join: all observations of a piece, linearised where its
/// values are, with increments of its variables as unknowns.
///
/// Every observation is evaluated in its own anchor's frame at the current values, so the system is
/// exactly gauge-free; a few scalars are held to fix the gauge, and which ones does not matter. The
/// plan (order, fronts, offsets) is made once; each step evaluates every observation right inside
/// the front that eliminates its first variable, factorises and solves. Nothing is looked up by key
/// and nothing is allocated for a variable.
template <int D>
class ObservationSystem {
 public:
  struct Step {
    double chi2 = 0.0;                ///< before the step
    double predicted_decrease = 0.0;  ///< of chi2, by the linear model
    int failed = -1;  ///< number in the graph of a variable the observations do not determine
    bool ok() const { return failed < 0; }
  };

  /// Plans the system of piece.observations over piece.variables. `rank` orders the elimination:
  /// lower is sooner, one entry for each variable of the graph; empty: a fill-reducing order is
  /// computed, on the threads of `pool` if there is one. O(fill of the factor's pattern).
  ObservationSystem(const MeasurementGraph<D>& graph, const Piece<D>& piece,
                    std::span<const std::int32_t> rank, Places& places, WorkerPool* pool = nullptr);

  /// Solves A^T I_Z A d = A^T I_Z Z at the piece's values. `increment` becomes d, in the order of
  /// the piece's variables. Same bits for any number of threads of the pool.
  Step solve(const Piece<D>& piece, FrontalCholesky& cholesky, WorkerPool& pool,
             Eigen::VectorXd& increment);

  /// The same with the matrix of the last call of solve, whose factor `cholesky` still holds, and
  /// the gradient of now: a chord step. Near the minimum it is worth nearly as much as a whole one,
  /// at a third of the price or less. Elimination alone tells by how much chi2 would fall: where
  /// that is more than `most`, the rest is not done and nothing is returned.
  std::optional<Step> solve_again(const Piece<D>& piece, FrontalCholesky& cholesky,
                                  WorkerPool& pool, double most, Eigen::VectorXd& increment);

  /// What the step from `then`, the piece's values in the last call of solve, to where it is now
  /// missed, by the same matrix as solve_again. Asks less of it, and is right to a higher order:
  /// the residuals' curvature is seen along the step (as in geodesic acceleration, Transtrum and
  /// Sethna 2012), and how Jacobians turned, on what the linear model left of the residuals
  /// (graph/correction_kernel.h). Evaluates every measurement twice. Submaps know only their
  /// gradient of now: with any of them nothing is returned.
  std::optional<Step> correct(const std::vector<std::vector<double>>& then, const Piece<D>& piece,
                              FrontalCholesky& cholesky, WorkerPool& pool, double most,
                              Eigen::VectorXd& increment);

  /// Solves for the part of the system that a subtree of fronts eliminates, first .. root, and for
  /// the variables it shares with the rest, as if those observations were all there is; `sub` holds
  /// just these variables, this system's piece all variables of the graph. No new plan is made: the
  /// fronts are those of the whole. Nothing is returned when that cannot be done on the fronts
  /// alone (the shared variables do not fix a frame, or some variable is not determined): then plan
  /// a system of its own. `increment` becomes d, in the order of sub's variables. The threads of
  /// `pool` share a large subtree; or `loop` spreads what it can. The bits are the same whoever
  /// helps.
  std::optional<Step> solve_subtree(std::int32_t first, std::int32_t root, const Piece<D>& sub,
                                    Places& places, SubtreeScratch& scratch,
                                    Eigen::VectorXd& increment, WorkerPool& pool,
                                    LoopRunner loop = {});
  /// The sum of r^T I r over the same observations, at the values of `sub`.
  double subtree_chi2(std::int32_t first, std::int32_t root, const Piece<D>& sub, Places& places,
                      SubtreeScratch& scratch, LoopRunner loop = {}) const;

  const FrontalStructure& structure() const { return structure_; }

  /// The sum of r^T I r at the piece's values.
  double chi2(const Piece<D>& piece, WorkerPool& pool);

  /// Gauge-free information over the piece's variables at its values.
  SymmetricBlockMatrix information(const Piece<D>& piece) const { return list_.information(piece); }

  const FactorStatistics& statistics() const { return structure_.statistics; }

 private:
  /// Measurements of one type in the order of the fronts that own them.
  struct Relative {
    const RelativeMeasurements<D>* measurements = nullptr;
    int column = 0;                     ///< of the graph's variables
    std::int64_t first = 0;             ///< observation number of the first measurement
    std::vector<std::int32_t> id;       ///< row in the measurements
    std::vector<std::int32_t> slots;    ///< pairs: places of pose and variable within their columns
    std::vector<std::int32_t> offsets;  ///< pairs: rows in the owner's front
    std::vector<std::int64_t> front;    ///< per front: first entry
  };
  struct Held : PieceScalar {
    std::int64_t clique = 0;  ///< that holds this variable alone
    double weight = 1.0;
  };

  void hold_gauge(const Piece<D>& piece);
  void weigh_held(const Piece<D>& piece);
  void plan(const Piece<D>& piece, std::span<const std::int32_t> rank, WorkerPool* pool);
  int type_of(std::int64_t k) const;
  template <class Body>
  void for_fronts(LoopRunner loop, const Body& body) const;
  void sort_by_front(const Piece<D>& piece, LoopRunner loop);
  void count_by_front(LoopRunner loop);
  void take_owned(std::int32_t f, const Piece<D>& piece, int poses);
  RelativeBatch<D> batch(const Relative& relative, const Piece<D>& piece, std::int64_t first,
                         std::int64_t last) const;
  double assemble_submaps(std::int32_t front, const DenseTarget& target, const Piece<D>& piece,
                          const Places* places) const;
  void assemble(std::int32_t front, const DenseTarget& target, const Piece<D>& piece);
  void assemble_rhs(std::int32_t front, double* rhs, double* room, const Piece<D>& piece);
  void assemble_correction(std::int32_t front, double* rhs,
                           const std::vector<std::vector<double>>& then, const Piece<D>& piece);
  Step substitute_back(const FrontalCholesky& cholesky, WorkerPool& pool,
                       Eigen::VectorXd& increment) const;
  void find_slots(std::int32_t first, std::int32_t root, const Piece<D>& sub, const Places& places,
                  SubtreeScratch& scratch) const;
  std::vector<std::int32_t> held_rows(std::int32_t root, const Piece<D>& sub,
                                      const Places& places) const;

  const MeasurementGraph<D>& graph_;
  ObservationList<D> list_;
  CliqueList cliques_;  ///< of the observations; then one for each held variable
  std::vector<Held> held_;
  FrontalStructure structure_;
  std::vector<Relative> relative_;
  std::vector<std::int64_t> submap_cliques_;  ///< in the order of the fronts that own them
  std::vector<std::int64_t> submap_front_;    ///< per front: first entry
  std::vector<double> front_chi2_;
  bool weighed_ = false;
  bool has_submaps_ = false;
};

}  // namespace mapjoin
