#include "mapjoin/solvers/worker_pool.h"

#include "mapjoin/solvers/patience.h"

namespace mapjoin {
namespace {

/// Returns when `value` is no longer `old`: awake at first, then asleep.
template <class T>
void wait_for_change(const std::atomic<T>& value, T old) {
  for (Patience patience; value.load(std::memory_order_acquire) == old;) {
    if (patience.lasts()) {
      patience.wait();
    } else {
      value.wait(old, std::memory_order_acquire);
    }
  }
}

}  // namespace

WorkerPool::WorkerPool(int threads) {
  for (int t = 1; t < threads; ++t) workers_.emplace_back([this, t] { work(t); });
}

WorkerPool::~WorkerPool() {
  start(nullptr, nullptr);  // no job: go home
  for (std::thread& worker : workers_) worker.join();
}

void WorkerPool::start(Call call, void* object) {
  if (workers_.empty()) return;
  call_ = call;
  object_ = object;
  still_running_.store(static_cast<int>(workers_.size()), std::memory_order_relaxed);
  jobs_started_.fetch_add(1, std::memory_order_release);
  jobs_started_.notify_all();
}

void WorkerPool::finish() {
  if (workers_.empty()) return;
  for (int running = still_running_.load(std::memory_order_acquire); running > 0;
       running = still_running_.load(std::memory_order_acquire)) {
    wait_for_change(still_running_, running);
  }
}

void WorkerPool::work(int thread) {
  for (std::uint32_t jobs_seen = 0;; ++jobs_seen) {
    wait_for_change(jobs_started_, jobs_seen);
    if (call_ == nullptr) return;
    call_(object_, thread);
    if (still_running_.fetch_sub(1, std::memory_order_acq_rel) == 1) still_running_.notify_one();
  }
}

}  // namespace mapjoin
