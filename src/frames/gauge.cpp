#include "mapjoin/frames/gauge.h"

#include <algorithm>

#include "mapjoin/graph/dense.h"

namespace mapjoin {

SymmetricBlockMatrix complete_gauge(const Eigen::MatrixXd& g, const AnchorRows& rows,
                                    const SymmetricBlockMatrix& anchored) {
  const Eigen::MatrixXd K = solve_regular(rows.C, rows.P);
  const Eigen::MatrixXd W = anchored.times(g);  // I g
  // g^T I g, symmetric to the last bit. What rounding leaves would belong to no gauge, and the next
  // completion, at another anchor, would add up that of all anchors before it: twice as much each
  // time.
  const Eigen::MatrixXd M = symmetric_part(g.transpose() * W);

  const int n = anchored.size();
  std::vector<std::pair<int, int>> pairs;
  for (int j = 0; j < n; ++j) {
    for (std::int64_t s = anchored.begin(j) + 1; s < anchored.end(j); ++s)
      pairs.emplace_back(anchored.row(s), j);
    const bool informed = !W.middleRows(anchored.offset(j), anchored.dim(j)).isZero(0.0);
    for (const int a : rows.variables) {
      if (informed ||
          std::find(rows.variables.begin(), rows.variables.end(), j) != rows.variables.end()) {
        pairs.emplace_back(a, j);
      }
    }
  }
  SymmetricBlockMatrix out(anchored.offsets(), pairs);
  for (int j = 0; j < n; ++j) {
    for (std::int64_t s = anchored.begin(j); s < anchored.end(j); ++s) {
      const int i = anchored.row(s);
      out.add(
          i, j,
          Eigen::Map<const Eigen::MatrixXd>(anchored.block(s), anchored.dim(i), anchored.dim(j)));
    }
  }
  std::vector<int> first{0};  // of each of the anchor's variables in its stacked tangent
  for (const int v : rows.variables) first.push_back(first.back() + anchored.dim(v));
  const auto part = [&](std::size_t k) {
    return K.middleCols(first[k], anchored.dim(rows.variables[k]));
  };
  // Lambda = I - W K - (W K)^T + K^T M K, where K has columns at the anchor only.
  for (std::size_t k = 0; k < rows.variables.size(); ++k) {
    const int a = rows.variables[k];
    for (int i = 0; i < n; ++i) {
      const auto Wi = W.middleRows(anchored.offset(i), anchored.dim(i));
      if (Wi.isZero(0.0)) continue;
      const Eigen::MatrixXd change = -Wi * part(k);
      out.add(i, a, change);
      if (i == a) out.add(a, a, change.transpose());
    }
    for (std::size_t l = 0; l <= k; ++l)
      out.add(a, rows.variables[l], part(k).transpose() * M * part(l));
  }
  return out;
}

template <int D>
SymmetricBlockMatrix complete_gauge(const Values<D>& values, const Anchor<D>& anchor,
                                    const SymmetricBlockMatrix& anchored) {
  return complete_gauge(values.gauge(), anchor_rows(anchor, values), anchored);
}

void leave_out(SymmetricBlockMatrix& information, std::span<const int> scalars) {
  std::vector<char> held(static_cast<std::size_t>(information.size()), 0);  // any scalar of each
  std::vector<char> out(static_cast<std::size_t>(information.scalars()), 0);
  int variable = 0;
  for (const int s : scalars) {
    while (s >= information.offset(variable + 1)) ++variable;
    held[static_cast<std::size_t>(variable)] = 1;
    out[static_cast<std::size_t>(s)] = 1;
  }
  for (int j = 0; j < information.size(); ++j) {
    for (std::int64_t slot = information.begin(j); slot < information.end(j); ++slot) {
      const int i = information.row(slot);
      if (held[static_cast<std::size_t>(i)] == 0 && held[static_cast<std::size_t>(j)] == 0)
        continue;
      double* at = information.block(slot);
      for (int c = information.offset(j); c < information.offset(j + 1); ++c) {
        for (int r = information.offset(i); r < information.offset(i + 1); ++r, ++at) {
          if (out[static_cast<std::size_t>(r)] != 0 || out[static_cast<std::size_t>(c)] != 0)
            *at = 0.0;
        }
      }
    }
  }
}

template <int D>
AnchoredInformation anchored_information(const Map<D>& map) {
  const AnchorRows rows = anchor_rows(map.anchor, map.values);
  if (rows.pinned.empty()) {
    throw InputError(to_string(map.anchor) +
                     " pins mixtures of coordinates, which no row of the information stands for; "
                     "change to another frame first");
  }
  AnchoredInformation out;
  const int n = map.information.scalars();
  std::vector<int> place(static_cast<std::size_t>(n), 0);
  for (const int s : rows.pinned) place[static_cast<std::size_t>(s)] = -1;
  for (int s = 0; s < n; ++s) {
    if (place[static_cast<std::size_t>(s)] < 0) continue;
    place[static_cast<std::size_t>(s)] = static_cast<int>(out.scalars.size());
    out.scalars.push_back(s);
  }
  std::vector<Eigen::Triplet<double>> entries;
  const Eigen::SparseMatrix<double> all = map.information.lower();
  for (int j = 0; j < n; ++j) {
    const int to = place[static_cast<std::size_t>(j)];
    if (to < 0) continue;
    for (Eigen::SparseMatrix<double>::InnerIterator it(all, j); it; ++it) {
      const int row = place[static_cast<std::size_t>(it.row())];
      if (row >= 0) entries.emplace_back(row, to, it.value());
    }
  }
  const auto size = static_cast<Eigen::Index>(out.scalars.size());
  out.lower.resize(size, size);
  out.lower.setFromTriplets(entries.begin(), entries.end());
  return out;
}

#define MAPJOIN_INSTANTIATE(D)                                                        \
  template SymmetricBlockMatrix complete_gauge<D>(const Values<D>&, const Anchor<D>&, \
                                                  const SymmetricBlockMatrix&);       \
  template AnchoredInformation anchored_information<D>(const Map<D>&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
