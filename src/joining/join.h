#pragma once

#include <vector>

#include "mapjoin/graph/map.h"
#include "mapjoin/joining/join_equations.h"

namespace mapjoin {

/// The graph merge of maps: everything that the one linear solve of a join needs, laid open.
///
///     const Merge<2> merged = merge<2>({map_1, map_2});
///     std::cout << Eigen::MatrixXd(merged.equations.A());
///     const Map<2> joined = solve(merged);
template <int D>
struct Merge {
  VariableSet<D> variables;  ///< of the joined map: those of either, common ones once
  Values<D> x0;  ///< what the unknowns are increments of: the first-placed map's value of each
  std::vector<Summary<D>> placed;  ///< the maps, laid on the first one, over numbers in `variables`
  JoinEquations equations;         ///< A, Z, I_Z about x0; points into `placed`
  std::vector<int>
      dropped;       ///< columns of A that the frame pins: they are left out, no row of Z ever is
  Anchor<D> anchor;  ///< the frame: the first map's; the lowest pose's where that is none or pins
                     ///< mixtures of coordinates; points' where there is no pose

  Merge() = default;
  Merge(Merge&&) = default;  // moving keeps the elements of `placed` where they are
  Merge& operator=(Merge&&) = default;
};

/// Writes the maps in one frame and merges them: variables of the first only, of the second only,
/// common ones.
///
/// Each is laid on those before it by the best rigid fit over all common variables, best first.
/// \throws DisconnectedError that says what two maps share and what is missing: one pose, two
/// points in the plane, or three points in space that are not collinear.
template <int D>
Merge<D> merge(std::vector<Map<D>> maps);

/// Solves A^T I_Z A d = A^T I_Z Z (16): the joined map, with the sparse sum of the maps'
/// information (17), each carried to the new values. \throws SingularError naming a variable.
template <int D>
Map<D> solve(const Merge<D>& merge);

/// merge() and solve(): the summary join of two maps, in the frame of the first one's anchor (of
/// its pose, or points; see Merge::anchor).
template <int D>
Map<D> join(const Map<D>& a, const Map<D>& b);

/// Joins as Linear SLAM does: both maps are written in the frame of what `common` names, which is
/// all they are compared by, and the joined information is completed exactly. The result is in that
/// frame.
///
/// A common pose (section 4): for one pose and nothing else in common this is the minimiser of (7),
/// whatever the disagreement (Lemma 1). Two common points in the plane, three in space (section 7):
/// for feature-only maps; which are best, common_points() says. \throws DisconnectedError that
/// names what is not in both maps; DegenerateFrameError; SingularError.
template <int D>
Map<D> join_as_published(const Map<D>& a, const Map<D>& b, const Anchor<D>& common);

/// The same for a common pose.
template <int D>
Map<D> join_as_published(const Map<D>& a, const Map<D>& b, const Key& common_pose);

/// A local map as a map: its information completed to gauge-free form; variables that it lists more
/// than once are fused.
template <int D>
Map<D> to_map(const LocalMap<D>& local_map);

}  // namespace mapjoin
