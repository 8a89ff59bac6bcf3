// A Cholesky factor of a growing information matrix that changes at the bottom only (SLSJF, section
// III-G).
//
//          top   bottom
//     L = [ L11         ]   top: sparse, by fronts, as it was factored last
//         [ L21    L22  ]   bottom: dense
//
// What is added to the bottom, Omega, leaves L11 and L21 as they are (equation 12):
//
//     L22' L22'^T = L22 L22^T + Omega
//
// and so does what is added below some row of the bottom to the rows of L22 above it. A dense
// Cholesky factorisation of the rows that change takes the place of one of the whole.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "mapjoin/solvers/frontal_cholesky.h"
#include "mapjoin/solvers/information_sum.h"

namespace mapjoin {

class BottomCholesky {
 public:
  /// Factors everything anew (case ii): `top` is eliminated in its order, what is in `bottom` last,
  /// in its order; together they are all variables. \returns -1, or a variable that is not
  /// determined.
  int refactor(const InformationSum& sum, std::span<const std::int32_t> top,
               std::span<const std::int32_t> bottom);

  /// Appends the variables that `sum` has gained to the bottom, adds its clique k, whose variables
  /// all have to be there, and factors what it changes (case i). \returns as refactor. Cost: the
  /// cube of the number of scalars below the first that changes.
  int add(const InformationSum& sum, std::int64_t k);

  /// How many scalars stand below the variable's first one, itself included, of a variable in the
  /// bottom.
  int height(int variable) const {
    return bottom_scalars_ - place_[static_cast<std::size_t>(variable)];
  }
  bool in_bottom(int variable) const {
    return variable < static_cast<int>(place_.size()) &&
           place_[static_cast<std::size_t>(variable)] >= 0;
  }
  int bottom_scalars() const { return bottom_scalars_; }

  /// I^-1 i (13): forward substitution of the top has been done when it was factored.
  Eigen::VectorXd solution() const;
  /// B := I^-1 B, one column a right-hand side; rows are scalars in the order of arrival.
  void solve_in_place(Eigen::MatrixXd& B) const;

  /// Of L, the bottom's lower triangle counted in full.
  std::int64_t nonzeros() const;

 private:
  struct PanelRange {
    std::int32_t front = 0;
    std::int64_t panel = 0;  ///< first double of [L11; L21]
  };
  int eliminate_top(const InformationSum& sum, std::span<const std::int32_t> top);
  void keep_tree(const InformationSum& sum, std::int32_t first, std::int32_t root,
                 const FrontalCholesky& factor);
  void add_new_variables(const InformationSum& sum);
  int bottom_variable_of(const InformationSum& sum, int row) const;
  Eigen::Map<const Eigen::MatrixXd> panel_of(const PanelRange& range) const;
  void forward_top(Eigen::Ref<Eigen::MatrixXd> B) const;
  void backward_top(Eigen::Ref<Eigen::MatrixXd> B) const;
  void solve_bottom(Eigen::Ref<Eigen::MatrixXd> B) const;

  std::vector<std::int32_t> offset_;  ///< per variable and at the end: scalars by arrival
  std::vector<std::int32_t> place_;   ///< per variable: its first row in the bottom, or -1
  std::vector<std::int32_t> bottom_;  ///< variables from the top row of the bottom down
  FrontalStructure structure_;
  std::vector<PanelRange> panels_;  ///< ascending fronts
  std::vector<double> numbers_;     ///< of the panels
  Eigen::MatrixXd L22_;             ///< with room to grow
  int bottom_scalars_ = 0;
  Eigen::VectorXd reduced_;  ///< i after forward substitution of the top: y above, the rest below
};

}  // namespace mapjoin
