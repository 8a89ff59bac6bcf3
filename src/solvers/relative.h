#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "mapjoin/graph/map.h"
#include "mapjoin/solvers/covariance.h"

namespace mapjoin {

/// One variable as seen from a pose, with its uncertainty.
struct Relative {
  std::vector<double> value;   ///< T^-1 x: the value's doubles
  Eigen::MatrixXd covariance;  ///< dim x dim, in the tangent at `value`

  template <VariableType T>
  ValueOf<T> as() const {
    return *reinterpret_cast<const ValueOf<T>*>(value.data());
  }
};

/// Where a variable is in the body frame of a pose: for a pose the relative pose, with covariance
/// in the decoupled body chart; for a point its coordinates there; any type. With z = T^-1 x,
///
///     dz = D(T^-1, x) dx - g(z) dT
///
/// which no motion of the whole map changes: the result is the same in every frame. `covariance` is
/// that of `map`. Cost: dim solves. \throws InputError when `from` is no pose, or when the map
/// lacks a key.
template <int D>
Relative relative(const Map<D>& map, const Covariance<D>& covariance, const Key& from,
                  const Key& to);

/// A length in metres, and the standard deviation of it.
struct Distance {
  double value = 0.0;
  double deviation = 0.0;
};

/// Between the positions of any two variables that have one: the same in every frame, to first
/// order. \throws InputError when one has no position, or when both are at the same place, where a
/// distance has no derivative.
template <int D>
Distance distance(const Map<D>& map, const Covariance<D>& covariance, const Key& a, const Key& b);

/// d position / d tangent of a variable: D x dim. \throws InputError when the type has no position.
template <int D>
Eigen::MatrixXd position_jacobian(const Values<D>& values, int variable);

/// Covariance of the position of a variable from that of its tangent: D x D, in the frame of the
/// map.
template <int D>
Mat<D, D> position_covariance(const Values<D>& values, int variable,
                              const Eigen::Ref<const Eigen::MatrixXd>& block);

}  // namespace mapjoin
