#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

/// \file
/// Timing several ways of doing one thing so that their ratios mean something: one after the other
/// in every round, so that a machine that drifts, or is shared, treats all alike; medians over the
/// rounds.

namespace mapjoin::benchmarks {

/// Median of the middle one or two. \pre not empty.
double median(std::vector<double> samples);

/// What one run took.
struct Measured {
  std::vector<double> phases;  ///< seconds of each
  double cpu = 0.0;            ///< processor seconds of all threads together
  int round = 0;               ///< of the race, from 1; 0 of the run before the first

  double seconds() const;  ///< of all phases
};

/// A watch that is read at the end of each phase. What comes before it is made and after the last
/// reading does not count.
class Laps {
 public:
  Laps();
  void lap();
  /// Seconds since the beginning.
  double now() const;
  double cpu_now() const;
  Measured measured() && { return {std::move(phases_), cpu_}; }

 private:
  std::chrono::steady_clock::time_point start_;
  double cpu_start_ = 0.0;
  double last_ = 0.0;
  std::vector<double> phases_;
  double cpu_ = 0.0;  // until the last reading
};

/// One way of doing it.
struct Contender {
  std::string name;
  int threads = 1;                ///< what it may use, BLAS included
  std::function<Measured()> run;  ///< does it once
  bool often = false;             ///< takes part in rounds between rounds too, if it is quick

  // What a Race found out.
  std::vector<Measured> runs = {};
  std::optional<std::int64_t> peak_bytes = {};  ///< peak memory beyond what was in use before

  // Medians.
  double seconds() const;
  double cpu_seconds() const;
  std::vector<double> phase_seconds() const;
};

/// How many times as fast one was as the other: the median of what each round of both says, as a
/// machine that slows down for a while slows down both.
double times_as_fast(const Contender& one, const Contender& other);

/// Contenders that take turns, round by round. Rounds of several races may take turns as well: what
/// slows a machine down for minutes then costs each of them a round, not one of them all.
class Race {
 public:
  /// Runs everybody once unmeasured but for memory: caches are then warm and BLAS has its threads.
  /// What took longer than `slow` seconds is not repeated: this run counts.
  Race(std::vector<Contender> contenders, double slow, double round);

  /// Who takes less than `round` seconds runs as often as fits into them, in four turns, and the
  /// median of these runs counts. Single-threaded contenders all run on one and the same processor.
  /// Before it, everybody who is not slow runs once unmeasured: others had the caches since the
  /// last round, and the first to come would pay for all.
  void run_round() { run(racing_); }

  /// A round of those alone that are to run often and take less than two seconds.
  void run_between() { run(often_); }

  /// The contenders with their figures, and without what they ran: that may refer to what ends
  /// sooner.
  std::vector<Contender> finish() &&;

 private:
  struct Entry {
    std::size_t contender;
    bool warms_up;  // runs once more before each round
  };
  void run(const std::vector<Entry>& entries);

  std::vector<Contender> contenders_;
  std::vector<Entry> racing_, often_;  // who is not too slow for it
  double round_;
  int round_number_ = 0;
};

/// The file that the BLAS in use comes from: part of any figure of CHOLMOD's.
std::string blas_in_use();

/// While one lives, the program has so many processors, and BLAS so many threads. Gives back what
/// was before.
class Allowance {
 public:
  explicit Allowance(int threads);
  ~Allowance();
  Allowance(const Allowance&) = delete;
  Allowance& operator=(const Allowance&) = delete;

 private:
  int blas_before_ = 0;
};

}  // namespace mapjoin::benchmarks
