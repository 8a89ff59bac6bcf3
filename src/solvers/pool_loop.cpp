#include "mapjoin/solvers/pool_loop.h"

#include <atomic>

namespace mapjoin {

LoopRunner loop_on(WorkerPool& pool) {
  if (pool.threads() == 1) return {};
  const auto run = [](void* runner, int count, void* context, LoopRunner::Body body) {
    std::atomic<int> next = 0;
    static_cast<WorkerPool*>(runner)->run([&](int) {
      for (int i = next++; i < count; i = next++) body(context, i);
    });
  };
  return {.run = run, .runner = &pool};
}

}  // namespace mapjoin
