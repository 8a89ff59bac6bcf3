#pragma once

#include <concepts>
#include <string_view>

#include "mapjoin/graph/builtin_types.h"
#include "mapjoin/graph/variable.h"

/// \file
/// What a measurement model is: how something looks from a pose, in numbers that a sensor gives.
///
/// A *model* M is a struct of static members, like a variable type (graph/variable.h):
///
///     struct M {
///       using Target = Point2;             // what is measured, from a pose of the same space
///       using Measurement = Vec<2>;        // z: doubles in a row
///       static constexpr int dim = 2;      // of the residual; at most 16, as the target's
///       static constexpr std::string_view name = "rangebrg";  // at most 8 characters
///       template <class S>                 // what z says less what the target looks like
///       static Vec<dim, S> residual(const Measurement& z, const ValueOf<Target, S>& seen);
///       // and one of
///       static ValueOf<Target> seen(const Measurement& z);
///       static ValueOf<Target> hypothesis(const Measurement& z, double u);
///     };
///
/// `seen` in the residual is the target in the frame of the pose, x' = pose^-1 x: moving pose and
/// target alike changes nothing, so a model cannot depend on the frame of a map. The residual is
/// differentiated by dual numbers: write `using std::sqrt;`, `sqrt(x)`, and angles so that they
/// wrap.
///
/// `seen(z)` is for measurements that say where the target is: the value with residual zero. Those
/// that say part of it (a range, a bearing) give *hypotheses*: values with residual zero, one for
/// each u in [0, 1), evenly over where the target may be. Such targets wait until several
/// measurements together tell where they are (building/delayed.h).
///
/// Laws, tested by building/testing/model_conformance.h:
///   1. residual(z, seen(z)) = 0, or residual(z, hypothesis(z, u)) = 0 for all u in [0, 1).
///   2. The residual is smooth there: derivatives by dual numbers are those by differences.
///   3. residual of T a and T x is that of a and x, for every rigid motion T.

namespace mapjoin {

/// One measurement says all of where its target is.
template <class M>
concept CompleteModel = requires(const typename M::Measurement& z) {
  { M::seen(z) } -> std::convertible_to<ValueOf<typename M::Target>>;
};

/// One measurement says part of where its target is.
template <class M>
concept PartialModel = !CompleteModel<M> && requires(const typename M::Measurement& z) {
  { M::hypothesis(z, 0.5) } -> std::convertible_to<ValueOf<typename M::Target>>;
};

/// A measurement model, as this file describes it.
template <class M>
concept MeasurementModel = (CompleteModel<M> || PartialModel<M>)&&requires(
    const typename M::Measurement& z, const ValueOf<typename M::Target>& x,
    const ValueOf<typename M::Target, Dual<2>>& s) {
  { M::dim } -> std::convertible_to<int>;
  { M::name } -> std::convertible_to<std::string_view>;
  { M::template residual<double>(z, x) } -> std::convertible_to<Vec<M::dim>>;
  { M::template residual<Dual<2>>(z, s) } -> std::convertible_to<Vec<M::dim, Dual<2>>>;
}
&&sizeof(typename M::Measurement) % sizeof(double) == 0;

/// Number of doubles in a measurement.
template <class M>
inline constexpr int kMeasured = static_cast<int>(sizeof(typename M::Measurement) / sizeof(double));

/// The residual where pose and target have moved by small steps: pose [+] a, x [+] b.
template <MeasurementModel M, class S>
Vec<M::dim, S> residual_at(const typename M::Measurement& z, const Rigid<M::Target::ambient>& pose,
                           const TangentOf<PoseType<M::Target::ambient>, S>& a,
                           const ValueOf<typename M::Target>& x,
                           const TangentOf<typename M::Target, S>& b) {
  using T = typename M::Target;
  using Pose = PoseType<T::ambient>;
  const auto from = Pose::template retract<S>(pose.template cast<S>(), a);
  const auto to = T::template retract<S>(detail::lift<T, S>(x), b);
  return M::template residual<S>(z, T::template transform<S>(from.inverse(), to));
}

}  // namespace mapjoin
