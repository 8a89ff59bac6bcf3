// Block multifrontal Cholesky factorization of H = sum over cliques, and the solution of H x = b.
//
//   const auto order = order_blocks(dims, cliques);
//   const FrontalStructure structure = analyze(dims, cliques, order);
//   WorkerPool pool(2);
//   FrontalCholesky cholesky;
//   const auto assemble = [&](std::int32_t front, const FrontView& view) {
//     for (const std::int64_t k : structure.owned_by(front)) {
//       const auto row = structure.clique_rows(k);  // per variable of clique k
//       view.add(row[0], row[0], H00(k));
//       view.add(row[1], row[0], H10(k));           // either side of the diagonal
//       view.add(row[1], row[1], H11(k));
//       view.add_rhs(row[0], b0(k));
//       view.add_rhs(row[1], b1(k));
//     }
//   };
//   if (const FactorStatus status = cholesky.factorize(structure, assemble, pool); !status.ok())
//   ... cholesky.solve(x, pool);                        // x in the order of the variables
//
// Results are the same bits for any number of threads.
#pragma once

#include <Eigen/Core>
#include <atomic>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <type_traits>
#include <vector>

#include "mapjoin/solvers/aligned_buffer.h"
#include "mapjoin/solvers/extend_add.h"
#include "mapjoin/solvers/factor_memory.h"
#include "mapjoin/solvers/front_kernels.h"
#include "mapjoin/solvers/fronts.h"
#include "mapjoin/solvers/tree_scheduler.h"
#include "mapjoin/solvers/worker_pool.h"

namespace mapjoin {

struct FactorOptions {
  /// A pivot must exceed this share of the diagonal entry of H it came from: what is left below may
  /// be rounding error.
  ///
  /// No value separates the two for sure. Measured on maps without any anchor, where the last pivot
  /// should be 0: up to 2e-14 for 1000 variables, 1e-11 for 100,000. A long chain anchored at one
  /// end has honest pivots as small as that.
  double smallest_pivot = 1e-13;
  FactorResidence residence;  ///< how much of the factor may be in memory at a time
};

struct FactorStatus {
  std::int32_t failed_variable =
      -1;  ///< the first, in elimination order, that is not determined; -1 if all are

  bool ok() const { return failed_variable < 0; }
};

/// The conditional of a front's pivots given its update set: L11 x = y - L21' u, read from the
/// stored panel.
struct FrontConditional {
  using Panel = Eigen::Map<const Eigen::MatrixXd, 0, Eigen::OuterStride<>>;
  Panel l11;  ///< p x p; its lower triangle only, what is above is undefined
  Panel l21;  ///< q x p
  Eigen::Map<const Eigen::RowVectorXd, 0, Eigen::InnerStride<>>
      y;  ///< right-hand side after elimination, of the b that came with H
};

class FrontalCholesky {
 public:
  explicit FrontalCholesky(const FactorOptions& options = {})
      : options_(options), factor_(options.residence) {}

  /// Makes room for all of a factor at once, so that factors of ever larger subtrees need not be
  /// moved from one room to the next: what was touched once stays. Where the factor may not be in
  /// memory this does nothing.
  void reserve(const FrontalStructure& structure);

  /// Factors H and eliminates b with it. Memory is kept for the next call.
  ///
  /// assemble(front, view) adds the cliques of structure.owned_by(front) to the view, which is zero
  /// at first. Called once for each front, from several threads at a time for different fronts; it
  /// must not throw. `structure` must outlive the factor. When the status is not ok, the factor is
  /// of no use.
  template <class Assemble>
  FactorStatus factorize(const FrontalStructure& structure, Assemble&& assemble, WorkerPool& pool) {
    using Type = std::remove_reference_t<Assemble>;
    const auto call = [](const void* object, std::int32_t front, const FrontView& view) {
      (*static_cast<Type*>(const_cast<void*>(object)))(front, view);
    };
    return factorize(structure, Assembler{.call = call, .object = std::addressof(assemble)}, pool);
  }
  template <class Assemble>
  FactorStatus factorize(const FrontalStructure& structure, Assemble&& assemble) {
    WorkerPool caller_only;
    return factorize(structure, assemble, caller_only);
  }

  /// Eliminates another b with the factor there is, instead of the one that came with H: what
  /// follows (solve, squared_norm_of_y) is about it. Reads the factor once. Once the squared norm
  /// of y exceeds `most`, what is left to do is left undone, and the result of no use: \returns
  /// whether it did not.
  ///
  /// assemble(front, rhs, room) adds the share of structure().owned_by(front) to `rhs`, one entry
  /// for each row of the front, zero at first; `room` is for its own use, twice as long, zero too.
  /// Else as in factorize.
  template <class Assemble>
  bool eliminate(Assemble&& assemble, WorkerPool& pool,
                 double most = std::numeric_limits<double>::infinity()) {
    using Type = std::remove_reference_t<Assemble>;
    const auto call = [](const void* object, std::int32_t front, double* rhs, double* room) {
      (*static_cast<Type*>(const_cast<void*>(object)))(front, rhs, room);
    };
    return eliminate(RhsAssembler{.call = call, .object = std::addressof(assemble)}, pool, most);
  }

  /// x = H^-1 b for the assembled b, in the order of the variables: back substitution only.
  void solve(Eigen::Ref<Eigen::VectorXd> x, WorkerPool& pool) const;
  void solve(Eigen::Ref<Eigen::VectorXd> x) const;

  /// B := H^-1 B for any right-hand sides (rows in the order of the variables, one column each).
  void solve_in_place(Eigen::Ref<Eigen::MatrixXd> b) const;

  /// Factors a whole subtree only: the fronts first .. root, `root` being its root. What is left of
  /// H and b for the update variables of `root` stays in the workspace, for close_subtree, which
  /// has to follow. The threads of `pool` share a large subtree's tasks; or `loop` may spread the
  /// loops inside large fronts, where the caller's own thread is one of a pool.
  template <class Assemble>
  FactorStatus factorize_subtree(const FrontalStructure& structure, std::int32_t first,
                                 std::int32_t root, Assemble&& assemble, WorkerPool& pool,
                                 LoopRunner loop = {}) {
    using Type = std::remove_reference_t<Assemble>;
    const auto call = [](const void* object, std::int32_t front, const FrontView& view) {
      (*static_cast<Type*>(const_cast<void*>(object)))(front, view);
    };
    return factorize_subtree(structure, first, root,
                             Assembler{.call = call, .object = std::addressof(assemble)}, pool,
                             loop);
  }
  template <class Assemble>
  FactorStatus factorize_subtree(const FrontalStructure& structure, std::int32_t first,
                                 std::int32_t root, Assemble&& assemble) {
    WorkerPool caller_only;
    return factorize_subtree(structure, first, root, assemble, caller_only);
  }

  /// Solves for the update variables of a factored subtree's root, with the given of their scalars
  /// (rows of the update matrix) held: each gets a stiffness of the size of its own diagonal in H.
  /// False when they are not determined. Then substitutes back: `by_position` holds the solution of
  /// the subtree's variables and of those update variables, by scalars in elimination order.
  /// `decrease` becomes b' H^-1 b of the subtree. Call it straight after factorize_subtree: later
  /// fronts reuse the memory of the update matrix.
  bool close_subtree(std::int32_t first, std::int32_t root, std::span<const std::int32_t> held,
                     std::span<double> by_position, double& decrease, WorkerPool& pool);

  /// What is left of H for the update variables of the root of a factored subtree: their Schur
  /// complement, without what other subtrees add. The lower triangle only. Valid straight after
  /// factorize_subtree.
  Eigen::Map<const Eigen::MatrixXd, 0, Eigen::OuterStride<>> update_matrix(std::int32_t root) const;

  const FrontalStructure& structure() const { return *structure_; }
  FrontConditional conditional(std::int32_t front) const;

  /// The logarithm of det H.
  double log_determinant() const;
  /// b' H^-1 b for the assembled b: how much the cost 1/2 x' H x - b' x falls, twice.
  double squared_norm_of_y() const;

 private:
  struct Assembler {
    void (*call)(const void* object, std::int32_t front, const FrontView& view);
    const void* object;
  };

  /// What each thread has for itself. The same stack serves one task after another, so it stays in
  /// the cache.
  struct ThreadRoom {
    AlignedBuffer scratch;  ///< columns of the largest front
    AlignedBuffer stack;    ///< update matrices that are used within their task
  };

  struct RhsAssembler {
    void (*call)(const void* object, std::int32_t front, double* rhs, double* room);
    const void* object;
  };

  FactorStatus factorize(const FrontalStructure& structure, Assembler assemble, WorkerPool& pool);
  bool eliminate(RhsAssembler assemble, WorkerPool& pool, double most);
  template <class Work>
  void for_each_task(std::span<const FrontTask> tasks, WorkerPool& pool, Work&& work);
  FactorStatus factorize_subtree(const FrontalStructure& structure, std::int32_t first,
                                 std::int32_t root, Assembler assemble, WorkerPool& pool,
                                 LoopRunner loop);
  void substitute_tasks(std::span<const FrontTask> tasks, double* by_position,
                        WorkerPool& pool) const;
  FactorStatus status() const;
  void require_memory(const FrontalStructure& structure, std::int64_t first_panel,
                      std::int64_t end_panel, int threads);
  void require_rooms(int threads);
  void require_workspace(const FrontalStructure& structure);
  void require_workspace(const FrontalStructure& structure, std::int32_t first, std::int32_t root);
  double* panel(const Front& front) const { return factor_.data() + (front.panel - first_panel_); }
  double* update_place(const Front& front, const ThreadRoom& room) const {
    return structure_->is_on_stack(front) ? room.stack.data() + front.update
                                          : workspace_.data() + (front.update - first_update_);
  }
  UpdateMatrix update_of(const Front& front, const ThreadRoom& room) const {
    return {front, update_place(front, room)};
  }
  void factor_fronts(std::int32_t begin, std::int32_t end, Assembler assemble,
                     const ThreadRoom& room, LoopRunner loop);
  void give_back_update(const Front& front);
  void give_back_updates(std::int32_t front);
  void substitute_fronts(std::int32_t begin, std::int32_t end, double* x, double* local) const;
  void factor_front(std::int32_t front, Assembler assemble, const ThreadRoom& room,
                    LoopRunner loop);
  void forward_substitute_fronts(std::int32_t begin, std::int32_t end, RhsAssembler assemble,
                                 const ThreadRoom& room);
  void forward_substitute(std::int32_t front, RhsAssembler assemble, const ThreadRoom& room);
  void back_substitute(std::int32_t front, double* x, double* local) const;

  FactorOptions options_;
  const FrontalStructure* structure_ = nullptr;
  FactorMemory factor_;
  std::int64_t first_panel_ = 0;   ///< offset in the structure of what lies first in factor_
  std::vector<double> squared_y_;  ///< per front
  std::vector<double> other_y_;    ///< of `eliminate`, in the order of elimination; else empty
  AlignedBuffer workspace_;        ///< update matrices that wait for another task
  std::int64_t first_update_ = 0;  ///< offset in the structure of what lies first in workspace_
  std::vector<ThreadRoom> rooms_;  ///< per thread
  AlignedBuffer closing_;          ///< the dense system of close_subtree
  TreeScheduler scheduler_;
  std::atomic<std::int32_t> first_failure_ = 0;  ///< in scalars of the elimination order
};

}  // namespace mapjoin
