#include "mapjoin/solvers/tree_scheduler.h"

#include <algorithm>
#include <thread>

namespace mapjoin {
namespace {

constexpr int kCountBits = 20;
constexpr std::uint64_t kCountMask = (std::uint64_t{1} << kCountBits) - 1;

// Waiting is short when all threads have a core of their own; when they have not, the core is given
// away.
class Patience {
 public:
  void wait() {
    if (++rounds_ < 512) {
#if defined(__x86_64__) || defined(__i386__)
      __builtin_ia32_pause();
#endif
    } else {
      std::this_thread::yield();
    }
  }
  void renew() { rounds_ = 0; }

 private:
  int rounds_ = 0;
};

}  // namespace

void SharedLoop::run(int count, void* context, LoopRunner::Body body) {
  context_ = context;
  body_ = body;
  done_.store(0, std::memory_order_relaxed);
  const std::uint64_t loop_number =
      (ticket_.load(std::memory_order_relaxed) >> (2 * kCountBits)) + 1;
  ticket_.store(
      (loop_number << (2 * kCountBits)) | (static_cast<std::uint64_t>(count) << kCountBits),
      std::memory_order_release);
  while (help()) {
  }
  for (Patience patience; done_.load(std::memory_order_acquire) < count;) patience.wait();
}

bool SharedLoop::help() {
  const auto left = [](std::uint64_t t) {
    return (t & kCountMask) < ((t >> kCountBits) & kCountMask);
  };
  if (!left(ticket_.load(std::memory_order_relaxed))) return false;
  const std::uint64_t ticket = ticket_.fetch_add(1, std::memory_order_acq_rel);
  if (!left(ticket)) return false;
  body_(context_, static_cast<int>(ticket & kCountMask));
  done_.fetch_add(1, std::memory_order_release);
  return true;
}

void TreeScheduler::reset(std::span<const FrontTask> tasks, int threads) {
  tasks_ = tasks;
  if (threads > threads_)
    loops_ = std::make_unique<SharedLoop[]>(static_cast<std::size_t>(threads));
  threads_ = std::max(threads, threads_);
  waits_for_.clear();
  ready_.clear();
  ready_.reserve(tasks.size());
  for (std::size_t t = 0; t < tasks.size(); ++t) {
    waits_for_.push_back(tasks[t].waits_for);
    if (tasks[t].waits_for == 0) ready_.push_back(static_cast<std::int32_t>(t));
  }
  const auto sooner = [&](int a, int b) { return tasks_[a].path_cost < tasks_[b].path_cost; };
  std::make_heap(ready_.begin(), ready_.end(), sooner);
  ready_count_ = static_cast<int>(ready_.size());
  remaining_ = static_cast<int>(tasks.size());
}

int TreeScheduler::finish_and_take(int finished) {
  const auto sooner = [&](int a, int b) { return tasks_[a].path_cost < tasks_[b].path_cost; };
  const std::lock_guard lock(mutex_);
  if (finished >= 0) {
    const int parent = tasks_[finished].parent;
    if (parent >= 0 && --waits_for_[parent] == 0) {
      ready_.push_back(parent);
      std::push_heap(ready_.begin(), ready_.end(), sooner);
    }
    remaining_.fetch_sub(1, std::memory_order_release);
  }
  int task = -1;
  if (!ready_.empty()) {
    std::pop_heap(ready_.begin(), ready_.end(), sooner);
    task = ready_.back();
    ready_.pop_back();
  }
  ready_count_.store(static_cast<int>(ready_.size()), std::memory_order_relaxed);
  return task;
}

int TreeScheduler::next(int finished) {
  int task = finish_and_take(finished);
  for (Patience patience; task < 0;) {
    if (remaining_.load(std::memory_order_acquire) == 0) return -1;
    if (ready_count_.load(std::memory_order_relaxed) > 0) {
      task = finish_and_take(-1);
      continue;
    }
    bool helped = false;
    for (int t = 0; t < threads_; ++t) helped |= loops_[t].help();
    if (helped) {
      patience.renew();
    } else {
      patience.wait();
    }
  }
  return task;
}

void TreeScheduler::run_shared(void* loop, int count, void* context, LoopRunner::Body body) {
  static_cast<SharedLoop*>(loop)->run(count, context, body);
}

}  // namespace mapjoin
