#include "mapjoin/solvers/covariance.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include "mapjoin/frames/exact_gauge.h"
#include "mapjoin/frames/gauge.h"
#include "mapjoin/graph/dense.h"
#include "mapjoin/graph/index.h"
#include "mapjoin/graph/piece.h"
#include "mapjoin/solvers/block_system.h"
#include "mapjoin/solvers/gauge_scalars.h"
#include "mapjoin/solvers/selected_inverse.h"

namespace mapjoin {

namespace {

constexpr int kColumnsAtOnce = 48;  // right-hand sides of one solve

/// Scalars that fix the gauge, where any will do: a pose, else the most independent ones.
template <int D>
std::vector<int> some_gauge_scalars(const Values<D>& values) {
  const VariableSet<D>& variables = values.variables();
  const Piece<D> piece = to_piece(variables, values);
  std::vector<int> out;
  for (const PieceScalar& s : gauge_scalars(variables, piece, lowest_pose(variables, piece)))
    out.push_back(variables.offset(s.variable) + s.scalar);
  return out;
}

/// The matrix with unit rows and columns at the held scalars: its inverse is that of the rest, and
/// the two do not mix.
void hold(SymmetricBlockMatrix& matrix, const std::vector<char>& held) {
  std::vector<int> scalars;
  for (std::size_t s = 0; s < held.size(); ++s) {
    if (held[s] != 0) scalars.push_back(static_cast<int>(s));
  }
  leave_out(matrix, scalars);
  int variable = 0;
  for (const int s : scalars) {
    while (s >= matrix.offset(variable + 1)) ++variable;
    const int k = s - matrix.offset(variable);
    matrix.block(matrix.begin(variable))[k * (matrix.dim(variable) + 1)] = 1.0;
  }
}

}  // namespace

template <int D>
struct Covariance<D>::State {
  VariableSet<D> variables;
  std::vector<int> offsets;
  std::vector<char> held;    ///< per scalar: left out of the factor
  std::vector<char> pinned;  ///< per scalar: by the map's anchor, exactly certain
  BlockCliques cliques;
  FrontalStructure structure;
  FrontalCholesky factor;

  // J of the map's anchor, where it is not what is held: E - g K, K with columns at `scalars`.
  bool projects = false;
  Eigen::MatrixXd g;
  std::vector<int> scalars;
  Eigen::MatrixXd K;

  explicit State(const Map<D>& given);
  void choose_frame(const Map<D>& map);
  void factorize(SymmetricBlockMatrix information);
  int dim(int i) const { return offsets[at(i) + 1] - offsets[at(i)]; }
  /// B = Sigma B in the frame of what is held.
  void apply(Eigen::MatrixXd& B) const {
    clear_held(B);
    factor.solve_in_place(B);
    clear_held(B);
  }
  void clear_held(Eigen::MatrixXd& B) const {
    for (std::size_t s = 0; s < held.size(); ++s) {
      for (Eigen::Index c = 0; held[s] != 0 && c < B.cols(); ++c)
        B(static_cast<Eigen::Index>(s), c) = 0.0;
    }
  }
  /// K B.
  Eigen::MatrixXd anchored(const Eigen::MatrixXd& B) const {
    Eigen::MatrixXd out = Eigen::MatrixXd::Zero(K.rows(), B.cols());
    for (Eigen::Index c = 0; c < B.cols(); ++c) {
      for (std::size_t k = 0; k < scalars.size(); ++k) {
        const double b = B(scalars[k], c);
        for (Eigen::Index r = 0; r < K.rows(); ++r)
          out(r, c) += K(r, static_cast<Eigen::Index>(k)) * b;
      }
    }
    return out;
  }
  void project(CovarianceBlocks& out) const;
  /// Zero rows and columns where `certain` says so.
  void clear(CovarianceBlocks& out, const std::vector<char>& certain) const;
};

template <int D>
Covariance<D>::State::State(const Map<D>& given) {
  if (given.anchor.kind == nullptr)
    throw InputError(
        "the map has no anchor, so nothing says what its covariance would be relative to; write it "
        "in a frame with change_frame, or ask for relative quantities");
  require_information(given);
  variables = given.variables();
  offsets = given.information.offsets();
  const bool pose = given.solved_in.kind == &pose_anchor_kind<D>();
  if (pose || given.solved_in.kind == nullptr || given.solved_in == given.anchor) {
    choose_frame(given);
    factorize(given.information);
  } else {  // what a feature anchor pinned is not pinned scalars in this frame
    const Map<D> map = exactly_gauge_free(given);
    choose_frame(map);
    factorize(map.information);
  }
}

template <int D>
void Covariance<D>::State::choose_frame(const Map<D>& map) {
  const AnchorRows rows = anchor_rows(map.anchor, map.values);
  const bool here = map.solved_in.kind == nullptr || map.solved_in == map.anchor;
  const std::vector<int> chosen = !here ? anchor_rows(map.solved_in, map.values).pinned
                                  : !rows.pinned.empty() ? rows.pinned
                                                         : some_gauge_scalars(map.values);
  held.assign(at(offsets.back()), 0);
  for (const int s : chosen) held[at(s)] = 1;
  pinned.assign(held.size(), 0);
  for (const int s : rows.pinned) pinned[at(s)] = 1;
  projects = chosen != rows.pinned;
  if (!projects) return;
  g = map.values.gauge();
  scalars = rows.scalars;
  K = solve_regular(rows.C, rows.P);
}

template <int D>
void Covariance<D>::State::factorize(SymmetricBlockMatrix information) {
  hold(information, held);
  // A variable that is held altogether has no part in the order: a pose that sees everything would
  // couple it.
  std::vector<char> fixed(at(variables.size()), 0);
  for (std::size_t i = 0; i < fixed.size(); ++i)
    fixed[i] = std::all_of(held.begin() + offsets[i], held.begin() + offsets[i + 1],
                           [](char h) { return h != 0; });
  cliques = block_cliques(information, [&](int i, int j) {
    return i == j || (fixed[at(i)] == 0 && fixed[at(j)] == 0);
  });
  structure = analyze(cliques.dims, cliques.view(), order_blocks(cliques.dims, cliques.view()));
  const FactorStatus status = factor.factorize(structure, [&](std::int32_t f, const FrontView& v) {
    assemble_blocks(information, cliques, structure, f, v);
  });
  if (!status.ok())
    throw SingularError(fmt::format(
        "the map's information does not determine {} relative to its anchor: its covariance is "
        "infinite; leave it out, or add measurements that fix it",
        to_string(variables.key(status.failed_variable))));
  cliques = {};
}

// J Sigma J^T = Sigma - g Y^T - Y g^T + g (K Y) g^T with Y = Sigma K^T.
template <int D>
void Covariance<D>::State::project(CovarianceBlocks& out) const {
  constexpr int G = kGauge<D>;
  Eigen::MatrixXd Y = Eigen::MatrixXd::Zero(offsets.back(), G);
  for (std::size_t k = 0; k < scalars.size(); ++k) {
    for (int c = 0; c < G; ++c) Y(scalars[k], c) = K(c, static_cast<Eigen::Index>(k));
  }
  apply(Y);
  const Eigen::MatrixXd M = anchored(Y);
  std::vector<double> half;  // (Y - g M / 2) g^T
  for (std::size_t k = 0; k < out.size(); ++k) {
    const int row = offsets[at(out.variables[k])];
    const int n = out.dims[k];
    half.assign(at(n * n), 0.0);
    for (int r = 0; r < n; ++r) {
      for (int c = 0; c < G; ++c) {
        double gM = 0.0;
        for (int p = 0; p < G; ++p) gM += g(row + r, p) * M(p, c);
        const double left = Y(row + r, c) - 0.5 * gM;
        for (int s = 0; s < n; ++s) half[at(s * n + r)] += left * g(row + s, c);
      }
    }
    double* const block = out.values.data() + out.start[k];
    for (int c = 0; c < n; ++c) {
      for (int r = 0; r < n; ++r) block[c * n + r] -= half[at(c * n + r)] + half[at(r * n + c)];
    }
  }
}

template <int D>
void Covariance<D>::State::clear(CovarianceBlocks& out, const std::vector<char>& certain) const {
  for (std::size_t k = 0; k < out.size(); ++k) {
    const int n = out.dims[k];
    double* const block = out.values.data() + out.start[k];
    for (int r = 0; r < n; ++r) {
      if (certain[at(offsets[at(out.variables[k])] + r)] == 0) continue;
      for (int c = 0; c < n; ++c) block[r + c * n] = block[c + r * n] = 0.0;
    }
  }
}

template <int D>
Covariance<D>::Covariance(const Map<D>& map) : state_(std::make_unique<State>(map)) {}
template <int D>
Covariance<D>::~Covariance() = default;
template <int D>
Covariance<D>::Covariance(Covariance&&) noexcept = default;
template <int D>
Covariance<D>& Covariance<D>::operator=(Covariance&&) noexcept = default;

template <int D>
const VariableSet<D>& Covariance<D>::variables() const {
  return state_->variables;
}

template <int D>
CovarianceBlocks Covariance<D>::blocks() const {
  std::vector<int> all(at(state_->variables.size()));
  std::iota(all.begin(), all.end(), 0);
  return blocks(all);
}

template <int D>
CovarianceBlocks Covariance<D>::blocks(std::span<const int> wanted) const {
  const State& s = *state_;
  CovarianceBlocks out;
  out.variables.assign(wanted.begin(), wanted.end());
  out.start.push_back(0);
  for (const int i : wanted) {
    out.dims.push_back(s.dim(i));
    out.start.push_back(out.start.back() + s.dim(i) * s.dim(i));
  }
  out.values.resize(at(out.start.back()));
  std::vector<std::int64_t> place(at(s.variables.size()), -1);
  for (std::size_t k = 0; k < wanted.size(); ++k) place[at(wanted[k])] = out.start[k];
  selected_inverse(s.factor, place, out.values.data());
  for (std::size_t k = 0; k < wanted.size(); ++k) {
    const std::int64_t first = place[at(wanted[k])];  // another one where it is asked for twice
    if (first != out.start[k])
      std::copy_n(out.values.data() + first, out.dims[k] * out.dims[k],
                  out.values.data() + out.start[k]);
  }
  s.clear(out, s.held);
  if (s.projects) {
    s.project(out);
    s.clear(out, s.pinned);
  }
  return out;
}

template <int D>
Eigen::MatrixXd Covariance<D>::between(std::span<const int> rows,
                                       std::span<const int> columns) const {
  const State& s = *state_;
  const auto count = [&](std::span<const int> list) {
    int n = 0;
    for (const int i : list) n += s.dim(i);
    return n;
  };
  Eigen::MatrixXd out(count(rows), count(columns));
  std::vector<std::pair<int, int>> scalar;  // of `columns`: (variable, scalar of its tangent)
  for (const int j : columns) {
    for (int c = 0; c < s.dim(j); ++c) scalar.emplace_back(j, c);
  }
  for (std::size_t first = 0; first < scalar.size(); first += at(kColumnsAtOnce)) {
    const auto width =
        static_cast<Eigen::Index>(std::min(at(kColumnsAtOnce), scalar.size() - first));
    // Sigma J^T times unit columns; then J from the left, in the rows asked for.
    Eigen::MatrixXd B = Eigen::MatrixXd::Zero(s.offsets.back(), width);
    for (Eigen::Index c = 0; c < width; ++c) {
      const auto [j, k] = scalar[first + at(c)];
      if (s.pinned[at(s.offsets[at(j)] + k)] != 0) continue;
      B(s.offsets[at(j)] + k, c) = 1.0;
      for (std::size_t r = 0; r < s.scalars.size(); ++r) {
        double Kg = 0.0;
        for (int p = 0; p < kGauge<D>; ++p)
          Kg += s.K(p, static_cast<Eigen::Index>(r)) * s.g(s.offsets[at(j)] + k, p);
        B(s.scalars[r], c) -= Kg;
      }
    }
    s.apply(B);
    const Eigen::MatrixXd shift = s.anchored(B);
    Eigen::Index row = 0;
    for (const int i : rows) {
      for (int there = s.offsets[at(i)]; there < s.offsets[at(i) + 1]; ++there, ++row) {
        for (Eigen::Index c = 0; c < width; ++c) {
          double gs = 0.0;
          for (int p = 0; s.projects && p < kGauge<D>; ++p) gs += s.g(there, p) * shift(p, c);
          out(row, static_cast<Eigen::Index>(first) + c) =
              s.pinned[at(there)] != 0 ? 0.0 : B(there, c) - gs;
        }
      }
    }
  }
  return out;
}

template <int D>
Eigen::MatrixXd Covariance<D>::of(std::span<const Key> keys) const {
  std::vector<int> numbers;
  for (const Key& key : keys) numbers.push_back(state_->variables.require(key, "covariance"));
  return symmetric_part(between(numbers, numbers));
}

template <int D>
Eigen::MatrixXd Covariance<D>::block(const Key& a, const Key& b) const {
  if (a == b) return of(std::span(&a, 1));
  const int i = state_->variables.require(a, "covariance");
  const int j = state_->variables.require(b, "covariance");
  return between(std::span(&i, 1), std::span(&j, 1));
}

template class Covariance<2>;
template class Covariance<3>;

}  // namespace mapjoin
