#pragma once

#include <cmath>
#include <numbers>

#include "mapjoin/building/measurement_model.h"

/// \file
/// The measurement models that come with mapjoin.
///
/// | model | z | target |
/// |---|---|---|
/// | `RelativeModel<T>` | a value of T in the frame of the pose | any variable type |
/// | `RangeBearing` | metres, radians | Point2 |
/// | `RangeBearingElevation` | metres, radians, radians | Point3 |
/// | `BearingOnly` | radians | Point2 |
/// | `RangeOnly` | metres | Point2 |
/// | `VelocityTurnRate` | m/s, rad/s, duration in s | Pose2 |
///
/// Bearings are counted from the x axis of the pose towards its y axis, elevations from the x-y
/// plane towards z; they need not be wrapped. Residuals are in the units of z, and so is the
/// information: 1/sigma^2 of each.

namespace mapjoin {

namespace detail {

/// The angle of (x, y) less `bearing`, in (-pi, pi].
template <class S>
S angle_beyond(double bearing, const S& x, const S& y) {
  using std::atan2;
  const double c = std::cos(bearing);
  const double s = std::sin(bearing);
  return atan2(c * y - s * x, c * x + s * y);
}

}  // namespace detail

/// A value as it looks from the pose: relative poses, and points by their coordinates, in the plane
/// and in space; walls and whatever else a variable type describes. The one model that a
/// MeasurementGraph holds as it is.
template <VariableType T>
struct RelativeModel {
  using Target = T;
  using Measurement = ValueOf<T>;
  static constexpr int dim = T::dim;
  static constexpr std::string_view name = T::name;

  template <class S>
  static Vec<dim, S> residual(const Measurement& z, const ValueOf<T, S>& seen) {
    return T::template local<S>(mapjoin::detail::lift<T, S>(z), seen);
  }
  static ValueOf<T> seen(const Measurement& z) { return z; }
};

/// Range and bearing of a point of the plane: a laser, a radar.
struct RangeBearing {
  using Target = Point2;
  using Measurement = Vec<2>;
  static constexpr int dim = 2;
  static constexpr std::string_view name = "rangebrg";

  template <class S>
  static Vec<2, S> residual(const Vec<2>& z, const Vec<2, S>& seen) {
    using std::sqrt;
    return {sqrt(seen(0) * seen(0) + seen(1) * seen(1)) - z(0),
            detail::angle_beyond(z(1), seen(0), seen(1))};
  }
  static Vec<2> seen(const Vec<2>& z) { return {z(0) * std::cos(z(1)), z(0) * std::sin(z(1))}; }
};

/// Range, bearing and elevation of a point of space.
struct RangeBearingElevation {
  using Target = Point3;
  using Measurement = Vec<3>;
  static constexpr int dim = 3;
  static constexpr std::string_view name = "rangeazl";

  template <class S>
  static Vec<3, S> residual(const Vec<3>& z, const Vec<3, S>& seen) {
    using std::sqrt;
    const S flat = seen(0) * seen(0) + seen(1) * seen(1);
    return {sqrt(flat + seen(2) * seen(2)) - z(0), detail::angle_beyond(z(1), seen(0), seen(1)),
            detail::angle_beyond(z(2), S(sqrt(flat)), seen(2))};
  }
  static Vec<3> seen(const Vec<3>& z) {
    const double flat = z(0) * std::cos(z(2));
    return {flat * std::cos(z(1)), flat * std::sin(z(1)), z(0) * std::sin(z(2))};
  }
};

/// The direction in which a point of the plane is seen, and nothing of how far it is: a camera.
struct BearingOnly {
  using Target = Point2;
  using Measurement = Vec<1>;
  static constexpr int dim = 1;
  static constexpr std::string_view name = "bearing";

  template <class S>
  static Vec<1, S> residual(const Vec<1>& z, const Vec<2, S>& seen) {
    return Vec<1, S>(detail::angle_beyond(z(0), seen(0), seen(1)));
  }
  /// Along the ray, each depth a constant factor beyond the one before: 5 cm to 500 m.
  static Vec<2> hypothesis(const Vec<1>& z, double u) {
    const double depth = 0.05 * std::pow(1e4, u);
    return {depth * std::cos(z(0)), depth * std::sin(z(0))};
  }
};

/// How far a point of the plane is, and nothing of the direction: a radio beacon.
struct RangeOnly {
  using Target = Point2;
  using Measurement = Vec<1>;
  static constexpr int dim = 1;
  static constexpr std::string_view name = "range";

  template <class S>
  static Vec<1, S> residual(const Vec<1>& z, const Vec<2, S>& seen) {
    using std::sqrt;
    return Vec<1, S>(sqrt(seen(0) * seen(0) + seen(1) * seen(1)) - z(0));
  }
  /// Around the circle.
  static Vec<2> hypothesis(const Vec<1>& z, double u) {
    const double angle = 2.0 * std::numbers::pi * u;
    return {z(0) * std::cos(angle), z(0) * std::sin(angle)};
  }
};

/// Odometry of a vehicle in the plane by its speed and turn rate over `z(2)` seconds: it turns
/// first, by turn rate times duration, and then drives along its new heading.
///
/// The residual is (forward speed, sideways speed, turn rate): a vehicle that cannot move sideways
/// has sideways speed 0, and how well that is known must be said, as speed and turn rate alone
/// leave the information of a relative pose at rank 2.
struct VelocityTurnRate {
  using Target = Pose2;
  using Measurement = Vec<3>;
  static constexpr int dim = 3;
  static constexpr std::string_view name = "velocity";

  template <class S>
  static Vec<3, S> residual(const Vec<3>& z, const Rigid<2, S>& seen) {
    const double rate = 1.0 / z(2);
    const Vec<2, S> along = seen.R.transpose() * seen.t;
    // The turn that the measurement lacks, so that it wraps; in radians a second.
    const Mat<2, 2> back = rotation_exp<2, double>(Vec<1>(-z(1) * z(2)));
    const Mat<2, 2, S> rest = back.template cast<S>() * seen.R;
    return {along(0) * rate - z(0), along(1) * rate, rotation_log<2, S>(rest)(0) * rate};
  }
  static Rigid<2> seen(const Vec<3>& z) {
    Rigid<2> out;
    out.R = rotation_exp<2, double>(Vec<1>(z(1) * z(2)));
    out.t = out.R * Vec<2>(z(0) * z(2), 0.0);
    return out;
  }
};

static_assert(MeasurementModel<RelativeModel<Pose2>> && MeasurementModel<RelativeModel<Pose3>> &&
              MeasurementModel<RelativeModel<Point2>> && MeasurementModel<RelativeModel<Point3>> &&
              MeasurementModel<RangeBearing> && MeasurementModel<RangeBearingElevation> &&
              MeasurementModel<BearingOnly> && MeasurementModel<RangeOnly> &&
              MeasurementModel<VelocityTurnRate>);

}  // namespace mapjoin
