#include "mapjoin/solvers/gauge_scalars.h"

#include <algorithm>
#include <cmath>

namespace mapjoin {

std::vector<int> independent_rows(Eigen::MatrixXd rows, int count, double least) {
  std::vector<int> out;
  double largest = 0.0;
  for (int step = 0; step < count; ++step) {
    Eigen::Index best = 0;
    const double length = std::sqrt(rows.rowwise().squaredNorm().maxCoeff(&best));
    largest = std::max(largest, length);
    if (least > 0.0 && !(length > least * largest)) return {};
    out.push_back(static_cast<int>(best));
    const Eigen::RowVectorXd direction = rows.row(best).normalized();
    rows -= (rows * direction.transpose()) * direction;
  }
  return out;
}

template <int D>
Eigen::MatrixXd gauge_rows(const VariableSet<D>& all, const Piece<D>& piece) {
  constexpr int G = kGauge<D>;
  int scalars = 0;
  for (std::size_t c = 0; c < piece.data.size(); ++c)
    scalars += piece.column_size(c) * all.column(static_cast<int>(c)).kind->dim;
  Eigen::MatrixXd g(scalars, G);
  std::vector<double> blocks;
  int row = 0;
  for (std::size_t c = 0; c < piece.data.size(); ++c) {
    const VariableKind<D>& kind = *all.column(static_cast<int>(c)).kind;
    const auto count = static_cast<std::size_t>(piece.column_size(c));
    const auto size = static_cast<std::size_t>(kind.dim * G);
    blocks.resize(count * size);
    kind.gauge(piece.data[c].data(), count, blocks.data());
    for (std::size_t k = 0; k < count; ++k, row += kind.dim) {
      g.middleRows(row, kind.dim) =
          Eigen::Map<const Eigen::MatrixXd>(blocks.data() + k * size, kind.dim, G);
    }
  }
  return g;
}

template <int D>
std::vector<PieceScalar> gauge_scalars(const VariableSet<D>& all, const Piece<D>& piece, int pose) {
  constexpr int G = kGauge<D>;
  std::vector<PieceScalar> out;
  if (pose >= 0) {
    for (int s = 0; s < G; ++s) out.push_back({pose, s});
    return out;
  }
  for (int k = 0; k < piece.size(); ++k) {
    const int dim = all.dim(piece.variables[static_cast<std::size_t>(k)]);
    for (int s = 0; s < dim; ++s) out.push_back({k, s});
  }
  return most_independent(all, piece, out);
}

template <int D>
int lowest_pose(const VariableSet<D>& all, const Piece<D>& piece) {
  const int c = all.find_column(Tag("pose"));
  if (c < 0) return -1;
  const auto column = static_cast<std::size_t>(c);
  return piece.column_size(column) == 0 ? -1 : piece.column_start[column];
}

template <int D>
std::vector<PieceScalar> most_independent(const VariableSet<D>& all, const Piece<D>& piece,
                                          const std::vector<PieceScalar>& candidates) {
  const std::vector<int> offsets = offsets_of(all, piece);
  std::vector<int> scalars;
  for (const PieceScalar& c : candidates)
    scalars.push_back(offsets[static_cast<std::size_t>(c.variable)] + c.scalar);
  const Eigen::MatrixXd every = gauge_rows(all, piece);
  std::vector<PieceScalar> out;
  for (const int r : independent_rows(every(scalars, Eigen::all), kGauge<D>))
    out.push_back(candidates[static_cast<std::size_t>(r)]);
  std::sort(out.begin(), out.end());
  return out;
}

#define MAPJOIN_INSTANTIATE(D)                                                                     \
  template Eigen::MatrixXd gauge_rows<D>(const VariableSet<D>&, const Piece<D>&);                  \
  template std::vector<PieceScalar> gauge_scalars<D>(const VariableSet<D>&, const Piece<D>&, int); \
  template int lowest_pose<D>(const VariableSet<D>&, const Piece<D>&);                             \
  template std::vector<PieceScalar> most_independent<D>(const VariableSet<D>&, const Piece<D>&,    \
                                                        const std::vector<PieceScalar>&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
