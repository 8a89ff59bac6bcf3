#include <limits>

#include "mapjoin/io/native_layout.h"

namespace mapjoin {

void BlockMatrixFile::write(ByteWriter& out, const SymmetricBlockMatrix& matrix) {
  out.array(matrix.offsets_);
  out.array(matrix.column_start_);
  out.array(matrix.rows_);
  out.array(matrix.values_);
}

SymmetricBlockMatrix BlockMatrixFile::read(ByteReader& in) {
  SymmetricBlockMatrix m;
  m.offsets_ = in.array<int>("offsets");
  in.require(!m.offsets_.empty() && m.offsets_[0] == 0,
             "the offsets of the information matrix do not begin with 0");
  for (std::size_t i = 1; i < m.offsets_.size(); ++i) {
    in.require(m.offsets_[i] > m.offsets_[i - 1],
               "the offsets of the information matrix do not ascend");
  }
  m.column_start_ = in.array<std::int64_t>("block columns");
  m.rows_ = in.array<std::int32_t>("block rows");
  m.values_ = in.array<double>("numbers");

  const int n = m.size();
  in.require(m.column_start_.size() == m.offsets_.size() && m.column_start_.front() == 0 &&
                 m.column_start_.back() == static_cast<std::int64_t>(m.rows_.size()),
             "the block columns of the information matrix do not fit its size");
  std::int64_t total = 0;
  m.value_start_.reserve(m.rows_.size());
  for (int j = 0; j < n; ++j) {
    in.require(m.begin(j) < m.end(j) && m.end(j) <= m.blocks() && m.row(m.begin(j)) == j,
               "a column of the information matrix has no diagonal block");
    for (std::int64_t s = m.begin(j); s < m.end(j); ++s) {
      const int i = m.row(s);
      in.require(i < n && (s == m.begin(j) || i > m.row(s - 1)),
                 "rows of the information matrix do not ascend");
      m.value_start_.push_back(total);
      total += static_cast<std::int64_t>(m.dim(i)) * m.dim(j);
    }
  }
  in.require(total == static_cast<std::int64_t>(m.values_.size()),
             "the information matrix has another number of entries than its blocks");
  return m;
}

}  // namespace mapjoin
