#include "mapjoin/frames/local_map.h"

#include <algorithm>

#include "mapjoin/frames/change_frame.h"

namespace mapjoin {

template <int D>
LocalMap<D> as_local_map(const Map<D>& given) {
  const bool elsewhere = given.solved_in.kind != nullptr && !(given.solved_in == given.anchor);
  const Map<D> map = elsewhere ? change_frame(given, given.solved_in) : given;
  const VariableSet<D>& variables = map.variables();
  const AnchorRows rows = anchor_rows(map.anchor, map.values);
  std::vector<char> pinned(static_cast<std::size_t>(variables.scalars()), 0);
  for (const int s : rows.pinned) pinned[static_cast<std::size_t>(s)] = 1;
  const auto is_pinned = [&](int variable, int scalar) {
    return pinned[static_cast<std::size_t>(variables.offset(variable) + scalar)] != 0;
  };

  LocalMap<D> out;
  out.anchor = map.anchor;
  std::vector<int> term(static_cast<std::size_t>(variables.size()), -1);
  std::vector<int> offsets{0};
  for (int i = 0; i < variables.size(); ++i) {
    const VariableKind<D>& kind = variables.kind(i);
    // Nothing but a term says what a type of the user's own is.
    bool listed = kind.tag != Tag("pose") && kind.tag != Tag("point");
    for (int s = 0; s < kind.dim; ++s) listed = listed || !is_pinned(i, s);
    if (!listed) continue;
    term[static_cast<std::size_t>(i)] = static_cast<int>(out.keys.size());
    out.kinds.push_back(&kind);
    out.keys.push_back(variables.key(i));
    out.values.insert(out.values.end(), map.values.value(i), map.values.value(i) + kind.value_size);
    offsets.push_back(offsets.back() + kind.dim);
  }
  const SymmetricBlockMatrix& info = map.information;
  const auto for_blocks = [&](auto&& f) {
    for (int j = 0; j < info.size(); ++j) {
      for (std::int64_t s = info.begin(j); s < info.end(j); ++s) {
        const int row = term[static_cast<std::size_t>(info.row(s))];
        const int column = term[static_cast<std::size_t>(j)];
        if (row >= 0 && column >= 0) f(s, info.row(s), j, row, column);
      }
    }
  };
  std::vector<std::pair<int, int>> pairs;
  for_blocks([&](std::int64_t, int, int, int row, int column) { pairs.emplace_back(row, column); });
  out.information = SymmetricBlockMatrix(std::move(offsets), pairs);
  for_blocks([&](std::int64_t slot, int i, int j, int row, int column) {
    Eigen::MatrixXd block =
        Eigen::Map<const Eigen::MatrixXd>(info.block(slot), info.dim(i), info.dim(j));
    for (int r = 0; r < block.rows(); ++r) {
      if (is_pinned(i, r)) block.row(r).setZero();
    }
    for (int c = 0; c < block.cols(); ++c) {
      if (is_pinned(j, c)) block.col(c).setZero();
    }
    out.information.add(row, column, block);
  });
  return out;
}

template LocalMap<2> as_local_map<2>(const Map<2>&);
template LocalMap<3> as_local_map<3>(const Map<3>&);

}  // namespace mapjoin
