#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <functional>
#include <span>
#include <vector>

#include "mapjoin/filtering/filter_options.h"
#include "mapjoin/filtering/filter_state.h"
#include "mapjoin/graph/map.h"
#include "mapjoin/solvers/bottom_cholesky.h"

/// \file
/// The extended information filter that SLSJF and D-SLAM map joining have in common: information
/// vector i, information matrix I, I x = i (equation 4 of SLSJF, 5 of D-SLAM map joining).
///
/// Observations of the state are added,
///
///     I += H^T R^-1 H        i += H^T R^-1 (z - h(x) + H x)         (8), (6)
///
/// linearised at the estimate x of that moment; then x is recovered. Nothing is ever marginalised,
/// so I has an entry for two variables exactly where some observation is of both.
///
/// The frame is fixed by the anchor of what came first: the scalars it pins are no part of the
/// state.

namespace mapjoin {

template <int D>
class InformationFilter {
 public:
  explicit InformationFilter(const FilterOptions& options = {});

  const FilterState<D>& state() const { return state_; }
  const Anchor<D>& anchor() const { return anchor_; }
  bool empty() const { return state_.size() == 0; }

  /// The first variables: their values, written in the frame of the anchor, and what it pins.
  /// \throws InputError when the anchor pins mixtures of scalars; DegenerateFrameError.
  void start(const Values<D>& values, const Anchor<D>& anchor);
  /// A further variable, at its initial value.
  int add_variable(const VariableKind<D>& kind, const Key& key, const double* x);

  /// Adds what an observation says of some variables: H^T R^-1 H (lower triangle) and H^T R^-1 (z -
  /// h(x)), both in the tangents at the estimates, variables stacked in the order given. O(n^2).
  void add_information(std::span<const std::int32_t> variables, Eigen::MatrixXd lower,
                       Eigen::VectorXd vector);

  /// Orders where necessary, factors, and recovers the estimate after one observation has been
  /// added (Algorithm 2, steps 4 to 6). `focus`: the variable that "near" is meant of, -1 for the
  /// last one. \throws SingularError naming a variable that the observations do not determine.
  void update(int focus, Fusion& fusion);

  /// Sums I and i up again at the present estimate: `add_all` adds every observation there has
  /// been.
  void relinearise(const std::function<void()>& add_all);

  /// Covariance of some variables relative to the frame, dense, by solving I P_l = e_l (5) for each
  /// of their scalars; in their tangents at the estimates. What the frame pins has none.
  Eigen::MatrixXd covariance(std::span<const int> variables);

  /// The information matrix, lower triangle, scalars in the order of arrival; pinned ones have a
  /// row with nothing but 1 on the diagonal. In increments, see FilterState.
  Eigen::SparseMatrix<double> information() const;
  /// Entries of the symmetric information matrix over what the frame leaves free: of blocks that
  /// some observation has touched.
  std::int64_t nonzeros() const;
  std::int64_t factor_nonzeros() const { return factor_.nonzeros(); }
  int free_scalars() const { return state_.scalars() - held_count_; }

  /// The estimate with gauge-free information, in the frame of the anchor. O(n), and a row of
  /// blocks between the anchor and everything.
  Map<D> map() const;

 private:
  bool is_held(int scalar) const { return held_[static_cast<std::size_t>(scalar)] != 0; }
  bool held_whole(int variable) const;
  void add_stiffness_of_held();
  int rule_n0(std::span<const std::int32_t> clique) const;
  bool must_reorder(std::int64_t clique, int n0) const;
  /// Brings the order up to date. \returns whether all has to be factored anew.
  bool order(int focus, Fusion& fusion);
  void require_determined(int variable) const;
  void set_estimate(const Eigen::VectorXd& d);
  /// I with variable i at place order[i]; in the tangents at the estimates or in increments.
  SymmetricBlockMatrix block_information(std::span<const int> order, bool in_tangents) const;

  FilterOptions options_;
  FilterState<D> state_;
  Anchor<D> anchor_;
  std::vector<char> held_;  ///< per scalar: pinned by the anchor
  int held_count_ = 0;
  InformationSum sum_;
  std::vector<std::int32_t> top_, bottom_;  ///< the order, from the top row down
  BottomCholesky factor_;
  std::int64_t factored_cliques_ = 0;  ///< of sum_, in the factor
  int factored_variables_ = 0;
  int fusions_ = 0;
};

extern template class InformationFilter<2>;
extern template class InformationFilter<3>;

}  // namespace mapjoin
