#pragma once

#include <span>
#include <string>

#include "benchmarks/comparison.h"

/// \file
/// What was measured, as Markdown, JSON and a picture.

namespace mapjoin::benchmarks {

/// How many times as long as one factorisation a run may take. What the project aims at.
inline constexpr double kGoalOneThread = 2.5;
inline constexpr double kGoalTwoThreads = 1.6;
/// How many times as fast two threads are to be, on data sets with at least so many unknowns.
inline constexpr double kGoalSpeedUp = 1.6;
inline constexpr double kGoalSpeedUpFrom = 14000;  // sphere_2500 has 14994

/// All tables, and whether the goals are reached, data set by data set.
std::string markdown(std::span<const Comparison> comparisons, const ComparisonOptions& options);

/// All medians and every run.
std::string json(std::span<const Comparison> comparisons, const ComparisonOptions& options);

/// A bar for each data set and number of threads: how many times as long as one factorisation.
std::string chart(std::span<const Comparison> comparisons);

}  // namespace mapjoin::benchmarks
