#pragma once

#include <string_view>

namespace mapjoin {

/// What a measurement far from the rest may still say.
///
/// With s = r^T I r, the cost of a measurement is rho(s), and its information counts rho'(s) times:
///
///     none            s                                   1
///     Huber           2 a sqrt(s) - a^2 beyond a^2        a / sqrt(s) beyond a^2
///     Cauchy          a^2 log(1 + s / a^2)                1 / (1 + s / a^2)
///     Geman-McClure   s / (1 + s / a^2)                   1 / (1 + s / a^2)^2
///
/// Odometry, from a pose to its neighbour in time, counts in full whatever the loss: it holds the
/// map together. `width` is a, in standard deviations. Huber is convex and lets every measurement
/// pull; the other two give up on gross outliers.
struct RobustLoss {
  enum class Shape { kNone, kHuber, kCauchy, kGemanMcClure };
  Shape shape = Shape::kNone;
  double width = 3.0;

  /// rho(s), rho'(s), rho''(s).
  void evaluate(double s, double* rho) const;
  double weight(double s) const {
    double rho[3];
    evaluate(s, rho);
    return rho[1];
  }
};

/// "none", "huber", "cauchy", "geman-mcclure", each with ":width" or without. \throws InputError.
RobustLoss parse_robust_loss(std::string_view text);

}  // namespace mapjoin
