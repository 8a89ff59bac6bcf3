#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "mapjoin/graph/key.h"
#include "mapjoin/graph/map.h"

/// \file
/// Which variables of two maps may be the same, and everything that is needed to decide: the first
/// three steps of data association in SLSJF (section III-C). The matchers (matchers.h) are the
/// fourth.
///
/// Two maps are compared in the frame of something that both know, the end pose of one and the
/// start pose of the other for instance. In that frame they are independent estimates, so of a
/// variable a of the first and b of the second
///
///     innovation            r = local(x_b, x_a)
///     covariance of it      S = J Sigma_a J^T + Sigma_b,  J = d local(x_b, x_a [+] d) / dd
///
/// and jointly for several pairs, with the full joint covariances of either map. To first order in
/// the differences; exact for points, where J is the identity.

namespace mapjoin {

/// What may be matched, and when two are too different.
struct CandidateOptions {
  /// Probability with which the innovation of a right pair is within the gate (chi-squared with
  /// the variable's dimension). Right pairs beyond it are not found; the lower, the fewer wrong
  /// ones are.
  double gate = 0.9999;
  /// Pairs farther apart than this in the common frame are not considered [m]: the error that the
  /// paper allows for (III-C1). Variables of A that are farther from all of B cost nothing then. 0:
  /// whatever the gate allows. Of types that have no position all are.
  double max_distance = 0.0;
  /// Points per square (cubic) metre to expect near any place [1/m^2, 1/m^3]; 0: estimated from B's
  /// points, by the median distance to the nearest.
  double density = 0.0;
  /// Types that may be matched; empty: all but poses, and but those that no frame touches (two
  /// biases of the same size are not the same bias).
  std::vector<Tag> types;
};

/// May variables of this type be matched?
template <int D>
bool may_be_matched(const VariableKind<D>& kind, const CandidateOptions& options);

/// Pairs of a variable of map A and one of map B, with their joint innovations.
///
/// Pairs 0 .. known - 1 are variables that both maps have by key; they are beyond doubt. The
/// others are candidates: of equal type, within the gate on their own, sorted by b, then a. What
/// the common frame pins is not among the pairs, as it is the same in both by construction.
struct CandidatePairs {
  struct Pair {
    int a = 0;               ///< number of the variable in map A
    int b = 0;               ///< in map B
    int dim = 0;             ///< of its tangent
    int row = 0;             ///< first of its rows in `innovations`
    int row_a = 0;           ///< first row of a in covariance_a
    int row_b = 0;           ///< first row of b in covariance_b
    std::int64_t slope = 0;  ///< first double of J in `slopes`: dim x dim, column-major
  };
  int known = 0;
  std::vector<Pair> pairs;
  Eigen::VectorXd innovations;  ///< r of all pairs, stacked
  std::vector<double> slopes;
  Eigen::MatrixXd covariance_a;  ///< joint covariance of the variables of A that stand in a pair
  Eigen::MatrixXd covariance_b;  ///< the same of B
  /// Chi-squared bound of a pair's innovation given others; by dimension, [0] is not used.
  std::vector<double> gates;
  /// Of each pair, the logarithm of how many variables of its type to expect near any place, by
  /// volume of its tangent. Of types other than points, as many as make a pair at the gate no
  /// likelier than chance, before any other is known.
  std::vector<double> log_density;

  int size() const { return static_cast<int>(pairs.size()); }
  auto innovation(int p) const {
    const Pair& pair = pairs[static_cast<std::size_t>(p)];
    return innovations.segment(pair.row, pair.dim);
  }
  double gate_of(int p) const {
    return gates[static_cast<std::size_t>(pairs[static_cast<std::size_t>(p)].dim)];
  }
  /// Covariance of the innovations of pairs p and q: dim(p) x dim(q).
  Eigen::MatrixXd covariance(int p, int q) const;
  /// Of the innovations of all pairs with those of q: one row a row of `innovations`.
  Eigen::MatrixXd covariance_with(int q) const;
};

/// What two maps are compared in: a frame that both know, and both maps in it.
template <int D>
struct ComparedMaps {
  Map<D> a, b;
};

/// Writes both maps in a frame that they share: that of the pose where B starts if A has it, else
/// of the lowest pose in both, else of common points that both can tell apart. \throws
/// DisconnectedError when the maps have no such variables by key: give them some first
/// (constellations.h finds them by geometry).
template <int D>
ComparedMaps<D> in_common_frame(const Map<D>& a, const Map<D>& b);

/// Pairs of common keys and nothing else: what check_matches() looks at.
/// One sparse factorisation of each map's information. \throws SingularError.
template <int D>
CandidatePairs common_pairs(const ComparedMaps<D>& maps);

/// Common keys, and all pairs of other variables that the gate allows given nothing but the common
/// frame.
///
/// No pair that passes the gate is left out: a variable of A is looked at when its distance to some
/// variable of B is at most sqrt(gate (lambda_a + lambda_b)), with the largest eigenvalues of their
/// covariances. (The paper looks for local maps that may overlap first, by their radii and a
/// possible error; this needs neither.) Cost: one sparse factorisation and selected inversion of
/// each map's information, a sweep along one axis, and a solve for each scalar of what stands in a
/// pair. \throws SingularError; InputError for a gate that is no probability.
template <int D>
CandidatePairs candidate_pairs(const ComparedMaps<D>& maps, const CandidateOptions& options);

}  // namespace mapjoin
