#include "mapjoin/solvers/tree_scheduler.h"

#include <algorithm>
#include <numeric>

#include "mapjoin/solvers/patience.h"

namespace mapjoin {
namespace {

constexpr int kCountBits = 20;
constexpr std::uint64_t kCountMask = (std::uint64_t{1} << kCountBits) - 1;

double own_cost(std::span<const FrontTask> tasks, const FrontTask& task) {
  return task.path_cost - (task.parent < 0 ? 0.0 : tasks[task.parent].path_cost);
}

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

void share_tasks(std::span<const FrontTask> tasks, int threads, std::vector<std::int32_t>& owner) {
  double total = 0.0;
  for (const FrontTask& task : tasks) total += own_cost(tasks, task);
  double before = 0.0;
  owner.clear();
  for (const FrontTask& task : tasks) {
    const double middle = before + 0.5 * own_cost(tasks, task);
    before += own_cost(tasks, task);
    const double share = total > 0.0 ? middle / total : 0.0;
    owner.push_back(std::min(static_cast<int>(share * threads), threads - 1));
  }
}

std::vector<std::int32_t> downwards(std::span<const FrontTask> tasks, int threads) {
  std::vector<std::int32_t> order(tasks.size());
  std::iota(order.rbegin(), order.rend(), 0);
  if (threads == 1) return order;
  std::vector<double> way(tasks.size(), 0.0);
  for (std::size_t t = 0; t < tasks.size(); ++t) {
    const FrontTask& task = tasks[t];
    way[t] += own_cost(tasks, task);
    if (task.parent >= 0) way[task.parent] = std::max(way[task.parent], way[t]);
  }
  std::stable_sort(order.begin(), order.end(),
                   [&](std::int32_t a, std::int32_t b) { return way[a] > way[b]; });
  return order;
}

void TreeScheduler::reset(std::span<const FrontTask> tasks, int threads) {
  tasks_ = tasks;
  if (threads > threads_)
    loops_ = std::make_unique<SharedLoop[]>(static_cast<std::size_t>(threads));
  threads_ = std::max(threads, threads_);
  share_tasks(tasks, threads, owner_);
  waits_for_.clear();
  ready_.resize(static_cast<std::size_t>(threads_));
  for (auto& heap : ready_) heap.clear();
  ready_count_ = 0;
  for (std::size_t t = 0; t < tasks.size(); ++t) {
    waits_for_.push_back(tasks[t].waits_for);
    if (tasks[t].waits_for == 0) make_ready(static_cast<int>(t));
  }
  remaining_ = static_cast<int>(tasks.size());
}

void TreeScheduler::make_ready(int task) {
  const auto sooner = [&](int a, int b) { return tasks_[a].path_cost < tasks_[b].path_cost; };
  auto& heap = ready_[static_cast<std::size_t>(owner_[task])];
  heap.push_back(task);
  std::push_heap(heap.begin(), heap.end(), sooner);
  ready_count_.fetch_add(1, std::memory_order_relaxed);
}

int TreeScheduler::take(int thread) {
  const auto sooner = [&](int a, int b) { return tasks_[a].path_cost < tasks_[b].path_cost; };
  auto* from = &ready_[static_cast<std::size_t>(thread)];
  if (from->empty()) {
    for (auto& heap : ready_) {
      if (!heap.empty() && (from->empty() || sooner(from->front(), heap.front()))) from = &heap;
    }
    if (from->empty()) return -1;
  }
  std::pop_heap(from->begin(), from->end(), sooner);
  const int task = from->back();
  from->pop_back();
  ready_count_.fetch_sub(1, std::memory_order_relaxed);
  return task;
}

int TreeScheduler::finish_and_take(int thread, int finished) {
  const std::lock_guard lock(mutex_);
  if (finished >= 0) {
    const int parent = tasks_[finished].parent;
    if (parent >= 0 && --waits_for_[parent] == 0) make_ready(parent);
    remaining_.fetch_sub(1, std::memory_order_release);
  }
  return take(thread);
}

int TreeScheduler::next(int thread, int finished) {
  int task = finish_and_take(thread, finished);
  for (Patience patience; task < 0;) {
    if (remaining_.load(std::memory_order_acquire) == 0) return -1;
    if (ready_count_.load(std::memory_order_relaxed) > 0) {
      task = finish_and_take(thread, -1);
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
