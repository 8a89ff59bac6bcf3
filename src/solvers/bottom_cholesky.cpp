#include "mapjoin/solvers/bottom_cholesky.h"

#include <algorithm>

#include "mapjoin/graph/index.h"
#include "mapjoin/solvers/dense_blas.h"
#include "mapjoin/solvers/frontal_cholesky.h"

namespace mapjoin {

namespace {

/// Copies the rows of the given variables, stacked, out of B or back into it.
template <class From, class To>
void gather(std::span<const std::int32_t> variables, const std::vector<std::int32_t>& offset,
            const From& B, To&& out) {
  Eigen::Index row = 0;
  for (const std::int32_t v : variables) {
    const Eigen::Index dim = offset[at(v) + 1] - offset[at(v)];
    out.middleRows(row, dim) = B.middleRows(offset[at(v)], dim);
    row += dim;
  }
}
template <class From, class To>
void scatter(std::span<const std::int32_t> variables, const std::vector<std::int32_t>& offset,
             const From& rows, To&& B) {
  Eigen::Index row = 0;
  for (const std::int32_t v : variables) {
    const Eigen::Index dim = offset[at(v) + 1] - offset[at(v)];
    B.middleRows(offset[at(v)], dim) = rows.middleRows(row, dim);
    row += dim;
  }
}

/// Adds a block whose lower triangle counts where it is on the diagonal; off it, on whichever side.
template <class Block>
void add_lower(int row, int column, const Block& block, Eigen::MatrixXd& to) {
  if (row == column) {
    to.block(row, column, block.rows(), block.cols()).template triangularView<Eigen::Lower>() +=
        block;
  } else if (row > column) {
    to.block(row, column, block.rows(), block.cols()) += block;
  } else {
    to.block(column, row, block.cols(), block.rows()) += block.transpose();
  }
}

/// A pivot below this share of the diagonal entry it came from may be rounding error (see
/// FactorOptions::smallest_pivot).
constexpr double kSmallestPivot = 1e-13;

/// Lower triangle A = L L^T. \returns -1, or the first row that is not determined.
int factor_determined(Eigen::Ref<Eigen::MatrixXd> A) {
  const Eigen::VectorXd diagonal = A.diagonal();
  const int failed = factor_lower(A);
  const Eigen::Index end = failed < 0 ? A.rows() : failed;
  for (Eigen::Index j = 0; j < end; ++j) {
    if (!(A(j, j) * A(j, j) > kSmallestPivot * diagonal(j))) return static_cast<int>(j);
  }
  return failed;
}

/// f(variable a, variable b, block) for the blocks of clique k on and below the diagonal, column by
/// column.
template <class F>
void for_blocks(const InformationSum& sum, std::int64_t k, F&& f) {
  const auto clique = sum.clique(k);
  const auto matrix = sum.matrix(k);
  Eigen::Index column = 0;
  for (std::size_t j = 0; j < clique.size(); ++j) {
    Eigen::Index row = column;
    for (std::size_t i = j; i < clique.size(); ++i) {
      f(clique[i], clique[j],
        matrix.block(row, column, sum.dims[at(clique[i])], sum.dims[at(clique[j])]));
      row += sum.dims[at(clique[i])];
    }
    column += sum.dims[at(clique[j])];
  }
}

}  // namespace

int BottomCholesky::refactor(const InformationSum& sum, std::span<const std::int32_t> top,
                             std::span<const std::int32_t> bottom) {
  offset_ = sum.offset;
  bottom_.assign(bottom.begin(), bottom.end());
  place_.assign(at(sum.size()), -1);
  bottom_scalars_ = 0;
  for (const std::int32_t v : bottom_) {
    place_[at(v)] = bottom_scalars_;
    bottom_scalars_ += sum.dims[at(v)];
  }
  const int room = bottom_scalars_ + bottom_scalars_ / 2 + 64;
  L22_.setZero(room, room);
  panels_.clear();
  numbers_.clear();
  if (!top.empty()) {
    if (const int failed = eliminate_top(sum, top); failed >= 0) return failed;
  }
  const auto above = [&](std::int32_t v) { return place_[at(v)] < 0; };
  for (std::int64_t k = 0; k < sum.cliques(); ++k) {
    const auto clique = sum.clique(k);
    if (std::any_of(clique.begin(), clique.end(), above)) continue;
    for_blocks(sum, k, [&](std::int32_t a, std::int32_t b, const auto& block) {
      add_lower(place_[at(a)], place_[at(b)], block, L22_);
    });
  }
  reduced_ = sum.information_vector();
  forward_top(reduced_);
  const int failed = factor_determined(L22_.topLeftCorner(bottom_scalars_, bottom_scalars_));
  return failed < 0 ? -1 : bottom_variable_of(sum, failed);
}

/// Factors the trees of the top one after another, each onto the bottom around it.
int BottomCholesky::eliminate_top(const InformationSum& sum, std::span<const std::int32_t> top) {
  std::vector<std::int64_t> start{0};
  std::vector<std::int32_t> members;
  const auto above = [&](std::int32_t v) { return place_[at(v)] < 0; };
  for (std::int64_t k = 0; k < sum.cliques(); ++k) {
    const auto clique = sum.clique(k);  // of the bottom alone: an empty one for the fronts
    if (std::any_of(clique.begin(), clique.end(), above))
      members.insert(members.end(), clique.begin(), clique.end());
    start.push_back(static_cast<std::int64_t>(members.size()));
  }
  std::vector<std::int32_t> order(top.begin(), top.end());
  order.insert(order.end(), bottom_.begin(), bottom_.end());
  structure_ =
      analyze(sum.dims, {start, members}, order, {}, static_cast<std::int32_t>(top.size()));
  FrontalCholesky factor;
  const auto assemble = [&](std::int32_t front, const FrontView& view) {
    for (const std::int64_t k : structure_.owned_by(front)) {
      const auto rows = structure_.clique_rows(k);
      std::size_t i = 0, j = 0;
      for_blocks(sum, k, [&](std::int32_t, std::int32_t, const auto& block) {
        view.add(rows[i], rows[j], block);
        if (++i == rows.size()) i = ++j;
      });
    }
  };
  std::int32_t first = 0;
  for (std::int32_t f = 0; f < static_cast<std::int32_t>(structure_.fronts.size()); ++f) {
    const Front& front = structure_.fronts[at(f)];
    if (front.parent >= 0) continue;
    if (above(structure_.order[at(front.first_position)])) {
      const FactorStatus status = factor.factorize_subtree(structure_, first, f, assemble);
      if (!status.ok()) return status.failed_variable;
      keep_tree(sum, first, f, factor);
    }
    first = f + 1;
  }
  return -1;
}

/// Keeps the panels of a factored tree and adds what is left of it to the bottom.
void BottomCholesky::keep_tree(const InformationSum& sum, std::int32_t first, std::int32_t root,
                               const FrontalCholesky& factor) {
  for (std::int32_t f = first; f <= root; ++f) {
    const FrontConditional front = factor.conditional(f);
    const Eigen::Index p = front.l11.rows(), q = front.l21.rows();
    panels_.push_back({f, static_cast<std::int64_t>(numbers_.size())});
    numbers_.resize(numbers_.size() + at((p + q) * p));
    Eigen::Map<Eigen::MatrixXd> panel(numbers_.data() + panels_.back().panel, p + q, p);
    panel.topRows(p).triangularView<Eigen::Lower>() = front.l11;
    panel.bottomRows(q) = front.l21;
  }
  const auto S = factor.update_matrix(root);
  const auto updates = structure_.updates_of(root);
  Eigen::Index column = 0;
  for (std::size_t j = 0; j < updates.size(); ++j) {
    const std::int32_t b = structure_.order[at(updates[j])];
    Eigen::Index row = column;
    for (std::size_t i = j; i < updates.size(); ++i) {
      const std::int32_t a = structure_.order[at(updates[i])];
      add_lower(place_[at(a)], place_[at(b)],
                S.block(row, column, sum.dims[at(a)], sum.dims[at(b)]), L22_);
      row += sum.dims[at(a)];
    }
    column += sum.dims[at(b)];
  }
}

void BottomCholesky::add_new_variables(const InformationSum& sum) {
  const int before = bottom_scalars_;
  for (int v = static_cast<int>(place_.size()); v < sum.size(); ++v) {
    bottom_.push_back(v);
    place_.push_back(bottom_scalars_);
    bottom_scalars_ += sum.dims[at(v)];
  }
  offset_ = sum.offset;
  reduced_.conservativeResizeLike(Eigen::VectorXd::Zero(sum.scalars()));
  if (bottom_scalars_ > L22_.rows()) {
    const Eigen::MatrixXd old = L22_.topLeftCorner(before, before);
    L22_.setZero(2 * bottom_scalars_, 2 * bottom_scalars_);
    L22_.topLeftCorner(before, before) = old;
  }
}

int BottomCholesky::bottom_variable_of(const InformationSum& sum, int row) const {
  return *std::find_if(bottom_.begin(), bottom_.end(),
                       [&](std::int32_t v) { return place_[at(v)] + sum.dims[at(v)] > row; });
}

int BottomCholesky::add(const InformationSum& sum, std::int64_t k) {
  add_new_variables(sum);
  const auto clique = sum.clique(k);
  if (clique.empty()) return -1;
  int first = bottom_scalars_;
  for (const std::int32_t v : clique) first = std::min(first, place_[at(v)]);
  const int n = bottom_scalars_ - first;
  auto L = L22_.block(first, first, n, n);
  L.triangularView<Eigen::StrictlyUpper>().setZero();
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(n, n);
  add_square(1.0, L, M);
  for_blocks(sum, k, [&](std::int32_t a, std::int32_t b, const auto& block) {
    add_lower(place_[at(a)] - first, place_[at(b)] - first, block, M);
  });
  const auto vector = sum.vector(k);
  Eigen::Index row = 0;
  for (const std::int32_t v : clique) {
    reduced_.segment(offset_[at(v)], sum.dims[at(v)]) += vector.segment(row, sum.dims[at(v)]);
    row += sum.dims[at(v)];
  }
  const int failed = factor_determined(M);
  L.triangularView<Eigen::Lower>() = M;
  return failed < 0 ? -1 : bottom_variable_of(sum, first + failed);
}

Eigen::Map<const Eigen::MatrixXd> BottomCholesky::panel_of(const PanelRange& range) const {
  const Front& front = structure_.fronts[at(range.front)];
  return {numbers_.data() + range.panel, front.rows(), front.pivot_dim};
}

void BottomCholesky::forward_top(Eigen::Ref<Eigen::MatrixXd> B) const {
  Eigen::MatrixXd pivots, updates;
  for (const PanelRange& range : panels_) {
    const Front& front = structure_.fronts[at(range.front)];
    const auto panel = panel_of(range);
    const auto own =
        std::span(structure_.order)
            .subspan(at(front.first_position), at(front.end_position - front.first_position));
    pivots.resize(front.pivot_dim, B.cols());
    gather(own, offset_, B, pivots);
    panel.topRows(front.pivot_dim).triangularView<Eigen::Lower>().solveInPlace(pivots);
    scatter(own, offset_, pivots, B);
    updates.noalias() = panel.bottomRows(front.update_dim) * pivots;
    Eigen::Index row = 0;
    for (const std::int32_t position : structure_.updates_of(range.front)) {
      const std::int32_t v = structure_.order[at(position)];
      const Eigen::Index dim = offset_[at(v) + 1] - offset_[at(v)];
      B.middleRows(offset_[at(v)], dim) -= updates.middleRows(row, dim);
      row += dim;
    }
  }
}

void BottomCholesky::backward_top(Eigen::Ref<Eigen::MatrixXd> B) const {
  Eigen::MatrixXd pivots, updates;
  for (std::size_t k = panels_.size(); k-- > 0;) {
    const Front& front = structure_.fronts[at(panels_[k].front)];
    const auto panel = panel_of(panels_[k]);
    const auto own =
        std::span(structure_.order)
            .subspan(at(front.first_position), at(front.end_position - front.first_position));
    pivots.resize(front.pivot_dim, B.cols());
    updates.resize(front.update_dim, B.cols());
    gather(own, offset_, B, pivots);
    Eigen::Index row = 0;
    for (const std::int32_t position : structure_.updates_of(panels_[k].front)) {
      const std::int32_t v = structure_.order[at(position)];
      const Eigen::Index dim = offset_[at(v) + 1] - offset_[at(v)];
      updates.middleRows(row, dim) = B.middleRows(offset_[at(v)], dim);
      row += dim;
    }
    pivots.noalias() -= panel.bottomRows(front.update_dim).transpose() * updates;
    panel.topRows(front.pivot_dim).transpose().triangularView<Eigen::Upper>().solveInPlace(pivots);
    scatter(own, offset_, pivots, B);
  }
}

void BottomCholesky::solve_bottom(Eigen::Ref<Eigen::MatrixXd> B) const {
  Eigen::MatrixXd rows(bottom_scalars_, B.cols());
  gather(bottom_, offset_, B, rows);
  const auto L = L22_.topLeftCorner(bottom_scalars_, bottom_scalars_);
  solve_lower_left(L, rows);
  solve_transposed_left(L, rows);
  scatter(bottom_, offset_, rows, B);
}

Eigen::VectorXd BottomCholesky::solution() const {
  Eigen::VectorXd x = reduced_;
  solve_bottom(x);
  backward_top(x);
  return x;
}

void BottomCholesky::solve_in_place(Eigen::MatrixXd& B) const {
  forward_top(B);
  solve_bottom(B);
  backward_top(B);
}

std::int64_t BottomCholesky::nonzeros() const {
  std::int64_t n = static_cast<std::int64_t>(bottom_scalars_) * (bottom_scalars_ + 1) / 2;
  for (const PanelRange& range : panels_) {
    const Front& front = structure_.fronts[at(range.front)];
    n += static_cast<std::int64_t>(front.pivot_dim) * (front.pivot_dim + 1) / 2 +
         static_cast<std::int64_t>(front.pivot_dim) * front.update_dim;
  }
  return n;
}

}  // namespace mapjoin
