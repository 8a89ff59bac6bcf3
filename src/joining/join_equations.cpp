#include "mapjoin/joining/join_equations.h"

#include "mapjoin/graph/index.h"

namespace mapjoin {

namespace {

using Block = Eigen::Map<const Eigen::MatrixXd>;
/// S of variable i of a map.
Block block_of(const JoinEquations::Rows& rows, int i) {
  const int dim = rows.offset[at(i) + 1] - rows.offset[at(i)];
  return {rows.blocks.data() + rows.block[at(i)], dim, dim};
}

}  // namespace

Eigen::SparseMatrix<double> JoinEquations::A() const {
  std::vector<Eigen::Triplet<double>> entries;
  int first = 0;
  for (const Rows& rows : maps) {
    for (int i = 0; i < static_cast<int>(rows.column.size()); ++i) {
      const Block S = block_of(rows, i);
      for (int c = 0; c < S.cols(); ++c) {
        for (int r = 0; r < S.rows(); ++r) {
          if (S(r, c) == 0.0) continue;
          entries.emplace_back(first + rows.offset[at(i)] + r,
                               column_offset[at(rows.column[at(i)])] + c, S(r, c));
        }
      }
    }
    first += rows.offset.back();
  }
  Eigen::SparseMatrix<double> out(first, column_offset.back());
  out.setFromTriplets(entries.begin(), entries.end());
  return out;
}

Eigen::VectorXd JoinEquations::Z() const {
  Eigen::Index n = 0;
  for (const Rows& rows : maps) n += rows.z.size();
  Eigen::VectorXd out(n);
  n = 0;
  for (const Rows& rows : maps) {
    out.segment(n, rows.z.size()) = rows.z;
    n += rows.z.size();
  }
  return out;
}

Eigen::SparseMatrix<double> JoinEquations::I_Z() const {
  std::vector<Eigen::Triplet<double>> entries;
  int first = 0;
  for (const Rows& rows : maps) {
    const Eigen::SparseMatrix<double> lower = rows.information->lower();
    for (int c = 0; c < lower.outerSize(); ++c) {
      for (Eigen::SparseMatrix<double>::InnerIterator it(lower, c); it; ++it) {
        const int r = static_cast<int>(it.row());
        entries.emplace_back(first + r, first + c, it.value());
        if (r != c) entries.emplace_back(first + c, first + r, it.value());
      }
    }
    first += rows.offset.back();
  }
  Eigen::SparseMatrix<double> out(first, first);
  out.setFromTriplets(entries.begin(), entries.end());
  return out;
}

SymmetricBlockMatrix JoinEquations::normal_matrix() const {
  std::vector<std::pair<int, int>> pairs;
  for (const Rows& rows : maps) {
    const SymmetricBlockMatrix& I = *rows.information;
    for (int j = 0; j < I.size(); ++j) {
      for (std::int64_t s = I.begin(j) + 1; s < I.end(j); ++s)
        pairs.emplace_back(rows.column[at(I.row(s))], rows.column[at(j)]);
    }
  }
  SymmetricBlockMatrix out(column_offset, pairs);
  Eigen::MatrixXd product, whole;
  for (const Rows& rows : maps) {
    const SymmetricBlockMatrix& I = *rows.information;
    for (int j = 0; j < I.size(); ++j) {
      const Block Sj = block_of(rows, j);
      for (std::int64_t s = I.begin(j); s < I.end(j); ++s) {
        const int i = I.row(s);
        product.noalias() = Block(I.block(s), I.dim(i), I.dim(j)) * Sj;
        whole.noalias() = block_of(rows, i).transpose() * product;
        if (i == j) whole = 0.5 * (whole + whole.transpose()).eval();
        out.add(rows.column[at(i)], rows.column[at(j)], whole);
      }
    }
  }
  return out;
}

Eigen::VectorXd JoinEquations::right_hand_side() const {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(column_offset.back());
  for (const Rows& rows : maps) {
    const Eigen::VectorXd weighted = *rows.information * rows.z;
    for (int i = 0; i < static_cast<int>(rows.column.size()); ++i) {
      const Block S = block_of(rows, i);
      out.segment(column_offset[at(rows.column[at(i)])], S.cols()).noalias() +=
          S.transpose() * weighted.segment(rows.offset[at(i)], S.rows());
    }
  }
  return out;
}

template <int D>
JoinEquations join_equations(const VariableSet<D>& all, std::span<const Summary<D>* const> maps,
                             const Piece<D>& x0) {
  JoinEquations out;
  out.column_offset = offsets_of(all, x0);
  std::vector<double> there;
  for (const Summary<D>* map : maps) {
    const Piece<D>& piece = map->piece;
    JoinEquations::Rows rows;
    rows.offset = offsets_of(all, piece);
    rows.z.resize(rows.offset.back());
    rows.information = &map->information;
    std::int64_t block = 0;
    for (std::size_t c = 0; c < piece.data.size(); ++c) {
      const VariableKind<D>& kind = *all.column(static_cast<int>(c)).kind;
      const auto count = at(piece.column_size(c));
      const auto size = at(kind.value_size);
      there.resize(count * size);
      int to = x0.column_start[c];
      for (std::size_t k = 0; k < count; ++k) {
        const int v = piece.variables[at(piece.column_start[c]) + k];
        while (x0.variables[at(to)] < v) ++to;
        rows.column.push_back(to);
        rows.block.push_back(block + static_cast<std::int64_t>(k) * kind.dim * kind.dim);
        const double* const x = x0.data[c].data() + at(to - x0.column_start[c]) * size;
        std::copy(x, x + size, there.begin() + static_cast<std::ptrdiff_t>(k * size));
      }
      rows.blocks.resize(rows.blocks.size() + count * at(kind.dim * kind.dim));
      kind.local_jacobian(piece.data[c].data(), there.data(), count, rows.blocks.data() + block);
      if (count > 0) {
        kind.local(piece.data[c].data(), there.data(), count,
                   rows.z.data() + rows.offset[at(piece.column_start[c])]);
      }
      block = static_cast<std::int64_t>(rows.blocks.size());
    }
    rows.z = -rows.z;
    out.maps.push_back(std::move(rows));
  }
  return out;
}

template JoinEquations join_equations<2>(const VariableSet<2>&, std::span<const Summary<2>* const>,
                                         const Piece<2>&);
template JoinEquations join_equations<3>(const VariableSet<3>&, std::span<const Summary<3>* const>,
                                         const Piece<3>&);

}  // namespace mapjoin
