#pragma once

#include <vector>

#include "mapjoin/joining/join_equations.h"

namespace mapjoin {

/// Moves a summary rigidly: values and information.
template <int D>
void move(const VariableSet<D>& all, Summary<D>& summary, const Rigid<D>& T);

/// Joins summaries: they are laid on one another by the best rigid fit over all common variables,
/// one linear least squares solve follows, and the joined information is the sparse sum of theirs,
/// each carried from its old values to the new ones: Lambda_12 = sum_k S_k^T Lambda_k S_k.
///
/// \returns one summary for each group that shares enough; pinned in the solve is the lowest pose
/// of each, or points far apart where there is no pose (`solved_in` says which). \throws
/// SingularError naming a variable. O(fill).
template <int D>
std::vector<Summary<D>> join_summaries(const VariableSet<D>& all, std::vector<Summary<D>> maps,
                                       int solves, Places& places);

/// Joins two maps as Linear SLAM does (sections 4, 6 and 7): both are written in the frame of
/// `common`, a pose or features of both, whose pinned coordinates are the only thing they are
/// compared by; one linear solve; the joined information, anchored there, is completed exactly. The
/// result is in that frame.
///
/// Exact completion costs a dense row for each variable of the anchor. Without it (`complete`
/// false) the information is the sparse sum, gauge-free only to the order of the disagreement: the
/// choice for long sequences, whose information would be dense after as many joins as there are
/// poses. \throws DisconnectedError that names a variable which is not in both maps;
/// DegenerateFrameError; InputError when the anchor pins mixtures of coordinates; SingularError.
template <int D>
Summary<D> join_as_published(const VariableSet<D>& all, Summary<D> first, Summary<D> second,
                             const Anchor<D>& common, bool complete = true);

}  // namespace mapjoin
