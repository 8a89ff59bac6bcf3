#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>
#include <vector>

#include "mapjoin/frames/anchors.h"
#include "mapjoin/graph/map.h"

namespace mapjoin {

/// One covariance block a variable, one after another in a flat array.
struct CovarianceBlocks {
  std::vector<int> variables;       ///< numbers in the map
  std::vector<int> dims;            ///< of each
  std::vector<std::int64_t> start;  ///< first element of each, and the number of elements
  std::vector<double> values;       ///< dim x dim each

  std::size_t size() const { return variables.size(); }
  Eigen::Map<const Eigen::MatrixXd> block(std::size_t k) const {
    return {values.data() + start[k], dims[k], dims[k]};
  }
};

/// How uncertain a map is, in the frame it is written in.
///
///     const Covariance<2> covariance(map);                   // one sparse factorisation
///     covariance.block(pose_key(7), pose_key(7));            // 3 x 3, tangent of pose:7
///     covariance.of(std::vector{pose_key(7), point_key(84)});  // joint, 5 x 5
///     covariance.blocks();                                   // every diagonal block
///
/// Uncertainty is of something relative to something: of each variable relative to the map's
/// anchor. What the anchor pins has covariance zero. Rows and columns are tangents at map.values;
/// for poses that is the body frame, in metres and radians, for points the map frame. In another
/// frame: Covariance(change_frame(map, anchor)). What does not depend on the frame is in
/// relative.h.
///
/// All frames agree: with J = E - g C^-1 P of an anchor, Sigma_a = J_a Sigma_b J_a^T, whatever b.
/// So the information is factored once, without the rows that `solved_in` pins (where it is exact,
/// after summary joins too), and carried to the map's anchor by its J. Any anchor will do, those
/// that pin mixtures of coordinates too.
///
/// Values are copied, not referred to. Const functions may be called from several threads.
template <int D>
class Covariance {
 public:
  /// Orders, analyses and factors: once for as many queries as you like.
  /// \throws InputError when the map has no information or no anchor; DegenerateFrameError;
  /// SingularError that names a variable the information does not determine.
  explicit Covariance(const Map<D>& map);
  ~Covariance();
  Covariance(Covariance&&) noexcept;
  Covariance& operator=(Covariance&&) noexcept;

  const VariableSet<D>& variables() const;

  /// Diagonal blocks of all variables, by selected inversion: about twice the work of the
  /// factorisation, and no memory but a few fronts beside the result.
  CovarianceBlocks blocks() const;
  /// Of some variables, by their numbers: only fronts above those are visited.
  CovarianceBlocks blocks(std::span<const int> variables) const;

  /// Joint covariance of some variables, dense, in the order given. One solve with the factor for
  /// each of their scalars. \throws InputError that names a key the map does not have.
  Eigen::MatrixXd of(std::span<const Key> keys) const;
  /// Cross-covariance: dim(a) x dim(b). For a == b the covariance of a.
  Eigen::MatrixXd block(const Key& a, const Key& b) const;
  /// Cross-covariance of two lists, by numbers: all scalars of `rows` by all of `columns`.
  Eigen::MatrixXd between(std::span<const int> rows, std::span<const int> columns) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

extern template class Covariance<2>;
extern template class Covariance<3>;

}  // namespace mapjoin
