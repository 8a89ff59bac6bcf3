#include "mapjoin/solvers/submap_kernel.h"

#include <Eigen/LU>

#include <algorithm>
#include <cstring>

#include "mapjoin/graph/index.h"

namespace mapjoin {

namespace {

using Eigen::Dynamic;
template <int R, int C>
using Matrix = Eigen::Matrix<double, R, C>;
template <int R, int C>
using View = Eigen::Map<Matrix<R, C>>;
template <int R, int C>
using ConstView = Eigen::Map<const Matrix<R, C>>;

/// Adds B at block (row, column) of the symmetric target, on whichever side of the diagonal it
/// lies. On the diagonal B stands for one half of the symmetric pair (B + B^T) unless it is
/// `whole`.
template <class Derived>
void add_block(const DenseTarget& target, std::int64_t row, std::int64_t column,
               const Eigen::MatrixBase<Derived>& B, bool whole) {
  if (row < column) {
    for (Eigen::Index i = 0; i < B.rows(); ++i) {
      double* const to = target.column(row + i) + column;
      for (Eigen::Index j = 0; j < B.cols(); ++j) to[j] += B(i, j);
    }
    return;
  }
  for (Eigen::Index j = 0; j < B.cols(); ++j) {
    double* const to = target.column(column + j) + row;
    for (Eigen::Index i = 0; i < B.rows(); ++i) to[i] += B(i, j);
    if (row == column && !whole) {
      for (Eigen::Index i = 0; i < B.rows(); ++i) to[i] += B(j, i);
    }
  }
}

template <class Derived>
void add_rhs(const DenseTarget& target, std::int64_t row, const Eigen::MatrixBase<Derived>& b) {
  for (Eigen::Index i = 0; i < b.size(); ++i) target.rhs(row + i) += b(i);
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
  const ConstView<R, C> I(block, rows, columns);
  const Matrix<R, 1> Ir = I * ConstView<C, 1>(t.r, columns, 1);
  View<R, 1>(s.y, rows, 1) += Ir;
  double sum = ConstView<R, 1>(s.r, rows, 1).dot(Ir);
  if (!diagonal) {
    View<C, 1>(t.y, columns, 1).noalias() += I.transpose() * ConstView<R, 1>(s.r, rows, 1);
    sum *= 2.0;
  }
  if (target == nullptr) return sum;
  View<R, G>(s.M, rows, G).noalias() += I * ConstView<C, G>(t.U, columns, G);
  if (!diagonal)
    View<C, G>(t.M, columns, G).noalias() += I.transpose() * ConstView<R, G>(s.U, rows, G);
  const Matrix<R, C> IV = I * ConstView<C, C>(t.V, columns, columns);
  add_block(*target, row, column, (ConstView<R, R>(s.V, rows, rows).transpose() * IV).eval(),
            diagonal);
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
    g.middleRows(row, type.dim) = rows;
    change.block(row, row, type.dim, type.dim) = J;
    row += type.dim;
  }
  for (const auto& x : moved) pointers.push_back(x.data());
  Eigen::MatrixXd P(G, kind.tangent);
  kind.rows(pointers.data(), P.data());
  state.K = (P * g).fullPivLu().solve(P) * change;
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
  Eigen::MatrixXd S, J;  // small
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
      S.resize(kind.dim, kind.dim);
      J.resize(kind.dim, kind.dim);
      kind.local_jacobian(z, moved, 1, S.data());
      Eigen::Map<Eigen::MatrixXd> g(views.back().U, kind.dim, G);
      kind.gauge(moved, 1, views.back().U);
      g = (S * g).eval();
      kind.frame_jacobian(anchor.into, x, 1, J.data());
      Eigen::Map<Eigen::MatrixXd>(V, kind.dim, kind.dim).noalias() = S * J;
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

  Matrix<G, G> around = Matrix<G, G>::Zero();
  Matrix<G, 1> turn = Matrix<G, 1>::Zero();
  for (int t = 0; t < terms; ++t) {
    const int dim = dim_of(t);
    const Term& term = views[at(t)];
    const ConstView<Dynamic, G> Ut(term.U, dim, G), Mt(term.M, dim, G);
    const ConstView<Dynamic, Dynamic> Vt(term.V, dim, dim);
    const ConstView<Dynamic, 1> yt(term.y, dim, 1);
    around.noalias() += Ut.transpose() * Mt;
    turn.noalias() += Ut.transpose() * yt;
    add_rhs(*target, row_of(t), (-(Vt.transpose() * yt)).eval());
    const Matrix<Dynamic, G> towards = -(Vt.transpose() * Mt);
    if (anchor.identity) {
      add_block(*target, row_of(t), rows[0], towards, false);
      continue;
    }
    int column = 0;
    for (int a = 0; a < anchors; ++a) {
      const int width = all.dim(maps.anchor_variables[at(first_anchor + a)]);
      add_block(*target, row_of(t), rows[at(a)],
                (towards * anchor.K.middleCols(column, width)).eval(), false);
      column += width;
    }
  }
  if (anchor.identity) {
    add_block(*target, rows[0], rows[0], around, true);
    add_rhs(*target, rows[0], turn);
    return sum;
  }
  const Eigen::MatrixXd KAK = anchor.K.transpose() * around * anchor.K;
  const Eigen::VectorXd Kturn = anchor.K.transpose() * turn;
  int column = 0;
  for (int a = 0; a < anchors; ++a) {
    const int width = all.dim(maps.anchor_variables[at(first_anchor + a)]);
    add_rhs(*target, rows[at(a)], Kturn.segment(column, width));
    int other = 0;
    for (int b = 0; b <= a; ++b) {
      const int depth = all.dim(maps.anchor_variables[at(first_anchor + b)]);
      add_block(*target, rows[at(a)], rows[at(b)], KAK.block(column, other, width, depth).eval(),
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
