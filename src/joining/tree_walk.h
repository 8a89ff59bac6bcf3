#pragma once

#include <atomic>
#include <exception>
#include <vector>

#include "mapjoin/graph/error.h"
#include "mapjoin/joining/join_tree.h"
#include "mapjoin/joining/options.h"
#include "mapjoin/solvers/worker_pool.h"

namespace mapjoin {

/// Does every node of `levels`, level by level: do_node(node, thread, alone), where `alone` says
/// that no other node is being done at the same time, so the whole pool is free for this one.
///
/// Nodes of one level are spread over the pool's threads. An exception of the first node of a level
/// that threw one is thrown on. \throws CancelledError when the progress callback says so.
template <class DoNode>
void walk_levels(const std::vector<std::vector<std::int32_t>>& levels, WorkerPool& pool,
                 const ProgressCallback& progress, DoNode&& do_node);

/// The same for a join tree: children first.
template <class DoNode>
void walk_tree(const JoinTree& tree, WorkerPool& pool, const ProgressCallback& progress,
               DoNode&& do_node) {
  walk_levels(tree.levels(), pool, progress, do_node);
}

template <class DoNode>
void walk_levels(const std::vector<std::vector<std::int32_t>>& levels, WorkerPool& pool,
                 const ProgressCallback& progress, DoNode&& do_node) {
  std::size_t total = 0;
  for (const auto& level : levels) total += level.size();
  std::size_t done = 0;
  for (const std::vector<std::int32_t>& level : levels) {
    if (progress && !progress({"join", static_cast<double>(done) / static_cast<double>(total)})) {
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
    for (const std::exception_ptr& error : errors) {
      if (error) std::rethrow_exception(error);
    }
  }
}

}  // namespace mapjoin
