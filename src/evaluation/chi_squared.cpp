#include "mapjoin/evaluation/chi_squared.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "mapjoin/graph/error.h"

namespace mapjoin {

namespace {

constexpr double kTiny = 1e-300;
constexpr double kPrecision = 1e-16;

/// x^a e^-x / Gamma(a).
double gamma_term(double a, double x) { return std::exp(a * std::log(x) - x - std::lgamma(a)); }

/// P(a, x) by the power series; for x < a + 1.
double lower_series(double a, double x) {
  double term = 1.0 / a;
  double sum = term;
  for (double n = a + 1.0; term > kPrecision * sum; n += 1.0) sum += term *= x / n;
  return sum * gamma_term(a, x);
}

/// Q(a, x) = 1 - P(a, x) by Lentz's continued fraction; for x >= a + 1.
double upper_fraction(double a, double x) {
  double b = x + 1.0 - a;
  double c = 1.0 / kTiny;
  double d = 1.0 / b;
  double fraction = d;
  for (double n = 1.0;; n += 1.0) {
    const double numerator = -n * (n - a);
    b += 2.0;
    d = numerator * d + b;
    c = b + numerator / c;
    if (std::abs(d) < kTiny) d = kTiny;
    if (std::abs(c) < kTiny) c = kTiny;
    d = 1.0 / d;
    const double factor = c * d;
    fraction *= factor;
    if (std::abs(factor - 1.0) < 4.0 * kPrecision) break;
    if (n > 1e7) break;  // rounding: the last digit goes up and down
  }
  return fraction * gamma_term(a, x);
}

void check_dimension(int dimension) {
  if (dimension < 1)
    throw InputError(
        fmt::format("chi-squared with {} degrees of freedom: at least 1 is needed", dimension));
}

}  // namespace

double chi_squared_probability(double x, int dimension) {
  check_dimension(dimension);
  if (!(x >= 0.0)) throw InputError(fmt::format("chi-squared of {}: it is never negative", x));
  if (x == 0.0) return 0.0;
  if (std::isinf(x)) return 1.0;
  const double a = 0.5 * dimension, half = 0.5 * x;
  return half < a + 1.0 ? lower_series(a, half) : 1.0 - upper_fraction(a, half);
}

double chi_squared_quantile(double p, int dimension) {
  check_dimension(dimension);
  if (!(p > 0.0 && p < 1.0))
    throw InputError(fmt::format("a quantile needs a probability between 0 and 1, not {}", p));
  const double a = 0.5 * dimension;
  double low = 0.0;
  double high = dimension;
  while (chi_squared_probability(high, dimension) < p) {
    low = high;
    high *= 2.0;
  }
  double x = 0.5 * (low + high);
  for (int step = 0; step < 200 && high - low > 1e-15 * high; ++step) {
    const double excess = chi_squared_probability(x, dimension) - p;
    (excess > 0.0 ? high : low) = x;
    const double density = 0.5 * gamma_term(a, 0.5 * x) / (0.5 * x);
    double next = density > 0.0 ? x - excess / density : low;
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    const bool done = std::abs(next - x) <= 1e-14 * x;
    x = next;
    if (done) break;
  }
  return x;
}

}  // namespace mapjoin
