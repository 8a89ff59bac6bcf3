// A few threads that stay alive between jobs.
#pragma once

#include <atomic>
#include <cstdint>
#include <thread>
#include <type_traits>
#include <vector>

namespace mapjoin {

/// Runs one job at a time on a fixed number of threads, the caller's being one of them.
///
/// Starting threads takes as long as a whole small factorization, so a solver is handed a pool that
/// lives as long as the program's part that needs it. Waking a thread takes as long as a step of a
/// thousand poses: after a job threads stay awake for some tens of microseconds, in case another
/// one follows. Not to be used from two threads at once, nor from inside a job.
class WorkerPool {
 public:
  /// `threads` >= 1; 1 starts no thread at all.
  explicit WorkerPool(int threads = 1);
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  int threads() const { return static_cast<int>(workers_.size()) + 1; }

  /// Calls job(t) once for t = 0 .. threads() - 1, at the same time; job(0) on the calling thread.
  /// Returns when all have returned. The job must not throw.
  template <class Job>
  void run(Job&& job) {
    using Type = std::remove_reference_t<Job>;
    start([](void* object, int thread) { (*static_cast<Type*>(object))(thread); }, &job);
    job(0);
    finish();
  }

 private:
  using Call = void (*)(void* object, int thread);
  void start(Call call, void* object);
  void finish();
  void work(int thread);

  std::vector<std::thread> workers_;
  Call call_ = nullptr;  ///< the job, written before jobs_started_ says that there is one
  void* object_ = nullptr;
  std::atomic<std::uint32_t> jobs_started_ = 0;
  std::atomic<int> still_running_ = 0;
};

}  // namespace mapjoin
