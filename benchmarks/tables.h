#pragma once

#include <span>
#include <string>
#include <vector>

#include "benchmarks/comparison.h"
#include "benchmarks/growth.h"

/// \file
/// What was measured, as Markdown, JSON and a picture.

namespace mapjoin::benchmarks {

/// How many times as long as one factorisation a run may take. What the project aims at.
inline constexpr double kGoalOneThread = 2.5;
inline constexpr double kGoalTwoThreads = 1.6;
/// How many times as fast two threads are to be, on data sets with at least so many unknowns.
inline constexpr double kGoalSpeedUp = 1.6;
inline constexpr double kGoalSpeedUpFrom = 14000;  // sphere_2500 has 14994

/// Seconds in the plane grow at most as poses to this power.
inline constexpr double kGoalGrowth = 1.15;

/// All tables, and whether the goals are reached, data set by data set.
std::string markdown(std::span<const Comparison> comparisons, const ComparisonOptions& options);

/// The same of growth; nothing where nothing grew.
std::string markdown(std::span<const Growth> growths, const ComparisonOptions& options);

/// All medians and every run.
std::string json(std::span<const Comparison> comparisons, std::span<const Growth> growths,
                 const ComparisonOptions& options);

/// A bar for each data set and number of threads: how many times as long as one factorisation.
std::string chart(std::span<const Comparison> comparisons);

using Rows = std::vector<std::vector<std::string>>;

/// In Markdown; the first column is text, the others are numbers.
std::string table(const std::vector<std::string>& head, const Rows& rows);

/// Three digits that count.
std::string seconds(double s);

}  // namespace mapjoin::benchmarks
