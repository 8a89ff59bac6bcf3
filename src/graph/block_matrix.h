#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace mapjoin {

/// Symmetric block-sparse matrix: the lower triangle by block columns, each block dense and
/// column-major.
///
/// Row i and column i belong to variable i; its scalars are offsets()[i] .. offsets()[i+1]-1. The
/// diagonal block is stored always, in full, and comes first in its column; rows ascend below it.
/// Three flat arrays, no hashing.
class SymmetricBlockMatrix {
 public:
  SymmetricBlockMatrix() : offsets_{0}, column_start_{0} {}

  /// The zero matrix with the blocks (i, j) of `pairs` (in either orientation, repetitions allowed)
  /// and all diagonal blocks. `offsets` has one entry a variable and the number of scalars at the
  /// end. O(n + pairs).
  SymmetricBlockMatrix(std::vector<int> offsets, std::span<const std::pair<int, int>> pairs);

  /// Blocks of a dense symmetric matrix (its lower triangle is read); blocks that are zero
  /// throughout are left out.
  static SymmetricBlockMatrix from_dense(std::vector<int> offsets, const Eigen::MatrixXd& dense);

  int size() const { return static_cast<int>(offsets_.size()) - 1; }  ///< block rows
  int scalars() const { return offsets_.back(); }
  std::int64_t blocks() const { return static_cast<std::int64_t>(rows_.size()); }
  int offset(int i) const { return offsets_[static_cast<std::size_t>(i)]; }
  int dim(int i) const { return offset(i + 1) - offset(i); }
  const std::vector<int>& offsets() const { return offsets_; }

  /// Blocks of column j are begin(j) .. end(j)-1; the first is the diagonal one.
  std::int64_t begin(int j) const { return column_start_[static_cast<std::size_t>(j)]; }
  std::int64_t end(int j) const { return column_start_[static_cast<std::size_t>(j) + 1]; }
  int row(std::int64_t slot) const { return rows_[static_cast<std::size_t>(slot)]; }
  /// dim(row) x dim(column) doubles, column-major.
  double* block(std::int64_t slot) {
    return values_.data() + value_start_[static_cast<std::size_t>(slot)];
  }
  const double* block(std::int64_t slot) const {
    return values_.data() + value_start_[static_cast<std::size_t>(slot)];
  }
  /// The slot of block (i, j), i >= j; -1 where there is none. O(log of the column's length).
  std::int64_t find(int i, int j) const;
  /// Adds a dim(i) x dim(j) block, in either orientation. The block must be in the pattern.
  void add(int i, int j, const Eigen::Ref<const Eigen::MatrixXd>& block);

  std::span<const double> values() const { return values_; }
  std::span<double> values() { return values_; }

  Eigen::MatrixXd dense() const;
  /// The lower triangle as a scalar sparse matrix.
  Eigen::SparseMatrix<double> lower() const;
  /// y = M x.
  Eigen::VectorXd operator*(const Eigen::VectorXd& x) const;
  /// M x for several columns x.
  Eigen::MatrixXd times(const Eigen::MatrixXd& x) const;

  friend bool operator==(const SymmetricBlockMatrix&, const SymmetricBlockMatrix&) = default;

 private:
  friend class BlockMatrixFile;
  std::vector<int> offsets_;
  std::vector<std::int64_t> column_start_;
  std::vector<std::int32_t> rows_;
  std::vector<std::int64_t> value_start_;
  std::vector<double> values_;
};

}  // namespace mapjoin
