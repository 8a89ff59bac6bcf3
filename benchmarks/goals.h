#pragma once

#include <span>
#include <string>
#include <vector>

#include "benchmarks/comparison.h"
#include "benchmarks/growth.h"

/// \file
/// What the project aims at, and whether a run shows it.

namespace mapjoin::benchmarks {

/// How many times as long as one factorisation a run may take.
inline constexpr double kGoalOneThread = 2.5;
inline constexpr double kGoalTwoThreads = 1.6;
/// How many times as fast two threads are to be, on data sets with at least so many unknowns.
inline constexpr double kGoalSpeedUp = 1.6;
inline constexpr double kGoalSpeedUpFrom = 14000;  // sphere_2500 has 14994
/// What of the time of the fastest of the others two threads take at most, on graphs of more poses
/// than that and on smaller ones.
inline constexpr double kGoalOfOthersLarge = 1.0 / 3.0;
inline constexpr double kGoalOfOthersSmall = 1.0 / 2.0;
inline constexpr std::int64_t kLargeFrom = 3000;
/// Seconds in the plane grow at most as poses to this power.
inline constexpr double kGoalGrowth = 1.15;

/// One figure and where it should be.
struct Goal {
  std::string data, what;
  double value = 0.0;
  bool at_most = true;  ///< else at least
  double limit = 0.0;

  bool holds() const { return at_most ? value <= limit : value >= limit; }
};

/// All of them, those of data sets first.
std::vector<Goal> goals(std::span<const Comparison> comparisons, std::span<const Growth> growths);

/// A list in Markdown.
std::string markdown(std::span<const Goal> goals);

}  // namespace mapjoin::benchmarks
