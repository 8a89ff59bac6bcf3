#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

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

/// The rotation closest to M, by the sum of squared differences; one of them where several are.
template <int D>
Mat<D, D> nearest_rotation(const Mat<D, D>& M);

/// The rigid motion T that best lays map b on map a: T x_b ~ x_a for the common variables.
///
/// Closed form, in two steps, by what variable types offer of themselves (graph/variable.h):
///
///   R  from the positions about their mean (Procrustes), orientations and directions (chordal
///      mean), one SVD; orientations and directions are weighted by the mean squared spread of the
///      common positions, so that units do not matter
///   t  from the positions and, along their directions, the offsets: least squares, D x D
///
/// So a pose will do; two points in the plane, three in space that are not collinear; two lines of
/// the plane that cross, three planes of space that meet in a point; or a line and a point. Lines
/// and planes within three degrees of parallel do not tell where they cross. Types that offer
/// nothing take no part. O(common). \returns nothing when what takes part does not fix the motion.
template <int D>
std::optional<Rigid<D>> align(std::span<const CommonColumn<D>> common);

/// The same for two sets of values. \returns nothing when they share too little.
template <int D>
std::optional<Rigid<D>> align(const Values<D>& a, const Values<D>& b);

/// Things seen in two maps, a and b, pair by pair: `Rows` doubles each.
template <int Rows>
struct Pairs {
  std::vector<double> a, b;

  Eigen::Index size() const { return static_cast<Eigen::Index>(a.size()) / Rows; }
  void add(const double* x, const double* y) {
    a.insert(a.end(), x, x + Rows);
    b.insert(b.end(), y, y + Rows);
  }
};

/// What two maps have in common, as geometry.
template <int D>
struct CommonGeometry {
  Pairs<D> positions;
  Pairs<D * D> rotations;  ///< column-major
  Pairs<D> directions;     ///< unit vectors
  Pairs<D> normals;        ///< unit vectors that `offsets` are measured along; `directions` too
  Pairs<1> offsets;
};

/// What the common variables of two sets of values offer.
template <int D>
CommonGeometry<D> common_geometry(const Values<D>& a, const Values<D>& b);

/// The same fit, of what may be no variable of either: positions measured by satellites, say.
template <int D>
std::optional<Rigid<D>> align(const CommonGeometry<D>& common);

}  // namespace mapjoin
