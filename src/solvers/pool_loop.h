// Loops, and pairs of steps, spread over an idle pool.
#pragma once

#include <algorithm>
#include <exception>
#include <span>

#include "mapjoin/solvers/front_kernels.h"
#include "mapjoin/solvers/worker_pool.h"

namespace mapjoin {

/// Spreads loops over the threads of a pool, which take iterations one by one. A plain loop where
/// there is one thread. The pool must be idle when a loop starts, and outlive the runner.
LoopRunner loop_on(WorkerPool& pool);

/// Runs body(first, last) for stretches of at most `chunk` of 0 .. size - 1, spread by `loop`.
template <class Body>
void run_chunks(int size, int chunk, LoopRunner loop, const Body& body) {
  run_loop((size + chunk - 1) / chunk, loop,
           [&](int c) { body(c * chunk, std::min((c + 1) * chunk, size)); });
}

/// Throws on the first exception there is, of what threads caught and put down; returns if none.
inline void rethrow_first(std::span<const std::exception_ptr> failures) {
  for (const std::exception_ptr& failure : failures) {
    if (failure) std::rethrow_exception(failure);
  }
}

/// Runs two steps that have nothing to do with one another, at the same time where there is a pool
/// of threads. Throws on what they throw, the first one's before the second one's.
template <class First, class Second>
void run_both(WorkerPool* pool, const First& first, const Second& second) {
  if (pool == nullptr || pool->threads() == 1) {
    first();
    second();
    return;
  }
  std::exception_ptr failures[2];
  const auto run = [&](int step, const auto& body) {
    try {
      body();
    } catch (...) {
      failures[step] = std::current_exception();
    }
  };
  pool->run([&](int thread) {
    if (thread == 0) run(0, first);
    if (thread == 1) run(1, second);
  });
  rethrow_first(failures);
}

}  // namespace mapjoin
