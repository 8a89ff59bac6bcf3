#pragma once

#include <optional>
#include <span>

#include "mapjoin/graph/values.h"

namespace mapjoin {

/// One pair of arrays of values of the same type, and which of them are the same variables.
template <int D>
struct CommonColumn {
  const VariableKind<D>* kind = nullptr;
  const double* a = nullptr;
  const double* b = nullptr;
  std::span<const int> in_a;  ///< places in a and b, pairwise
  std::span<const int> in_b;
};

/// Do the common variables fix how two maps lie to each other? Their stacked gauge rows must have
/// rank 3 (plane) or 6 (space): one pose; two points in the plane; three points in space that are
/// not collinear. O(common).
template <int D>
bool fixes_frame(std::span<const CommonColumn<D>> common);

/// The rigid motion T that best lays map b on map a: T x_b ~ x_a for the common variables.
///
/// Closed form: least squares over positions (Procrustes) and orientations (chordal mean) together,
/// one SVD; the orientations are weighted by the mean squared spread of the common positions, so
/// that units do not matter. Variable types without position or rotation take no part. O(common).
/// \returns nothing when the common variables do not fix the motion.
template <int D>
std::optional<Rigid<D>> align(std::span<const CommonColumn<D>> common);

/// The same for two sets of values. \returns nothing when they share too little.
template <int D>
std::optional<Rigid<D>> align(const Values<D>& a, const Values<D>& b);

}  // namespace mapjoin
