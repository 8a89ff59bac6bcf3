#include "mapjoin/building/robust_loss.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "mapjoin/graph/error.h"

namespace mapjoin {

void RobustLoss::evaluate(double s, double* rho) const {
  const double b = width * width;
  const double q = 1.0 / (1.0 + s / b);
  rho[0] = s;
  rho[1] = 1.0;
  rho[2] = 0.0;
  switch (shape) {
    case Shape::kNone:
      return;
    case Shape::kHuber:
      if (s <= b) return;
      rho[0] = 2.0 * width * std::sqrt(s) - b;
      rho[1] = width / std::sqrt(s);
      rho[2] = -0.5 * rho[1] / s;
      return;
    case Shape::kCauchy:
      rho[0] = b * std::log1p(s / b);
      rho[1] = q;
      rho[2] = -q * q / b;
      return;
    case Shape::kGemanMcClure:
      rho[0] = s * q;
      rho[1] = q * q;
      rho[2] = -2.0 * q * q * q / b;
      return;
  }
}

RobustLoss parse_robust_loss(std::string_view text) {
  RobustLoss out;
  const std::size_t colon = text.find(':');
  const std::string_view name = text.substr(0, colon);
  using Shape = RobustLoss::Shape;
  bool ok = true;
  if (name == "none") {
    out.shape = Shape::kNone;
  } else if (name == "huber") {
    out.shape = Shape::kHuber;
  } else if (name == "cauchy") {
    out.shape = Shape::kCauchy;
  } else if (name == "geman-mcclure") {
    out.shape = Shape::kGemanMcClure;
  } else {
    ok = false;
  }
  if (ok && colon != std::string_view::npos) {
    const std::string_view width = text.substr(colon + 1);
    const auto [end, error] = std::from_chars(width.data(), width.data() + width.size(), out.width);
    ok = error == std::errc() && end == width.data() + width.size() && std::isfinite(out.width) &&
         out.width > 0.0;
  }
  if (!ok) {
    throw InputError(fmt::format(
        "there is no robust loss '{}': choose none, huber, cauchy or geman-mcclure, with a width "
        "in standard deviations if you like, as in cauchy:2.5",
        text));
  }
  return out;
}

}  // namespace mapjoin
