#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "mapjoin/graph/values.h"

namespace mapjoin {

/// The state vector of a filter: variables in the order of their arrival.
///
/// What the information vector and matrix are about are the increments d of each variable from its
/// *base*, the value it came with: x = base [+] d. In the plane d is the papers' (x, y, heading)
/// less what it was at first, turned into the pose's first heading, and linear in it throughout:
/// the filter of the papers, to rounding. In space the same holds for positions, and orientations
/// are rotation vectors about the first one; angles never wrap.
///
/// Values lie in one flat array; keys are looked up where maps come in and go out.
template <int D>
class FilterState {
 public:
  int size() const { return static_cast<int>(kinds_.size()); }
  int scalars() const { return offset_.back(); }
  std::optional<int> find(const Key& key) const;
  /// \throws InputError that names the key, and `what` it was wanted for.
  int require(const Key& key, const char* what) const;

  /// Appends a variable, its base and estimate at x. \returns its number. O(log n), and moving the
  /// index behind the key.
  int add(const VariableKind<D>& kind, const Key& key, const double* x);

  const VariableKind<D>& kind(int i) const { return *kinds_[static_cast<std::size_t>(i)]; }
  const Key& key(int i) const { return keys_[static_cast<std::size_t>(i)]; }
  int dim(int i) const { return kind(i).dim; }
  int offset(int i) const { return offset_[static_cast<std::size_t>(i)]; }
  const double* estimate(int i) const {
    return estimate_.data() + value_start_[static_cast<std::size_t>(i)];
  }
  const Eigen::VectorXd& increments() const { return d_; }

  /// S = d d / d (tangent at the estimate) of one variable: E for points, and for poses that have
  /// not turned.
  Eigen::MatrixXd chart(int i) const;

  /// x = base [+] d, for all.
  void set_increments(const Eigen::VectorXd& d);
  /// The estimate becomes the base, d = 0.
  void rebase();

  /// Estimates with their keys.
  Values<D> values() const;
  /// Number in `variables` (a set of the same keys) of each variable.
  std::vector<int> numbers_in(const VariableSet<D>& variables) const;
  /// Where a variable is; nothing where its type has no position.
  std::optional<Vec<D>> position(int i) const;

 private:
  std::vector<const VariableKind<D>*> kinds_;
  std::vector<Key> keys_;
  std::vector<int> offset_{0};
  std::vector<std::size_t> value_start_{0};
  std::vector<double> base_, estimate_;
  Eigen::VectorXd d_;
  std::vector<std::pair<Key, int>> index_;  ///< sorted
};

extern template class FilterState<2>;
extern template class FilterState<3>;

}  // namespace mapjoin
