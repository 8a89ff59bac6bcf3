#include "mapjoin/graph/block_matrix.h"

#include <fmt/format.h>

#include <algorithm>

#include "mapjoin/graph/error.h"

namespace mapjoin {

namespace {

using ConstBlock = Eigen::Map<const Eigen::MatrixXd>;
using Block = Eigen::Map<Eigen::MatrixXd>;

}  // namespace

SymmetricBlockMatrix::SymmetricBlockMatrix(std::vector<int> offsets,
                                           std::span<const std::pair<int, int>> pairs)
    : offsets_(std::move(offsets)) {
  // Bucket by row, then by column: a radix sort, after which rows ascend within each column.
  const auto n = static_cast<std::size_t>(size());
  std::vector<std::int64_t> start(n + 1, 0);
  for (const auto& [i, j] : pairs) start[static_cast<std::size_t>(std::max(i, j)) + 1] += i != j;
  for (std::size_t k = 0; k < n; ++k) start[k + 1] += start[k];
  std::vector<std::int32_t> column_of(static_cast<std::size_t>(start[n]));
  for (const auto& [i, j] : pairs) {
    if (i != j)
      column_of[static_cast<std::size_t>(start[static_cast<std::size_t>(std::max(i, j))]++)] =
          std::min(i, j);
  }
  for (std::size_t k = n; k > 0; --k) start[k] = start[k - 1];
  start[0] = 0;

  std::vector<std::int64_t> count(n + 1, 0);
  for (const std::int32_t j : column_of) ++count[static_cast<std::size_t>(j) + 1];
  for (std::size_t k = 0; k < n; ++k) count[k + 1] += count[k] + 1;
  std::vector<std::int32_t> rows(static_cast<std::size_t>(count[n]));
  std::vector<std::int64_t> fill(count.begin(), count.end() - 1);
  for (std::size_t j = 0; j < n; ++j)
    rows[static_cast<std::size_t>(fill[j]++)] = static_cast<std::int32_t>(j);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::int64_t k = start[i]; k < start[i + 1]; ++k) {
      std::int64_t& at = fill[static_cast<std::size_t>(column_of[static_cast<std::size_t>(k)])];
      if (rows[static_cast<std::size_t>(at) - 1] != static_cast<std::int32_t>(i)) {
        rows[static_cast<std::size_t>(at++)] = static_cast<std::int32_t>(i);
      }
    }
  }
  column_start_.assign(n + 1, 0);
  std::int64_t total = 0;
  for (std::size_t j = 0; j < n; ++j) {
    for (std::int64_t k = count[j]; k < fill[j]; ++k) {
      const std::int32_t i = rows[static_cast<std::size_t>(k)];
      rows_.push_back(i);
      value_start_.push_back(total);
      total += static_cast<std::int64_t>(dim(i)) * dim(static_cast<int>(j));
    }
    column_start_[j + 1] = static_cast<std::int64_t>(rows_.size());
  }
  values_.assign(static_cast<std::size_t>(total), 0.0);
}

SymmetricBlockMatrix SymmetricBlockMatrix::from_dense(std::vector<int> offsets,
                                                      const Eigen::MatrixXd& dense) {
  const int n = static_cast<int>(offsets.size()) - 1;
  const auto part = [&](int i, int j) {
    return dense.block(
        offsets[static_cast<std::size_t>(i)], offsets[static_cast<std::size_t>(j)],
        offsets[static_cast<std::size_t>(i) + 1] - offsets[static_cast<std::size_t>(i)],
        offsets[static_cast<std::size_t>(j) + 1] - offsets[static_cast<std::size_t>(j)]);
  };
  std::vector<std::pair<int, int>> pairs;
  for (int j = 0; j < n; ++j) {
    for (int i = j + 1; i < n; ++i) {
      if (!part(i, j).isZero(0.0)) pairs.emplace_back(i, j);
    }
  }
  SymmetricBlockMatrix out(offsets, pairs);
  for (int j = 0; j < n; ++j) {
    for (std::int64_t s = out.begin(j); s < out.end(j); ++s) {
      Block block(out.block(s), out.dim(out.row(s)), out.dim(j));
      block = part(out.row(s), j);
      if (out.row(s) == j) block.triangularView<Eigen::StrictlyUpper>() = block.transpose();
    }
  }
  return out;
}

std::int64_t SymmetricBlockMatrix::find(int i, int j) const {
  const auto first = rows_.begin() + begin(j);
  const auto last = rows_.begin() + end(j);
  const auto at = std::lower_bound(first, last, i);
  return at != last && *at == i ? at - rows_.begin() : -1;
}

void SymmetricBlockMatrix::add(int i, int j, const Eigen::Ref<const Eigen::MatrixXd>& value) {
  const std::int64_t slot = i >= j ? find(i, j) : find(j, i);
  if (slot < 0)
    throw Error(fmt::format("block ({}, {}) is not in the pattern of this matrix", i, j));
  if (i >= j) {
    Block(block(slot), dim(i), dim(j)) += value;
  } else {
    Block(block(slot), dim(j), dim(i)) += value.transpose();
  }
}

Eigen::MatrixXd SymmetricBlockMatrix::dense() const {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(scalars(), scalars());
  for (int j = 0; j < size(); ++j) {
    for (std::int64_t s = begin(j); s < end(j); ++s) {
      const int i = row(s);
      const ConstBlock value(block(s), dim(i), dim(j));
      out.block(offset(i), offset(j), dim(i), dim(j)) = value;
      if (i != j) out.block(offset(j), offset(i), dim(j), dim(i)) = value.transpose();
    }
  }
  return out;
}

Eigen::SparseMatrix<double> SymmetricBlockMatrix::lower() const {
  Eigen::SparseMatrix<double> out(scalars(), scalars());
  Eigen::VectorXi count(scalars());
  for (int j = 0; j < size(); ++j) {
    int below = 0;
    for (std::int64_t s = begin(j) + 1; s < end(j); ++s) below += dim(row(s));
    for (int c = 0; c < dim(j); ++c) count(offset(j) + c) = below + dim(j) - c;
  }
  out.reserve(count);
  for (int j = 0; j < size(); ++j) {
    for (int c = 0; c < dim(j); ++c) {
      for (std::int64_t s = begin(j); s < end(j); ++s) {
        const int i = row(s);
        const double* const value = block(s) + static_cast<std::ptrdiff_t>(c) * dim(i);
        for (int r = i == j ? c : 0; r < dim(i); ++r)
          out.insert(offset(i) + r, offset(j) + c) = value[r];
      }
    }
  }
  out.makeCompressed();
  return out;
}

Eigen::VectorXd SymmetricBlockMatrix::operator*(const Eigen::VectorXd& x) const { return times(x); }

Eigen::MatrixXd SymmetricBlockMatrix::times(const Eigen::MatrixXd& x) const {
  Eigen::MatrixXd y = Eigen::MatrixXd::Zero(scalars(), x.cols());
  for (int j = 0; j < size(); ++j) {
    for (std::int64_t s = begin(j); s < end(j); ++s) {
      const int i = row(s);
      const ConstBlock value(block(s), dim(i), dim(j));
      y.middleRows(offset(i), dim(i)).noalias() += value * x.middleRows(offset(j), dim(j));
      if (i != j)
        y.middleRows(offset(j), dim(j)).noalias() +=
            value.transpose() * x.middleRows(offset(i), dim(i));
    }
  }
  return y;
}

}  // namespace mapjoin
