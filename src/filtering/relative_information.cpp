#include "mapjoin/filtering/relative_information.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "mapjoin/frames/change_frame.h"
#include "mapjoin/frames/gauge.h"
#include "mapjoin/frames/points_anchor.h"
#include "mapjoin/graph/error.h"

namespace mapjoin {

namespace {

/// d (angle, length) / d v of a vector v.
Eigen::Matrix2d polar_jacobian(const Eigen::Vector2d& v) {
  const double d2 = v.squaredNorm(), d = std::sqrt(d2);
  Eigen::Matrix2d J;
  J << -v(1) / d2, v(0) / d2, v(0) / d, v(1) / d;
  return J;
}

double wrapped(double angle) { return std::remainder(angle, 2.0 * std::numbers::pi); }

/// The features of a map, f_1 and f_2 first.
std::vector<int> in_order(const VariableSet<2>& variables, int f1, int f2) {
  std::vector<int> out{f1, f2};
  for (int i = 0; i < variables.size(); ++i) {
    if (variables.key(i).type != Tag("point"))
      throw InputError(fmt::format("relative information is of points, and {} is none",
                                   to_string(variables.key(i))));
    if (i != f1 && i != f2) out.push_back(i);
  }
  return out;
}

}  // namespace

Eigen::VectorXd relative_positions(const Eigen::Matrix2Xd& X, Eigen::MatrixXd* jacobian) {
  const Eigen::Index n = X.cols();
  Eigen::VectorXd h(2 * n - 3);
  const Eigen::Vector2d axis = X.col(1) - X.col(0);
  const double heading = std::atan2(axis(1), axis(0));
  const Eigen::Matrix2d J2 = polar_jacobian(axis);
  h(0) = axis.norm();
  if (jacobian != nullptr) {
    jacobian->setZero(2 * n - 3, 2 * n);
    jacobian->block<1, 2>(0, 2) = J2.row(1);
    jacobian->block<1, 2>(0, 0) = -J2.row(1);
  }
  for (Eigen::Index k = 2; k < n; ++k) {
    const Eigen::Vector2d v = X.col(k) - X.col(0);
    const Eigen::Index row = 2 * k - 3;
    h(row) = wrapped(std::atan2(v(1), v(0)) - heading);
    h(row + 1) = v.norm();
    if (jacobian == nullptr) continue;
    const Eigen::Matrix2d Jk = polar_jacobian(v);
    jacobian->block<2, 2>(row, 2 * k) = Jk;
    jacobian->block<2, 2>(row, 0) = -Jk;
    jacobian->block<1, 2>(row, 2) -= J2.row(0);
    jacobian->block<1, 2>(row, 0) += J2.row(0);
  }
  return h;
}

Eigen::VectorXd relative_residual(const Eigen::VectorXd& z, const Eigen::VectorXd& h) {
  Eigen::VectorXd r = z - h;
  for (Eigen::Index row = 1; row < r.size(); row += 2) r(row) = wrapped(r(row));
  return r;
}

RelativeInformation relative_information(const Map<2>& given, const Key& f1, const Key& f2) {
  const Map<2> map = change_frame(given, points_anchor(f1, f2));
  const VariableSet<2>& variables = map.variables();
  const std::vector<int> order =
      in_order(variables, variables.require(f1, "f_1"), variables.require(f2, "f_2"));
  const auto n = static_cast<Eigen::Index>(order.size());
  RelativeInformation out;
  Eigen::Matrix2Xd X(2, n);
  for (Eigen::Index k = 0; k < n; ++k) {
    out.features.push_back(variables.key(order[static_cast<std::size_t>(k)]));
    X.col(k) = map.values.point(out.features.back());
    if (k > 1 && !(X.col(k).norm() > 1e-9 * X(0, 1)))
      throw DegenerateFrameError(fmt::format("{} coincides with {}: no angle tells where it lies",
                                             to_string(out.features.back()), to_string(f1)));
  }
  out.z = relative_positions(X, nullptr);

  const AnchoredInformation anchored = anchored_information(map);
  const Eigen::MatrixXd I = anchored.dense();
  std::vector<Eigen::Index> row_of(static_cast<std::size_t>(variables.scalars()), -1);
  for (std::size_t s = 0; s < anchored.scalars.size(); ++s)
    row_of[static_cast<std::size_t>(anchored.scalars[s])] = static_cast<Eigen::Index>(s);
  // The frame's own coordinates: x of f_2; x and y of the others. G = d z / d coordinates.
  std::vector<Eigen::Index> rows;
  Eigen::MatrixXd inverse_G = Eigen::MatrixXd::Identity(2 * n - 3, 2 * n - 3);
  for (Eigen::Index k = 1; k < n; ++k) {
    const int offset = variables.offset(order[static_cast<std::size_t>(k)]);
    rows.push_back(row_of[static_cast<std::size_t>(offset)]);
    if (k == 1) continue;
    rows.push_back(row_of[static_cast<std::size_t>(offset) + 1]);
    inverse_G.block<2, 2>(2 * k - 3, 2 * k - 3) = polar_jacobian(X.col(k)).inverse();
  }
  out.information = inverse_G.transpose() * I(rows, rows) * inverse_G;
  return out;
}

}  // namespace mapjoin
