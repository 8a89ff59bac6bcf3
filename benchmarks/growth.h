#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "benchmarks/comparison.h"

/// \file
/// How the time to the optimum grows with a world.

namespace mapjoin::benchmarks {

/// One size of a world.
struct GrowthStep {
  std::int64_t poses = 0, observations = 0;
  double error = 0.0;           ///< of chi2, relative to the minimum next to the truth
  std::vector<Contender> join;  ///< to the optimum, values alone; per number of threads

  bool reached() const;  ///< within kTolerance
};

/// The same world in several sizes, from the smallest.
struct Growth {
  std::string world;
  int dimension = 2;
  std::vector<int> threads;
  std::vector<GrowthStep> steps;

  /// Seconds grow as poses to this power, from one step to another: the median of what the rounds
  /// say. `t`: index into threads.
  double power(std::size_t from, std::size_t to, std::size_t t) const;
  double power(std::size_t t) const { return power(0, steps.size() - 1, t); }
  bool reached() const;
};

/// One world in several sizes, and in each with several numbers of threads. Does not move: its
/// contenders refer to it.
class GrowthRace {
 public:
  /// `text`: "manhattan:10000,100000,1000000". Runs everybody once. \throws InputError.
  GrowthRace(const std::string& text, std::uint64_t seed, const ComparisonOptions& options);
  GrowthRace(const GrowthRace&) = delete;
  GrowthRace& operator=(const GrowthRace&) = delete;

  /// All sizes and numbers of threads take turns, none is left out for being slow.
  void run_round() { race_->run_round(); }
  /// The sizes that take less than two seconds.
  void run_between() { race_->run_between(); }
  Growth finish() &&;

 private:
  std::vector<AnyProblem> problems_;
  Growth out_;
  std::optional<Race> race_;
};

}  // namespace mapjoin::benchmarks
