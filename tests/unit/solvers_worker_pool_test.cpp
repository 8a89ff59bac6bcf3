#include "mapjoin/solvers/worker_pool.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <numeric>
#include <thread>
#include <utility>
#include <vector>

#include "mapjoin/graph/error.h"
#include "mapjoin/solvers/pool_loop.h"
#include "mapjoin/solvers/tree_scheduler.h"

namespace mapjoin {
namespace {

TEST(WorkerPool, RunsEveryJobOnceOnEveryThread) {
  for (const int threads : {1, 2, 3, 8}) {
    SCOPED_TRACE(threads);
    WorkerPool pool(threads);
    std::vector<int> count(static_cast<std::size_t>(threads), 0);
    for (int job = 0; job < 2000; ++job)
      pool.run([&](int thread) { ++count[static_cast<std::size_t>(thread)]; });
    EXPECT_EQ(count, std::vector<int>(count.size(), 2000));
  }
}

// What a job wrote is there for the caller and for the next job.
TEST(WorkerPool, HandsResultsFromJobToJob) {
  WorkerPool pool(3);
  std::vector<long> value{1, 2, 3};
  std::vector<long> next(3);
  for (int job = 0; job < 500; ++job) {
    pool.run([&](int t) {
      next[static_cast<std::size_t>(t)] =
          (value[static_cast<std::size_t>((t + 1) % 3)] + 7 * value[static_cast<std::size_t>(t)]) %
          1009;
    });
    value = next;
  }
  std::vector<long> expected{1, 2, 3};
  for (int job = 0; job < 500; ++job) {
    for (std::size_t t = 0; t < 3; ++t) next[t] = (expected[(t + 1) % 3] + 7 * expected[t]) % 1009;
    expected = next;
  }
  EXPECT_EQ(value, expected);
}

TEST(WorkerPool, RunsLoopsAndPairsOfStepsOnAnyNumberOfThreads) {
  for (const int threads : {1, 2, 5}) {
    SCOPED_TRACE(threads);
    WorkerPool pool(threads);
    for (const int count : {0, 1, 2, 1000}) {
      std::vector<int> done(static_cast<std::size_t>(count), 0);
      run_loop(count, loop_on(pool), [&](int i) { ++done[static_cast<std::size_t>(i)]; });
      EXPECT_EQ(done, std::vector<int>(done.size(), 1));
    }
    int first = 0, second = 0;
    run_both(
        &pool, [&] { ++first; }, [&] { ++second; });
    EXPECT_EQ(first + 10 * second, 11);
    EXPECT_THROW(run_both(
                     &pool, [] { throw InputError("first"); }, [&] { ++second; }),
                 InputError);
    EXPECT_THROW(run_both(
                     &pool, [&] { ++first; }, [] { throw SingularError("second"); }),
                 SingularError);
    EXPECT_EQ(first, 2);
  }
  int steps = 0;
  run_both(
      nullptr, [&] { ++steps; }, [&] { steps *= 5; });
  EXPECT_EQ(steps, 5);
}

TEST(WorkerPool, WakesThreadsThatHaveGoneToSleep) {
  WorkerPool pool(4);
  std::atomic<int> runs = 0;
  for (int job = 0; job < 5; ++job) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    pool.run([&](int) { ++runs; });
    EXPECT_EQ(runs, 4 * (job + 1));
  }
}

// The caller waits as long as it takes.
TEST(WorkerPool, WaitsForTheSlowest) {
  WorkerPool pool(3);
  std::atomic<int> done = 0;
  pool.run([&](int thread) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10 * thread));
    ++done;
  });
  EXPECT_EQ(done, 3);
}

TEST(WorkerPool, EndsWithoutAnyJobToo) {
  for (int k = 0; k < 200; ++k) WorkerPool pool(3);
}

/// A random forest, children before parents, with costs of its own.
std::vector<FrontTask> forest(int size) {
  std::vector<FrontTask> tasks(static_cast<std::size_t>(size));
  for (int t = size - 1; t >= 0; --t) {
    FrontTask& task = tasks[static_cast<std::size_t>(t)];
    const int up = t + 1 + t * 7919 % 13;
    task.parent = up < size ? up : -1;
    task.path_cost = 1.0 + t % 5;
    if (task.parent < 0) continue;
    task.path_cost += tasks[static_cast<std::size_t>(task.parent)].path_cost;
    ++tasks[static_cast<std::size_t>(task.parent)].waits_for;
  }
  return tasks;
}

TEST(TreeScheduler, DoesEveryTaskOnceAfterItsChildren) {
  const std::vector<FrontTask> tasks = forest(400);
  for (const int threads : {1, 2, 5}) {
    WorkerPool pool(threads);
    TreeScheduler scheduler;
    for (int pass = 0; pass < 20; ++pass) {
      std::vector<std::atomic<int>> children_done(tasks.size());
      std::atomic<int> done = 0, early = 0;
      scheduler.reset(tasks, threads);
      pool.run([&](int thread) {
        scheduler.work(thread, [&](int t, LoopRunner) {
          const FrontTask& task = tasks[static_cast<std::size_t>(t)];
          if (children_done[static_cast<std::size_t>(t)] != task.waits_for) ++early;
          if (task.parent >= 0) ++children_done[static_cast<std::size_t>(task.parent)];
          ++done;
        });
      });
      EXPECT_EQ(done, 400);
      EXPECT_EQ(early, 0);
    }
  }
}

TEST(TreeScheduler, SharesTasksInStretchesOfLikeCost) {
  const std::vector<FrontTask> tasks = forest(400);
  std::vector<std::int32_t> owner;
  for (const int threads : {1, 2, 3, 7}) {
    SCOPED_TRACE(threads);
    share_tasks(tasks, threads, owner);
    ASSERT_EQ(owner.size(), tasks.size());
    EXPECT_TRUE(std::is_sorted(owner.begin(), owner.end()));
    std::vector<double> cost(static_cast<std::size_t>(threads), 0.0);
    for (std::size_t t = 0; t < tasks.size(); ++t) {
      const FrontTask& task = tasks[t];
      cost[static_cast<std::size_t>(owner[t])] +=
          task.path_cost -
          (task.parent < 0 ? 0.0 : tasks[static_cast<std::size_t>(task.parent)].path_cost);
    }
    const double all = std::accumulate(cost.begin(), cost.end(), 0.0);
    for (const double c : cost) EXPECT_NEAR(c, all / threads, 10.0);
  }
  share_tasks({}, 3, owner);
  EXPECT_TRUE(owner.empty());
}

TEST(TreeScheduler, GoesDownTheLongestWayFirst) {
  // 0 and 1 hang from 3, 2 from 4, 3 and 4 from the root 5: the longest way goes through 3 to 0.
  std::vector<FrontTask> tasks(6);
  const double cost[] = {9, 1, 6, 1, 2, 1};
  const std::int32_t parent[] = {3, 3, 4, 5, 5, -1};
  for (std::size_t t = tasks.size(); t-- > 0;) {
    tasks[t].parent = parent[t];
    tasks[t].path_cost =
        cost[t] + (parent[t] < 0 ? 0.0 : tasks[static_cast<std::size_t>(parent[t])].path_cost);
  }
  EXPECT_EQ(downwards(tasks, 2), (std::vector<std::int32_t>{5, 3, 0, 4, 2, 1}));
  EXPECT_EQ(downwards(tasks, 1), (std::vector<std::int32_t>{5, 4, 3, 2, 1, 0}));

  const std::vector<FrontTask> many = forest(400);
  const std::vector<std::int32_t> order = downwards(many, 3);
  std::vector<char> seen(many.size(), 0);
  for (const std::int32_t t : order) {
    const std::int32_t above = many[static_cast<std::size_t>(t)].parent;
    EXPECT_TRUE(above < 0 || seen[static_cast<std::size_t>(above)]) << t;
    EXPECT_EQ(std::exchange(seen[static_cast<std::size_t>(t)], 1), 0) << t;
  }
  EXPECT_EQ(order.size(), many.size());
}

}  // namespace
}  // namespace mapjoin
