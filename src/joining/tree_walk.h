#pragma once

#include <atomic>
#include <exception>
#include <span>
#include <vector>

#include "mapjoin/graph/error.h"
#include "mapjoin/joining/join_tree.h"
#include "mapjoin/joining/options.h"
#include "mapjoin/solvers/pool_loop.h"
#include "mapjoin/solvers/tree_scheduler.h"
#include "mapjoin/solvers/worker_pool.h"

namespace mapjoin {

/// Does every node of a join tree, level by level, children first: do_node(node, thread, alone),
/// where `alone` says that no other node is being done at the same time, so the whole pool is free
/// for this one.
///
/// Nodes of one level are spread over the pool's threads. An exception of the first node of a level
/// that threw one is thrown on. \throws CancelledError when the progress callback says so.
template <class DoNode>
void walk_tree(const JoinTree& tree, WorkerPool& pool, const ProgressCallback& progress,
               DoNode&& do_node);

/// A forest without some of its roots, again and again.
struct ForestPart {
  std::vector<FrontTask> nodes;
  std::vector<std::int32_t> number;  ///< of each node in the whole forest
};

/// What is left of a forest without the marked nodes; with a node all above it is marked. O(nodes).
ForestPart part_of(std::span<const FrontTask> nodes, std::span<const char> marked);

/// Does every node of a forest (children before parents) as soon as its children are done:
/// do_node(node, thread, loop), where `loop` spreads an inner loop over threads that have nothing
/// else to do (LoopRunner).
///
/// Of what is ready, the node with the longest path to a root comes first. Nodes marked in
/// `together`, and with a node all above it, come after all others, one by one and on the calling
/// thread: the whole pool is free for them. Of the exceptions that nodes throw, the one of the
/// lowest node is thrown on; what lies above such a node is left out. \throws CancelledError when
/// the progress callback says so.
template <class DoNode>
void walk_forest(std::span<const FrontTask> nodes, std::span<const char> together, WorkerPool& pool,
                 const ProgressCallback& progress, DoNode&& do_node) {
  std::vector<std::exception_ptr> errors(nodes.size());
  std::vector<std::atomic<bool>> left_out(nodes.size());
  std::exception_ptr interruption;  // of the calling thread, which is thread 0
  std::atomic<bool> stop = false;
  std::atomic<std::size_t> done = 0;
  const auto report_progress = [&] {
    try {
      const double fraction = static_cast<double>(done) / static_cast<double>(nodes.size());
      if (!progress({"join", fraction})) throw CancelledError("cancelled while joining");
    } catch (...) {
      interruption = std::current_exception();
      stop = true;
    }
  };
  const auto visit = [&](int node, int thread, LoopRunner loop) {
    if (progress && thread == 0 && !stop) report_progress();
    const auto n = static_cast<std::size_t>(node);
    if (!stop && !left_out[n]) {
      try {
        do_node(node, thread, loop);
      } catch (...) {
        errors[n] = std::current_exception();
        left_out[n] = true;
      }
    }
    const std::int32_t parent = nodes[n].parent;
    if (parent >= 0 && left_out[n]) left_out[static_cast<std::size_t>(parent)] = true;
    ++done;
  };
  if (pool.threads() == 1) {
    for (std::size_t n = 0; n < nodes.size(); ++n) visit(static_cast<int>(n), 0, {});
  } else {
    const ForestPart apart = part_of(nodes, together);
    TreeScheduler scheduler;
    scheduler.reset(apart.nodes, pool.threads());
    pool.run([&](int thread) {
      scheduler.work(thread, [&](int k, LoopRunner loop) {
        visit(apart.number[static_cast<std::size_t>(k)], thread, loop);
      });
    });
    for (std::size_t n = 0; n < nodes.size(); ++n) {
      if (together[n] != 0) visit(static_cast<int>(n), 0, {});
    }
  }
  if (interruption) std::rethrow_exception(interruption);
  rethrow_first(errors);
}

template <class DoNode>
void walk_tree(const JoinTree& tree, WorkerPool& pool, const ProgressCallback& progress,
               DoNode&& do_node) {
  const auto total = static_cast<double>(tree.nodes());
  std::size_t done = 0;
  for (const std::vector<std::int32_t>& level : tree.levels()) {
    if (progress && !progress({"join", static_cast<double>(done) / total})) {
      throw CancelledError("cancelled while joining");
    }
    done += level.size();
    if (level.size() == 1) {
      do_node(level[0], 0, true);
      continue;
    }
    std::atomic<std::size_t> next{0};
    std::vector<std::exception_ptr> errors(level.size());
    pool.run([&](int thread) {
      for (std::size_t k = next++; k < level.size(); k = next++) {
        try {
          do_node(level[k], thread, false);
        } catch (...) {
          errors[k] = std::current_exception();
        }
      }
    });
    rethrow_first(errors);
  }
}

}  // namespace mapjoin
