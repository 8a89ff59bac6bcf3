#include "mapjoin/solvers/submap_kernel.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <vector>

#include "mapjoin/graph/dense.h"
#include "mapjoin/graph/index.h"

namespace mapjoin {

namespace {

using Eigen::Dynamic;

// Small matrices by columns, as plain loops: as expressions the sizes below cost the compiler a
// minute. M, K, N are the sizes where it may know them, Dynamic elsewhere.

/// A size as the compiler knows it, or else as it is.
template <int Known>
constexpr int size_of(int size) {
  return Known != Dynamic ? Known : size;
}

/// C += A B, m x k times k x n.
template <int M, int K, int N>
void add_product(const double* A, const double* B, double* C, int m, int k, int n) {
  m = size_of<M>(m), k = size_of<K>(k), n = size_of<N>(n);
  for (int j = 0; j < n; ++j) {
    if constexpr (M != Dynamic) {
      double column[M] = {};
      for (int p = 0; p < k; ++p) {
        for (int i = 0; i < M; ++i) column[i] += A[p * M + i] * B[j * k + p];
      }
      for (int i = 0; i < M; ++i) C[j * M + i] += column[i];
    } else {
      for (int i = 0; i < m; ++i) {
        double sum = 0.0;
        for (int p = 0; p < k; ++p) sum += A[p * m + i] * B[j * k + p];
        C[j * m + i] += sum;
      }
    }
  }
}

/// C += A^T B, A m x k and B m x n.
template <int M, int K, int N>
void add_transposed_product(const double* A, const double* B, double* C, int m, int k, int n) {
  m = size_of<M>(m), k = size_of<K>(k), n = size_of<N>(n);
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < k; ++i) {
      double sum = 0.0;
      for (int p = 0; p < m; ++p) sum += A[i * m + p] * B[j * m + p];
      C[j * k + i] += sum;
    }
  }
}

/// Zeros, without the heap where the size is known.
template <int Size>
auto zeros(int size) {
  if constexpr (Size > 0)
    return std::array<double, static_cast<std::size_t>(Size)>{};
  else
    return std::vector<double>(at(size), 0.0);
}

/// Adds B at block (row, column) of the symmetric target, on whichever side of the diagonal it
/// lies. On the diagonal B stands for one half of the symmetric pair (B + B^T) unless it is
/// `whole`.
template <int R, int C>
void add_block(const DenseTarget& target, std::int64_t row, std::int64_t column, const double* B,
               int rows, int columns, bool whole) {
  rows = size_of<R>(rows), columns = size_of<C>(columns);
  if (row < column) {
    for (int i = 0; i < rows; ++i) {
      double* const to = target.column(row + i) + column;
      for (int j = 0; j < columns; ++j) to[j] += B[j * rows + i];
    }
    return;
  }
  for (int j = 0; j < columns; ++j) {
    double* const to = target.column(column + j) + row;
    for (int i = 0; i < rows; ++i) to[i] += B[j * rows + i];
    if (row == column && !whole) {
      for (int i = 0; i < rows; ++i) to[i] += B[i * rows + j];
    }
  }
}

/// One term: pointers into the scratch. r, y: dim; U = S g, M: dim x G; V = S D: dim x dim.
struct Term {
  double* r;
  double* y;
  double* U;
  double* M;
  double* V;
};

/// One block of the information: everything it contributes.
template <int G, int R, int C>
double add_information(const double* block, int rows, int columns, bool diagonal, const Term& s,
                       const Term& t, const DenseTarget* target, std::int64_t row,
                       std::int64_t column) {
  rows = size_of<R>(rows), columns = size_of<C>(columns);
  auto Ir = zeros<R>(rows);
  add_product<R, C, 1>(block, t.r, Ir.data(), rows, columns, 1);
  double sum = 0.0;
  for (int i = 0; i < rows; ++i) {
    s.y[i] += Ir[at(i)];
    sum += s.r[i] * Ir[at(i)];
  }
  if (!diagonal) {
    add_transposed_product<R, C, 1>(block, s.r, t.y, rows, columns, 1);
    sum *= 2.0;
  }
  if (target == nullptr) return sum;
  add_product<R, C, G>(block, t.U, s.M, rows, columns, G);
  if (!diagonal) add_transposed_product<R, C, G>(block, s.U, t.M, rows, columns, G);
  constexpr int kSize = R == Dynamic ? Dynamic : R * C;
  auto IV = zeros<kSize>(rows * columns);
  auto VIV = zeros<kSize>(rows * columns);
  add_product<R, C, C>(block, t.V, IV.data(), rows, columns, columns);
  add_transposed_product<R, R, C>(s.V, IV.data(), VIV.data(), rows, rows, columns);
  add_block<R, C>(*target, row, column, VIV.data(), rows, columns, diagonal);
  return sum;
}

/// Poses and points have sizes the compiler may know (2 and 3 in the plane, 3 and 6 in space);
/// other types do not.
template <int G>
constexpr int kPoseSize = G;
template <int G>
constexpr int kPointSize = G == 3 ? 2 : 3;

template <int G, int R, class... Args>
double by_columns(int columns, Args&&... args) {
  if (columns == kPoseSize<G>) return add_information<G, R, kPoseSize<G>>(args...);
  if (columns == kPointSize<G>) return add_information<G, R, kPointSize<G>>(args...);
  return add_information<G, Dynamic, Dynamic>(args...);
}
template <int G, class... Args>
double by_size(int rows, int columns, Args&&... args) {
  if (rows == kPoseSize<G>) return by_columns<G, kPoseSize<G>>(columns, args...);
  if (rows == kPointSize<G>) return by_columns<G, kPointSize<G>>(columns, args...);
  return add_information<G, Dynamic, Dynamic>(args...);
}

/// Where the anchor's frame is, and K = C^-1 P D: how its tangents turn it. K is the identity for a
/// pose.
template <int D>
struct AnchorState {
  Rigid<D> into;
  bool identity = false;
  Eigen::MatrixXd K;
};

template <int D>
AnchorState<D> anchor_state(const MeasurementGraph<D>& graph, std::size_t observation,
                            const double* const* values) {
  constexpr int G = kGauge<D>;
  const auto& maps = graph.submaps;
  const AnchorKind<D>& kind = *maps.anchors[observation];
  const std::int64_t first = maps.anchor_start[observation];
  const std::int64_t count = maps.anchor_start[observation + 1] - first;
  std::vector<Key> keys;
  for (std::int64_t a = 0; a < count; ++a)
    keys.push_back(graph.variables.key(maps.anchor_variables[at(first + a)]));
  AnchorState<D> state;
  state.into = kind.frame(values, keys.data());
  if (kind.tag == Tag("pose")) {
    state.identity = true;
    return state;
  }
  std::vector<std::vector<double>> moved;
  std::vector<const double*> pointers;
  Eigen::MatrixXd g(kind.tangent, G);
  Eigen::MatrixXd change = Eigen::MatrixXd::Zero(kind.tangent, kind.tangent);
  int row = 0;
  for (std::int64_t a = 0; a < count; ++a) {
    const VariableKind<D>& type = graph.variables.kind(maps.anchor_variables[at(first + a)]);
    moved.emplace_back(values[a], values[a] + type.value_size);
    Eigen::MatrixXd J(type.dim, type.dim), rows(type.dim, G);
    type.frame_jacobian(state.into, moved.back().data(), 1, J.data());
    type.transform(state.into, moved.back().data(), 1);
    type.gauge(moved.back().data(), 1, rows.data());
    for (int c = 0; c < G; ++c) {
      for (int r = 0; r < type.dim; ++r) g(row + r, c) = rows(r, c);
    }
    for (int c = 0; c < type.dim; ++c) {
      for (int r = 0; r < type.dim; ++r) change(row + r, row + c) = J(r, c);
    }
    row += type.dim;
  }
  for (const auto& x : moved) pointers.push_back(x.data());
  Eigen::MatrixXd P(G, kind.tangent);
  kind.rows(pointers.data(), P.data());
  state.K = times(solve_regular(times(P, g), P), change);
  return state;
}

}  // namespace

template <int D>
double linearize_submap(const MeasurementGraph<D>& graph, std::size_t observation,
                        const double* const* values, std::span<const std::int32_t> rows,
                        const DenseTarget* target, SubmapScratch& scratch) {
  constexpr int G = kGauge<D>;
  const auto& maps = graph.submaps;
  const VariableSet<D>& all = graph.variables;
  const std::int64_t first_anchor = maps.anchor_start[observation];
  const auto anchors = static_cast<int>(maps.anchor_start[observation + 1] - first_anchor);
  const std::int64_t first_term = maps.term_start[observation];
  const auto terms = static_cast<int>(maps.term_start[observation + 1] - first_term);
  const AnchorState<D> anchor = anchor_state(graph, observation, values);

  // Lay out the terms: their scalars, and which variable of the clique each is (terms are sorted by
  // variable).
  scratch.first.assign(1, 0);
  scratch.position.clear();
  int next = anchors;
  int largest = 0;
  std::int64_t squares = 0;
  for (int t = 0; t < terms; ++t) {
    const std::int32_t v = maps.term_variable[at(first_term + t)];
    int position = -1;
    for (int a = 0; a < anchors; ++a) {
      if (maps.anchor_variables[at(first_anchor + a)] == v) position = a;
    }
    if (position < 0) {
      const bool repeated = t > 0 && maps.term_variable[at(first_term + t - 1)] == v;
      position = repeated ? scratch.position.back() : next++;
    }
    scratch.position.push_back(position);
    const VariableKind<D>& kind = all.kind(v);
    largest = std::max(largest, kind.value_size);
    squares += kind.dim * kind.dim;
    scratch.first.push_back(scratch.first.back() + kind.dim);
  }
  const int n = scratch.first.back();
  const std::int64_t total = n * (2 + 2 * G) + squares + 2 * 36 + largest + 512;
  scratch.numbers.assign(at(total), 0.0);
  double* const r = scratch.numbers.data();
  double* const y = r + n;
  double* const U = y + n;
  double* const M = U + static_cast<std::ptrdiff_t>(n) * G;
  double* V = M + static_cast<std::ptrdiff_t>(n) * G;
  double* const moved = V + squares;
  std::vector<Term> views;
  views.reserve(at(terms));
  std::vector<double> S, J, g;
  for (int t = 0; t < terms; ++t) {
    const VariableKind<D>& kind = all.kind(maps.term_variable[at(first_term + t)]);
    const int f = scratch.first[at(t)];
    const double* const z = maps.values.data() + maps.term_value[at(first_term + t)];
    const double* const x = values[scratch.position[at(t)]];
    std::memcpy(moved, x, at(kind.value_size) * sizeof(double));
    kind.transform(anchor.into, moved, 1);
    kind.local(z, moved, 1, r + f);
    views.push_back({r + f, y + f, U + static_cast<std::ptrdiff_t>(f) * G,
                     M + static_cast<std::ptrdiff_t>(f) * G, V});
    if (target != nullptr) {
      const int dim = kind.dim;
      S.resize(at(dim * dim));
      J.resize(at(dim * dim));
      g.resize(at(dim * G));
      kind.local_jacobian(z, moved, 1, S.data());
      kind.gauge(moved, 1, g.data());
      add_product<Dynamic, Dynamic, G>(S.data(), g.data(), views.back().U, dim, dim, G);
      kind.frame_jacobian(anchor.into, x, 1, J.data());
      add_product<Dynamic, Dynamic, Dynamic>(S.data(), J.data(), V, dim, dim, dim);
    }
    V += kind.dim * kind.dim;
  }

  const auto row_of = [&](int t) -> std::int64_t {
    return target == nullptr ? 0 : rows[at(scratch.position[at(t)])];
  };
  const auto dim_of = [&](int t) { return scratch.first[at(t) + 1] - scratch.first[at(t)]; };
  double sum = 0.0;
  for (std::int64_t b = maps.block_start[observation]; b < maps.block_start[observation + 1]; ++b) {
    const int s = maps.block_row[at(b)];
    const int t = maps.block_column[at(b)];
    sum += by_size<G>(dim_of(s), dim_of(t), maps.information.data() + maps.block_value[at(b)],
                      dim_of(s), dim_of(t), s == t, views[at(s)], views[at(t)], target, row_of(s),
                      row_of(t));
  }
  if (target == nullptr) return sum;

  Eigen::MatrixXd around = Eigen::MatrixXd::Zero(G, G);
  std::array<double, G> turn{};
  std::vector<double> down, towards, part;
  for (int t = 0; t < terms; ++t) {
    const int dim = dim_of(t);
    const Term& term = views[at(t)];
    add_transposed_product<Dynamic, G, G>(term.U, term.M, around.data(), dim, G, G);
    add_transposed_product<Dynamic, G, 1>(term.U, term.y, turn.data(), dim, G, 1);
    down.assign(at(dim), 0.0);
    add_transposed_product<Dynamic, Dynamic, 1>(term.V, term.y, down.data(), dim, dim, 1);
    for (int i = 0; i < dim; ++i) target->rhs(row_of(t) + i) -= down[at(i)];
    towards.assign(at(dim * G), 0.0);
    add_transposed_product<Dynamic, Dynamic, G>(term.V, term.M, towards.data(), dim, dim, G);
    for (double& x : towards) x = -x;
    if (anchor.identity) {
      add_block<Dynamic, G>(*target, row_of(t), rows[0], towards.data(), dim, G, false);
      continue;
    }
    const double* K = anchor.K.data();
    for (int a = 0; a < anchors; ++a) {
      const int width = all.dim(maps.anchor_variables[at(first_anchor + a)]);
      part.assign(at(dim * width), 0.0);
      add_product<Dynamic, G, Dynamic>(towards.data(), K, part.data(), dim, G, width);
      add_block<Dynamic, Dynamic>(*target, row_of(t), rows[at(a)], part.data(), dim, width, false);
      K += width * G;
    }
  }
  if (anchor.identity) {
    add_block<G, G>(*target, rows[0], rows[0], around.data(), G, G, true);
    for (int i = 0; i < G; ++i) target->rhs(rows[0] + i) += turn[at(i)];
    return sum;
  }
  const Eigen::MatrixXd KAK = carried(anchor.K.transpose(), around);
  int column = 0;
  for (int a = 0; a < anchors; ++a) {
    const int width = all.dim(maps.anchor_variables[at(first_anchor + a)]);
    part.assign(at(width), 0.0);
    add_transposed_product<G, Dynamic, 1>(anchor.K.data() + column * G, turn.data(), part.data(), G,
                                          width, 1);
    for (int i = 0; i < width; ++i) target->rhs(rows[at(a)] + i) += part[at(i)];
    int other = 0;
    for (int b = 0; b <= a; ++b) {
      const int depth = all.dim(maps.anchor_variables[at(first_anchor + b)]);
      const Eigen::MatrixXd block = KAK.block(column, other, width, depth);
      add_block<Dynamic, Dynamic>(*target, rows[at(a)], rows[at(b)], block.data(), width, depth,
                                  true);
      other += depth;
    }
    column += width;
  }
  return sum;
}

template double linearize_submap<2>(const MeasurementGraph<2>&, std::size_t, const double* const*,
                                    std::span<const std::int32_t>, const DenseTarget*,
                                    SubmapScratch&);
template double linearize_submap<3>(const MeasurementGraph<3>&, std::size_t, const double* const*,
                                    std::span<const std::int32_t>, const DenseTarget*,
                                    SubmapScratch&);

}  // namespace mapjoin
