#include "mapjoin/frames/change_frame.h"

#include <Eigen/LU>

namespace mapjoin {

namespace {

/// D_i^-T of the variables of one column: one shared block, one block each, or none where it is the
/// identity.
template <int D>
struct TangentChange {
  MovedColumn<D> column;
  bool shared = false;
  std::vector<double> blocks;

  const double* of(int variable) const {
    if (blocks.empty()) return nullptr;
    const std::ptrdiff_t size = column.kind->dim * column.kind->dim;
    return blocks.data() + (shared ? 0 : (variable - column.first) * size);
  }
};

template <int D>
TangentChange<D> tangent_change(const MovedColumn<D>& column, const Rigid<D>& T) {
  const VariableKind<D>& kind = *column.kind;
  TangentChange<D> out{column, kind.action == FrameAction::kRotating, {}};
  if (out.shared) {
    out.blocks.assign(T.R.data(), T.R.data() + D * D);  // R^-T = R
  } else if (kind.action == FrameAction::kGeneral) {
    const auto size = static_cast<std::size_t>(kind.dim * kind.dim);
    const auto count = static_cast<std::size_t>(column.count);
    out.blocks.resize(count * size);
    kind.frame_jacobian(T, column.values, count, out.blocks.data());
    for (std::size_t k = 0; k < count; ++k) {
      Eigen::Map<Eigen::MatrixXd> block(out.blocks.data() + k * size, kind.dim, kind.dim);
      block = Eigen::MatrixXd(block.inverse().transpose());
    }
  }
  return out;
}

}  // namespace

template <int D>
void move_information(SymmetricBlockMatrix& info, std::span<const MovedColumn<D>> columns,
                      const Rigid<D>& T) {
  std::vector<TangentChange<D>> changes;
  bool nothing = true;
  for (const MovedColumn<D>& column : columns) {
    changes.push_back(tangent_change(column, T));
    nothing = nothing && changes.back().blocks.empty();
  }
  if (nothing) return;
  const auto block_of = [&](int variable) {
    std::size_t c = 0;
    while (variable >= changes[c].column.first + changes[c].column.count) ++c;
    return changes[c].of(variable);
  };
  using Block = Eigen::Map<Eigen::MatrixXd>;
  using ConstBlock = Eigen::Map<const Eigen::MatrixXd>;
  Eigen::MatrixXd product;  // one allocation: reused while blocks keep their shape
  for (int j = 0; j < info.size(); ++j) {
    const double* const right = block_of(j);
    for (std::int64_t s = info.begin(j); s < info.end(j); ++s) {
      const int i = info.row(s);
      const double* const left = block_of(i);
      Block block(info.block(s), info.dim(i), info.dim(j));
      if (left != nullptr) {
        product.noalias() = ConstBlock(left, info.dim(i), info.dim(i)) * block;
        block = product;
      }
      if (right != nullptr) {
        product.noalias() = block * ConstBlock(right, info.dim(j), info.dim(j)).transpose();
        block = product;
      }
    }
  }
}

template <int D>
void move(Map<D>& map, const Rigid<D>& T) {
  std::vector<MovedColumn<D>> columns;
  for (const auto& c : map.variables().columns()) {
    columns.push_back(
        {c.kind, map.values.data(static_cast<int>(columns.size())), c.first, c.size()});
  }
  move_information<D>(map.information, columns, T);
  map.values.transform(T);
}

template <int D>
Map<D> change_frame(Map<D> map, const Anchor<D>& anchor) {
  const std::vector<int> variables = anchor_variables(anchor, map.variables());
  move(map, motion_into(anchor, map.values));
  std::vector<double*> pinned;
  for (const int i : variables) pinned.push_back(map.values.value(i));
  anchor.kind->pin(pinned.data());
  map.anchor = anchor;
  return map;
}

#define MAPJOIN_INSTANTIATE(D)                                                              \
  template void move_information<D>(SymmetricBlockMatrix&, std::span<const MovedColumn<D>>, \
                                    const Rigid<D>&);                                       \
  template void move<D>(Map<D>&, const Rigid<D>&);                                          \
  template Map<D> change_frame<D>(Map<D>, const Anchor<D>&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
