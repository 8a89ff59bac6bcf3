#pragma once

namespace mapjoin {

/// Probability that a chi-squared variable of `dimension` degrees of freedom is at most x: the
/// regularised incomplete gamma function P(dimension / 2, x / 2), by its series or its continued
/// fraction, to 1e-12. Cost O(sqrt(dimension)). \throws InputError when dimension < 1 or x is
/// negative or not a number.
double chi_squared_probability(double x, int dimension);

/// Its inverse: the x that a chi-squared variable stays below with probability p. Newton's method
/// kept inside a bracket. \throws InputError unless 0 < p < 1 and dimension >= 1.
double chi_squared_quantile(double p, int dimension);

}  // namespace mapjoin
