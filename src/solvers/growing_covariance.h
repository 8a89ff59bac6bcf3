// A dense covariance matrix that variables come into and leave.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <utility>
#include <vector>

namespace mapjoin {

/// The covariance matrix of a Kalman filter's state, whose variables come and go at every pose.
///
/// Only the lower triangle is kept up, in an array with room to grow, so that a variable more or
/// less costs O(n) and not a copy of everything. A variable that leaves leaves its rows behind, at
/// zero; the next of the same dimension takes them. So rows are not in the order of arrival, and
/// size() counts rows that nobody has.
class GrowingCovariance {
 public:
  int size() const { return size_; }

  /// Rows for a variable of `dim` scalars, zero. \returns the first of them.
  int add(int dim);
  void remove(int row, int dim);

  /// Columns row to row + dim - 1, whole: size() x dim.
  Eigen::MatrixXd columns(int row, int dim) const;
  /// Sets them, and what mirrors them.
  void set_columns(int row, const Eigen::MatrixXd& columns);

  /// T P T^T, T of these rows alone (size of T from `row` on) and the identity elsewhere: a
  /// variable in other tangents.
  void turn(int row, const Eigen::MatrixXd& T);

  /// P - X X^T, X of size() rows: the O(n^2) of a Kalman update (dsyrk).
  void subtract_square(const Eigen::MatrixXd& X);

  /// Of some rows, whole, in their order. O(their number squared).
  Eigen::MatrixXd of(const std::vector<int>& rows) const;
  /// The inverse of that, whole. Nothing where it is not positive definite. O(n^3).
  std::optional<Eigen::MatrixXd> information(const std::vector<int>& rows) const;

 private:
  Eigen::MatrixXd P_;  ///< the leading size_ rows and columns count
  int size_ = 0;
  std::vector<std::pair<int, int>> free_;  ///< (first row, dim)
};

}  // namespace mapjoin
