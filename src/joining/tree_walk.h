#pragma once

#include <atomic>
#include <exception>
#include <vector>

#include "mapjoin/graph/error.h"
#include "mapjoin/joining/join_tree.h"
#include "mapjoin/joining/options.h"
#include "mapjoin/solvers/worker_pool.h"

namespace mapjoin {

/// Does every node of a join tree, children first: do_node(node, thread, alone), where `alone` says
/// that no other node is being done at the same time, so the whole pool is free for this one.
///
/// Nodes of one level are spread over the pool's threads. An exception of the first node in the
/// tree's order that threw one is thrown on. \throws CancelledError when the progress callback says
/// so.
template <class DoNode>
void walk_tree(const JoinTree& tree, WorkerPool& pool, const ProgressCallback& progress,
               DoNode&& do_node) {
  std::size_t done = 0;
  for (const std::vector<std::int32_t>& level : tree.levels()) {
    if (progress && !progress({"join", static_cast<double>(done) / tree.nodes()}))
      throw CancelledError("cancelled while joining");
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
