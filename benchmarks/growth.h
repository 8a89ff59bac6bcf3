#pragma once

#include <cstdint>
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

/// `text`: "manhattan:10000,100000,1000000". All sizes and numbers of threads take turns, none is
/// left out of a round for being slow. \throws InputError.
Growth measure_growth(const std::string& text, std::uint64_t seed,
                      const ComparisonOptions& options);

}  // namespace mapjoin::benchmarks
