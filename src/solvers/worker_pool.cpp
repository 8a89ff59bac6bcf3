#include "mapjoin/solvers/worker_pool.h"

namespace mapjoin {

WorkerPool::WorkerPool(int threads) {
  for (int t = 1; t < threads; ++t) workers_.emplace_back([this, t] { work(t); });
}

WorkerPool::~WorkerPool() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  wake_.notify_all();
  for (std::thread& worker : workers_) worker.join();
}

void WorkerPool::start(Call call, void* object) {
  if (workers_.empty()) return;
  {
    const std::lock_guard lock(mutex_);
    call_ = call;
    object_ = object;
    still_running_ = static_cast<int>(workers_.size());
    ++jobs_started_;
  }
  wake_.notify_all();
}

void WorkerPool::finish() {
  if (workers_.empty()) return;
  std::unique_lock lock(mutex_);
  done_.wait(lock, [&] { return still_running_ == 0; });
}

void WorkerPool::work(int thread) {
  std::int64_t jobs_seen = 0;
  std::unique_lock lock(mutex_);
  while (true) {
    wake_.wait(lock, [&] { return stop_ || jobs_started_ > jobs_seen; });
    if (stop_) return;
    jobs_seen = jobs_started_;
    const Call call = call_;
    void* const object = object_;
    lock.unlock();
    call(object, thread);
    lock.lock();
    if (--still_running_ == 0) done_.notify_one();
  }
}

}  // namespace mapjoin
