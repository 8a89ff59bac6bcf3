#include "mapjoin/filtering/information_filter.h"

#include <fmt/format.h>
#include <Eigen/IterativeLinearSolvers>

#include <algorithm>
#include <chrono>
#include <numeric>
#include <utility>

#include "mapjoin/filtering/reordering.h"
#include "mapjoin/frames/anchors.h"
#include "mapjoin/frames/gauge.h"
#include "mapjoin/graph/dense.h"
#include "mapjoin/graph/index.h"

namespace mapjoin {

namespace {

/// Bounds of the rule for n0: measured, see docs/decisions.md.
constexpr int kLeastN0 = 200, kMostN0 = 400, kMapsInBottom = 5;
/// Of conjugate gradients, relative to i: where the estimate has settled to rounding.
constexpr double kResidual = 1e-12;

/// Adds the seconds since its making to a figure.
class Timer {
 public:
  explicit Timer(double& to) : to_(to) {}
  ~Timer() {
    to_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }
  Timer(const Timer&) = delete;
  Timer& operator=(const Timer&) = delete;

 private:
  double& to_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace

template <int D>
InformationFilter<D>::InformationFilter(const FilterOptions& options) : options_(options) {
  if (options.n0 < 0 || options.d0 < 0.0 || options.reorder_every < 1 ||
      options.relinearise_every < 0)
    throw InputError(
        "filter options: n0, d0 and relinearise_every must not be negative, and "
        "reorder_every must be at least 1");
}

template <int D>
void InformationFilter<D>::start(const Values<D>& values, const Anchor<D>& anchor) {
  const AnchorRows rows = anchor_rows(anchor, values);
  if (rows.pinned.empty())
    throw InputError(fmt::format(
        "a filter needs a frame that fixes single coordinates, which {} does not; begin with a map "
        "in the frame of a pose, or of points",
        to_string(anchor)));
  anchor_ = anchor;
  for (int i = 0; i < values.size(); ++i)
    add_variable(values.variables().kind(i), values.variables().key(i), values.value(i));
  for (const int s : rows.pinned) held_[at(s)] = 1;  // same order: a set of values, from the first
  held_count_ = static_cast<int>(rows.pinned.size());
  add_stiffness_of_held();
}

template <int D>
int InformationFilter<D>::add_variable(const VariableKind<D>& kind, const Key& key,
                                       const double* x) {
  sum_.add_variable(kind.dim);
  held_.resize(held_.size() + at(kind.dim), 0);
  return state_.add(kind, key, x);
}

template <int D>
bool InformationFilter<D>::held_whole(int variable) const {
  for (int s = 0; s < state_.dim(variable); ++s) {
    if (!is_held(state_.offset(variable) + s)) return false;
  }
  return true;
}

/// What is pinned keeps d = 0: a diagonal of its own, and nothing else in its rows.
template <int D>
void InformationFilter<D>::add_stiffness_of_held() {
  for (std::int32_t i = 0; i < state_.size(); ++i) {
    const int n = state_.dim(i);
    Eigen::MatrixXd unit = Eigen::MatrixXd::Zero(n, n);
    for (int s = 0; s < n; ++s) unit(s, s) = is_held(state_.offset(i) + s) ? 1.0 : 0.0;
    if (unit.isZero(0.0)) continue;
    sum_.add_clique({&i, 1}, unit, Eigen::VectorXd::Zero(n));
  }
}

template <int D>
void InformationFilter<D>::add_information(std::span<const std::int32_t> variables,
                                           Eigen::MatrixXd lower, Eigen::VectorXd vector) {
  const Eigen::Index n = vector.size();
  Eigen::MatrixXd H = lower.selfadjointView<Eigen::Lower>();
  // From tangents at the estimates to increments: d = S^-1 times the tangent ... H := S^-T H S^-1.
  Eigen::VectorXd x(n);
  Eigen::Index row = 0;
  for (const std::int32_t i : variables) {
    const Eigen::Index dim = state_.dim(i);
    const Eigen::MatrixXd S = state_.chart(i);
    if (!S.isIdentity(0.0)) {
      const Eigen::MatrixXd back = inverse_of(S), turned = back.transpose();
      H.middleRows(row, dim) = times(turned, H.middleRows(row, dim));
      H.middleCols(row, dim) = times(H.middleCols(row, dim), back);
      vector.segment(row, dim) = Eigen::VectorXd(times(turned, vector.segment(row, dim)));
    }
    x.segment(row, dim) = state_.increments().segment(state_.offset(i), dim);
    row += dim;
  }
  vector += Eigen::VectorXd(times(H, x));  // (8): i += H^T R^-1 (z - h(x) + H x)
  std::vector<std::int32_t> free;
  std::vector<int> rows;
  row = 0;
  for (const std::int32_t i : variables) {
    const int offset = state_.offset(i), dim = state_.dim(i);
    if (!held_whole(i)) {
      free.push_back(i);
      for (int s = 0; s < dim; ++s) rows.push_back(static_cast<int>(row) + s);
    }
    for (int s = 0; s < dim; ++s) {
      if (!is_held(offset + s)) continue;
      for (Eigen::Index k = 0; k < n; ++k) H(row + s, k) = H(k, row + s) = 0.0;
      vector(row + s) = 0.0;
    }
    row += dim;
  }
  Eigen::VectorXd of_free(static_cast<Eigen::Index>(rows.size()));
  for (std::size_t k = 0; k < rows.size(); ++k)
    of_free(static_cast<Eigen::Index>(k)) = vector(rows[k]);
  sum_.add_clique(free, picked(H, rows), of_free);
}

template <int D>
int InformationFilter<D>::rule_n0(std::span<const std::int32_t> clique) const {
  if (options_.n0 > 0) return options_.n0;
  int scalars = 0;
  for (const std::int32_t i : clique) scalars += state_.dim(i);
  const int least = std::max(kLeastN0, kMapsInBottom * scalars);
  return std::max(least, std::min(kMostN0, state_.scalars() / 10));
}

/// Is the order to be changed? When a variable of the local map is not among the lowest n0 scalars;
/// and when the bottom, which is dense, has grown to twice of that.
template <int D>
bool InformationFilter<D>::must_reorder(std::int64_t clique, int n0) const {
  if (factor_.bottom_scalars() > 2 * n0) return true;
  int arriving = 0;
  for (int i = factored_variables_; i < state_.size(); ++i) arriving += state_.dim(i);
  for (const std::int32_t i : sum_.clique(clique)) {
    if (i >= factored_variables_) continue;
    if (!factor_.in_bottom(i) || factor_.height(i) + arriving > n0) return true;
  }
  return false;
}

template <int D>
bool InformationFilter<D>::order(int focus, Fusion& fusion) {
  const std::int64_t last = sum_.cliques() - 1;
  if (options_.ordering == FilterOrdering::kMinimumDegree) {
    fusion.reordered = factored_cliques_ == 0 || fusions_ % options_.reorder_every == 0;
    for (int i = factored_variables_; i < state_.size(); ++i) top_.push_back(i);
    if (fusion.reordered) top_ = minimum_degree_order(sum_);
    bottom_.clear();
    return true;
  }
  const int n0 = rule_n0(sum_.clique(last));
  fusion.reordered = factored_cliques_ != last || must_reorder(last, n0);
  if (!fusion.reordered) {
    for (int i = factored_variables_; i < state_.size(); ++i) bottom_.push_back(i);
    return !options_.incremental;
  }
  BottomOrder combined = combined_order(state_, sum_, focus, n0, options_.d0);
  top_ = std::move(combined.top);
  bottom_ = std::move(combined.bottom);
  return true;
}

template <int D>
void InformationFilter<D>::require_determined(int variable) const {
  if (variable < 0) return;
  throw SingularError(fmt::format(
      "the local maps fused so far do not determine {}; add a measurement of it or leave it out",
      to_string(state_.key(variable))));
}

template <int D>
void InformationFilter<D>::set_estimate(const Eigen::VectorXd& d) {
  if (!d.allFinite()) require_determined(state_.size() - 1);
  state_.set_increments(d);
}

template <int D>
void InformationFilter<D>::update(int focus, Fusion& fusion) {
  fusion.scalars = free_scalars();
  bool whole = true;
  if (options_.recovery == FilterRecovery::kConjugateGradients) {
    const Timer timer(fusion.seconds_recover);
    const Eigen::SparseMatrix<double> I = information();
    Eigen::ConjugateGradient<Eigen::SparseMatrix<double>, Eigen::Lower,
                             Eigen::IncompleteCholesky<double>>
        solver(I);
    solver.setTolerance(kResidual);
    set_estimate(solver.solveWithGuess(sum_.information_vector(), state_.increments()));
    fusion.iterations = static_cast<int>(solver.iterations());
    if (solver.info() != Eigen::Success)
      throw SingularError(
          "conjugate gradients did not converge: the local maps fused so far "
          "determine the map too poorly; recover by Cholesky factorisation");
    factored_cliques_ = 0;
    return;
  }
  {
    const Timer timer(fusion.seconds_order);
    whole = order(focus < 0 ? state_.size() - 1 : focus, fusion);
  }
  {
    const Timer timer(fusion.seconds_factor);
    fusion.factored_whole = whole;
    const std::int64_t last = sum_.cliques() - 1;
    require_determined(whole ? factor_.refactor(sum_, top_, bottom_) : factor_.add(sum_, last));
    for (const std::int32_t i : sum_.clique(last))
      fusion.changed = std::max(fusion.changed, whole ? fusion.scalars : factor_.height(i));
  }
  factored_cliques_ = sum_.cliques();
  factored_variables_ = state_.size();
  ++fusions_;
  const Timer timer(fusion.seconds_recover);
  set_estimate(factor_.solution());
}

template <int D>
void InformationFilter<D>::relinearise(const std::function<void()>& add_all) {
  state_.rebase();
  sum_.clear();
  add_stiffness_of_held();
  add_all();
  factored_cliques_ = 0;
}

template <int D>
Eigen::MatrixXd InformationFilter<D>::covariance(std::span<const int> variables) {
  if (factored_cliques_ != sum_.cliques()) {  // the estimate was recovered without a factor
    top_ = minimum_degree_order(sum_);
    bottom_.clear();
    require_determined(factor_.refactor(sum_, top_, bottom_));
    factored_cliques_ = sum_.cliques();
    factored_variables_ = state_.size();
  }
  std::vector<int> scalars;
  for (const int i : variables) {
    for (int s = 0; s < state_.dim(i); ++s) scalars.push_back(state_.offset(i) + s);
  }
  const auto n = static_cast<Eigen::Index>(scalars.size());
  Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(state_.scalars(), n);
  for (Eigen::Index c = 0; c < n; ++c) {
    const int s = scalars[at(c)];
    if (!is_held(s)) columns(s, c) = 1.0;  // (5), (6)
  }
  factor_.solve_in_place(columns);
  Eigen::MatrixXd P(n, n);
  for (Eigen::Index c = 0; c < n; ++c) {
    for (Eigen::Index r = 0; r < n; ++r) P(r, c) = columns(scalars[at(r)], c);
  }
  P = symmetric_part(P);
  Eigen::Index row = 0;
  for (const int i : variables) {  // from increments to the tangent
    const Eigen::Index dim = state_.dim(i);
    const Eigen::MatrixXd turn = inverse_of(state_.chart(i));
    P.middleRows(row, dim) = times(turn, P.middleRows(row, dim));
    P.middleCols(row, dim) = times(P.middleCols(row, dim), turn.transpose());
    row += dim;
  }
  return P;
}

template <int D>
SymmetricBlockMatrix InformationFilter<D>::block_information(std::span<const int> order,
                                                             bool in_tangents) const {
  std::vector<int> offsets{0}, place(order.begin(), order.end());
  std::vector<int> dims(place.size());
  for (std::size_t i = 0; i < place.size(); ++i)
    dims[at(place[i])] = state_.dim(static_cast<int>(i));
  for (const int dim : dims) offsets.push_back(offsets.back() + dim);
  std::vector<std::pair<int, int>> pairs;
  for (std::int64_t k = 0; k < sum_.cliques(); ++k) {
    const auto clique = sum_.clique(k);
    for (std::size_t i = 0; i < clique.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j)
        pairs.emplace_back(place[at(clique[i])], place[at(clique[j])]);
    }
  }
  SymmetricBlockMatrix out(std::move(offsets), pairs);
  for (std::int64_t k = 0; k < sum_.cliques(); ++k) {
    const auto clique = sum_.clique(k);
    Eigen::MatrixXd H = sum_.matrix(k).selfadjointView<Eigen::Lower>();
    Eigen::Index row = 0;
    for (std::size_t i = 0; in_tangents && i < clique.size(); ++i) {
      const Eigen::Index dim = state_.dim(clique[i]);
      const Eigen::MatrixXd S = state_.chart(clique[i]);
      H.middleRows(row, dim) = times(S.transpose(), H.middleRows(row, dim));
      H.middleCols(row, dim) = times(H.middleCols(row, dim), S);
      row += dim;
    }
    row = 0;
    for (std::size_t i = 0; i < clique.size(); ++i) {
      Eigen::Index column = 0;
      for (std::size_t j = 0; j <= i; ++j) {
        const int di = state_.dim(clique[i]), dj = state_.dim(clique[j]);
        out.add(place[at(clique[i])], place[at(clique[j])], H.block(row, column, di, dj));
        column += dj;
      }
      row += state_.dim(clique[i]);
    }
  }
  return out;
}

template <int D>
Eigen::SparseMatrix<double> InformationFilter<D>::information() const {
  std::vector<int> order(at(state_.size()));
  std::iota(order.begin(), order.end(), 0);
  return block_information(order, false).lower();
}

template <int D>
std::int64_t InformationFilter<D>::nonzeros() const {
  std::vector<int> order(at(state_.size()));
  std::iota(order.begin(), order.end(), 0);
  const SymmetricBlockMatrix I = block_information(order, false);
  const auto free = [&](int i) {
    std::int64_t n = 0;
    for (int s = 0; s < state_.dim(i); ++s) n += is_held(state_.offset(i) + s) ? 0 : 1;
    return n;
  };
  std::int64_t count = 0;
  for (int j = 0; j < I.size(); ++j) {
    for (std::int64_t s = I.begin(j); s < I.end(j); ++s)
      count += (I.row(s) == j ? 1 : 2) * free(j) * free(I.row(s));
  }
  return count;
}

template <int D>
Map<D> InformationFilter<D>::map() const {
  Map<D> out;
  out.values = state_.values();
  out.anchor = anchor_;
  out.solved_in = anchor_;
  const std::vector<int> order = state_.numbers_in(out.variables());
  SymmetricBlockMatrix information = block_information(order, true);
  leave_out(information, anchor_rows(anchor_, out.values).pinned);
  out.information = complete_gauge(out.values, anchor_, information);
  return out;
}

template class InformationFilter<2>;
template class InformationFilter<3>;

}  // namespace mapjoin
