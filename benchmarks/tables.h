#pragma once

#include <span>
#include <string>
#include <vector>

#include "benchmarks/comparison.h"
#include "benchmarks/goals.h"
#include "benchmarks/growth.h"

/// \file
/// What was measured, as Markdown, JSON and a picture.

namespace mapjoin::benchmarks {

/// A data set as tables name it.
std::string label(const Comparison& comparison);

/// All tables of data sets.
std::string markdown(std::span<const Comparison> comparisons, const ComparisonOptions& options);

/// The same of growth; nothing where nothing grew.
std::string markdown(std::span<const Growth> growths, const ComparisonOptions& options);

/// What the worlds of these sources, WORLD:POSES..., are made with; nothing where there are none.
std::string worlds_table(std::span<const std::string> sources, std::uint64_t seed);

/// All medians, every run, and the goals.
std::string json(std::span<const Comparison> comparisons, std::span<const Growth> growths,
                 std::span<const Goal> goals, const ComparisonOptions& options);

/// A bar for each data set and number of threads: how many times as long as one factorisation.
std::string chart(std::span<const Comparison> comparisons);

using Rows = std::vector<std::vector<std::string>>;

/// In Markdown; the first column is text, the others are numbers.
std::string table(const std::vector<std::string>& head, const Rows& rows);

/// Three digits that count.
std::string seconds(double s);

}  // namespace mapjoin::benchmarks
