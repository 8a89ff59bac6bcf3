// Changes of frame as the papers write them, densely and from nothing but matrices: what the
// library's blockwise formulas are compared with. Compiled once.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "mapjoin/graph/map.h"

namespace mapjoin::test {

/// A pose or a point over any scalar.
template <int D, class S>
struct Thing {
  bool pose = false;
  Mat<D, D, S> R = Mat<D, D, S>::Identity();
  Vec<D, S> t = Vec<D, S>::Zero();
};
template <int D, class S>
struct Motion {
  Mat<D, D, S> R;
  Vec<D, S> t;
};

/// A frame, and the scalars of the stacked tangent that it pins.
template <int D>
struct TextbookFrame {
  int first = 0;    ///< number of the pose, or of the point at the origin
  int second = -1;  ///< number of the point on the x axis, for a frame of points
  int third = -1;   ///< number of the point in the x-y plane, for a frame of points in space
  std::vector<int> pinned;

  /// The motion into it, from any other frame.
  Motion<D, double> into(const std::vector<Thing<D, double>>& x) const;
};

template <int D>
std::vector<Thing<D, double>> things_of(const Values<D>& values);

template <int D>
TextbookFrame<D> frame_of(const Anchor<D>& anchor, const Values<D>& values);

template <int D>
std::vector<Thing<D, double>> moved(const std::vector<Thing<D, double>>& x,
                                    const Motion<D, double>& T);

/// The nabla of (21): the state in frame `to` over increments of the state in frame `from`, all
/// scalars of both.
template <int D>
Eigen::MatrixXd nabla_by_duals(const std::vector<Thing<D, double>>& in_from,
                               const TextbookFrame<D>& to);
template <int D>
Eigen::MatrixXd nabla_by_differences(const std::vector<Thing<D, double>>& in_from,
                                     const TextbookFrame<D>& to);

/// Rows and columns of M that are not in the given lists.
Eigen::MatrixXd without(const Eigen::MatrixXd& M, const std::vector<int>& rows,
                        const std::vector<int>& columns);

}  // namespace mapjoin::test
