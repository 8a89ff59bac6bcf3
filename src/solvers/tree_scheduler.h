// Hands the tasks of a tree to threads, children before parents, and lets idle threads help with
// loops inside large tasks.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "mapjoin/solvers/front_kernels.h"
#include "mapjoin/solvers/fronts.h"

namespace mapjoin {

/// A loop that its owner has opened to helpers: iterations are taken one by one from a shared
/// ticket.
class alignas(64) SharedLoop {
 public:
  /// Runs all iterations, together with whoever helps; returns when all are done. Owner only.
  void run(int count, void* context, LoopRunner::Body body);
  /// Runs one iteration if one is left.
  bool help();

 private:
  /// Low 20 bits: next iteration; then 20 bits: number of iterations; then a counter of loops, so
  /// that a helper that comes too late for one loop can only ever take a valid iteration of the
  /// next.
  std::atomic<std::uint64_t> ticket_ = 0;
  std::atomic<int> done_ = 0;
  void* context_ = nullptr;
  LoopRunner::Body body_ = nullptr;
};

/// The thread, of 0 .. threads - 1, that each task had best be done by: neighbouring subtrees,
/// alike in cost. In every pass over the same tree that is the same, so a thread finds in its
/// caches what it wrote in the pass before.
void share_tasks(std::span<const FrontTask> tasks, int threads, std::vector<std::int32_t>& owner);

/// All tasks, parents before children, in an order for threads to go down the trees: the longest
/// way from a task's start to the last leaf below it first. A thread whose subtrees hang from a
/// path that another one goes down then need not wait until that one has done what else hangs
/// there. One thread goes from the last task to the first.
std::vector<std::int32_t> downwards(std::span<const FrontTask> tasks, int threads);

/// One pass over a task tree. Which thread runs what depends on timing; results must not.
class TreeScheduler {
 public:
  /// Prepares a pass for up to `threads` threads. Allocates only when something has grown.
  void reset(std::span<const FrontTask> tasks, int threads);

  /// To be called by each thread: calls run(task, loop) for one ready task after another, the
  /// longest path to the root first, until all tasks are done: of its own tasks (share_tasks) as
  /// long as there are any, then of others'. `loop` spreads an inner loop over idle threads.
  template <class Run>
  void work(int thread, Run&& run) {
    const LoopRunner loop{.run = run_shared, .runner = &loops_[static_cast<std::size_t>(thread)]};
    int task = -1;
    while ((task = next(thread, task)) >= 0) run(task, loop);
  }

 private:
  /// Marks `finished` (or -1) done and returns the next task, waiting and helping meanwhile; -1
  /// when all are done.
  int next(int thread, int finished);
  int finish_and_take(int thread, int finished);
  int take(int thread);
  void make_ready(int task);
  static void run_shared(void* loop, int count, void* context, LoopRunner::Body body);

  std::span<const FrontTask> tasks_;
  std::mutex mutex_;
  std::vector<std::int32_t> waits_for_;
  std::vector<std::int32_t> owner_;               ///< per task
  std::vector<std::vector<std::int32_t>> ready_;  ///< per thread: a heap by path cost
  std::atomic<int> remaining_ = 0;
  std::atomic<int> ready_count_ = 0;
  std::unique_ptr<SharedLoop[]> loops_;
  int threads_ = 0;
};

}  // namespace mapjoin
