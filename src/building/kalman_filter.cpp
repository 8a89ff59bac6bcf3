#include "mapjoin/building/kalman_filter.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "mapjoin/frames/anchors.h"
#include "mapjoin/frames/gauge.h"
#include "mapjoin/graph/dense.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/graph/index.h"
#include "mapjoin/solvers/dense_blas.h"

namespace mapjoin {

namespace {

// Sigma of a feature before its first measurement, by its distance from the pose that measures it.
// It is placed to a fifth of that at least (delayed.h), so this adds next to nothing; and far more
// would cost digits, as what is known afterwards is a difference of squares.
constexpr double kNothingKnown = 100.0;

/// A measurement linearised: r + J_a da + J_x dx = n.
struct Linear {
  Eigen::VectorXd r;
  Eigen::MatrixXd Ja, Jx;
  Eigen::MatrixXd noise;  // covariance of n
};

/// From rows that lie one after another.
Eigen::MatrixXd by_rows(const std::vector<double>& numbers, int rows, int columns) {
  Eigen::MatrixXd out(rows, columns);
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) out(r, c) = numbers[at(r * columns + c)];
  }
  return out;
}

template <int D>
Linear linearized(const LocalMeasurement<D>& m, const Values<D>& values) {
  const int n = m.model->dim;
  const int dim = m.model->target->dim;
  Eigen::VectorXd r(n);
  std::vector<double> Ja(at(n * kGauge<D>)), Jx(at(n * dim));
  m.model->linearize(m.z, values.value(m.from), nullptr, values.value(m.to), nullptr, r.data(),
                     Ja.data(), Jx.data());
  return {r, by_rows(Ja, n, kGauge<D>), by_rows(Jx, n, dim),
          inverse_of(Eigen::Map<const Eigen::MatrixXd>(m.info, n, n))};
}

/// How far a measurement looks, in metres; of what has no position, at least one.
template <int D>
double distance(const LocalMeasurement<D>& m, const Values<D>& values) {
  const VariableKind<D>& kind = *m.model->target;
  if (!kind.has_position) return 1.0;
  const int zero = 0;
  Vec<D> p;
  kind.positions(values.value(m.to), &zero, 1, p.data());
  return std::max(1.0, (p - reinterpret_cast<const Rigid<D>*>(values.value(m.from))->t).norm());
}

}  // namespace

template <int D>
KalmanFilter<D>::KalmanFilter(const LocalProblem<D>& problem, const InitialValues<D>& values,
                              std::span<const char> keep)
    : problem_(&problem), values_(problem.variables), keep_(keep.begin(), keep.end()) {
  const std::size_t n = at(problem.variables.size());
  waits_.assign(n, 1);
  for (const auto& m : problem.measurements) {
    if (m.model->seen != nullptr) waits_[at(m.to)] = 0;
  }
  for (int i = first(); i <= problem.last_pose(); ++i) waits_[at(i)] = 0;
  row_.assign(n, kAbsent);
  row_[at(first())] = kFixed;
  values_.pose(first()) = Rigid<D>::identity();
  for (int i = 0; i < problem.variables.size(); ++i) {
    if (waits(i))
      std::copy(values.values.value(i), values.values.value(i) + kind(i).value_size,
                values_.value(i));
  }
  last_use_.assign(n, 0);
  at_.resize(at(problem.last_pose() + 2));
  for (std::size_t k = 0; k < problem.measurements.size(); ++k) {
    const auto& m = problem.measurements[k];
    const int t = waits(m.to) ? problem.last_pose() + 1 : problem.time_of(m);
    at_[at(t)].push_back(static_cast<int>(k));
    for (const int i : {m.from, m.to}) last_use_[at(i)] = std::max(last_use_[at(i)], t);
  }
  time_ = first();
}

template <int D>
bool KalmanFilter<D>::step() {
  if (time_ > problem_->last_pose() + 1) return false;
  const auto& now = at_[at(time_)];
  waiting_.insert(waiting_.end(), now.begin(), now.end());
  take();
  forget();
  ++time_;
  if (time_ > problem_->last_pose() + 1 && !waiting_.empty())
    // Cannot be: the pieces of a problem hang together.
    throw Error("a filter was left with measurements of poses it never reached");
  return true;
}

/// Uses all measurements that reach the state, predictions and augmentations first.
template <int D>
void KalmanFilter<D>::take() {
  const auto measurement = [&](int k) -> const LocalMeasurement<D>& {
    return problem_->measurements[at(k)];
  };
  for (bool moved = true; moved;) {
    moved = false;
    for (int& k : waiting_) {
      if (k < 0) continue;
      const auto& m = measurement(k);
      if (knows(m.from) == knows(m.to) || m.model->seen == nullptr) continue;
      if (!knows(m.from) && !problem_->is_pose(m.to)) continue;
      augment(m);
      k = -1;
      moved = true;
    }
  }
  std::erase(waiting_, -1);
  for (const int k : waiting_) {
    const auto& m = measurement(k);
    if (!knows(m.from) || knows(m.to) || !waits(m.to)) continue;
    const double sigma = kNothingKnown * distance(m, values_);
    const int row = enter(m.to);
    Eigen::MatrixXd column = P_.columns(row, kind(m.to).dim);
    for (Eigen::Index s = 0; s < column.cols(); ++s) column(row + s, s) = sigma * sigma;
    P_.set_columns(row, column);
  }
  std::vector<int> now;
  for (const int k : waiting_) {
    if (reaches(measurement(k))) now.push_back(k);
  }
  std::erase_if(waiting_, [&](int k) { return reaches(measurement(k)); });
  update(now);
}

template <int D>
int KalmanFilter<D>::enter(int variable) {
  present_.push_back(variable);
  return row_[at(variable)] = P_.add(kind(variable).dim);
}

/// The measurement places one end, its residual becoming zero: of J_a da + J_x dx = n the tangent
/// of the new end is solved for.
template <int D>
void KalmanFilter<D>::augment(const LocalMeasurement<D>& m) {
  const bool forward = knows(m.from);
  const int fresh = forward ? m.to : m.from;
  const int old = forward ? m.from : m.to;
  if (forward) {
    m.model->seen(m.z, values_.value(m.to));
    kind(m.to).transform(values_.pose(m.from), values_.value(m.to), 1);
  } else {
    Rigid<D> step;
    m.model->seen(m.z, reinterpret_cast<double*>(&step));
    values_.pose(fresh) = values_.pose(old) * step.inverse();
  }
  const Linear l = linearized(m, values_);
  const Eigen::MatrixXd inverse = inverse_of(forward ? l.Jx : l.Ja);
  const Eigen::MatrixXd G = -times(inverse, forward ? l.Ja : l.Jx);
  Eigen::MatrixXd noise = carried(inverse, l.noise);
  const int row = enter(fresh);
  const int dim = kind(fresh).dim;
  Eigen::MatrixXd column = Eigen::MatrixXd::Zero(P_.size(), dim);
  if (const int from = row_[at(old)]; from >= 0) {  // the fixed pose is without error
    column = times(P_.columns(from, kind(old).dim), G.transpose());
    noise += times(G, column.middleRows(from, kind(old).dim));
  }
  column.middleRows(row, dim) = noise;
  P_.set_columns(row, column);
}

/// One Kalman update by several measurements. With S = H P H^T + R = L L^T and X = P H^T L^-T the
/// gain is X L^-1, and P loses X X^T.
template <int D>
void KalmanFilter<D>::update(const std::vector<int>& measurements) {
  if (measurements.empty()) return;
  struct Term {
    int first, row;  ///< of its rows in the stack, and in P
    Eigen::MatrixXd J;
  };
  std::vector<Term> terms;
  int rows = 0;
  for (const int k : measurements) rows += problem_->measurements[at(k)].model->dim;
  Eigen::MatrixXd X = Eigen::MatrixXd::Zero(P_.size(), rows);  // P H^T
  Eigen::MatrixXd S = Eigen::MatrixXd::Zero(rows, rows);
  Eigen::MatrixXd r(rows, 1);
  int stack = 0;
  for (const int k : measurements) {
    const auto& m = problem_->measurements[at(k)];
    Linear l = linearized(m, values_);
    const int dim = m.model->dim;
    r.middleRows(stack, dim) = l.r;
    S.block(stack, stack, dim, dim) = l.noise;
    const auto put = [&](int variable, Eigen::MatrixXd& J) {
      const int row = row_[at(variable)];
      if (row < 0) return;
      X.middleCols(stack, dim) += times(P_.columns(row, static_cast<int>(J.cols())), J.transpose());
      terms.push_back({stack, row, std::move(J)});
    };
    put(m.from, l.Ja);
    put(m.to, l.Jx);
    stack += dim;
  }
  for (const Term& term : terms)
    S.middleRows(term.first, term.J.rows()) += times(term.J, X.middleRows(term.row, term.J.cols()));
  if (factor_lower(S) >= 0) throw_indefinite();
  solve_lower_right(S, X);
  solve_lower_left(S, r);
  chi2_ += r.squaredNorm();
  P_.subtract_square(X);
  move(-times(X, r));
}

/// x [+] d, and the covariance in the tangents there.
template <int D>
void KalmanFilter<D>::move(const Eigen::VectorXd& d) {
  std::vector<double> before;
  for (const int i : present_) {
    const int row = row_[at(i)];
    const VariableKind<D>& k = kind(i);
    double* const x = values_.value(i);
    before.assign(x, x + k.value_size);
    k.retract(x, d.data() + row, 1);
    if (k.action == FrameAction::kRotating || k.action == FrameAction::kInvariant) continue;
    Eigen::MatrixXd turn(k.dim, k.dim);
    k.local_jacobian(x, before.data(), 1, turn.data());
    P_.turn(row, turn);
  }
}

template <int D>
void KalmanFilter<D>::throw_indefinite() const {
  throw SingularError(fmt::format(
      "the filter's covariance of the local map from {} is not positive definite: its "
      "measurements contradict each other far beyond their noise; use the nonlinear builder",
      to_string(problem_->variables.key(first()))));
}

/// Drops poses that nobody keeps and no later measurement refers to.
template <int D>
void KalmanFilter<D>::forget() {
  std::erase_if(present_, [&](int i) {
    if (!problem_->is_pose(i) || keep_[at(i)] != 0 || last_use_[at(i)] > time_) return false;
    P_.remove(row_[at(i)], kind(i).dim);
    row_[at(i)] = kAbsent;
    return true;
  });
}

template <int D>
int KalmanFilter<D>::scalars() const {
  int out = 0;
  for (const int i : present_) out += kind(i).dim;
  return out;
}

template <int D>
Eigen::MatrixXd KalmanFilter<D>::covariance(int variable) const {
  const int dim = kind(variable).dim;
  const int row = row_[at(variable)];
  if (row < 0) return Eigen::MatrixXd::Zero(dim, dim);
  std::vector<int> rows;
  for (int s = 0; s < dim; ++s) rows.push_back(row + s);
  return P_.of(rows);
}

template <int D>
std::vector<int> KalmanFilter<D>::known() const {
  std::vector<int> out = present_;
  out.push_back(first());
  std::sort(out.begin(), out.end());
  return out;
}

template <int D>
Map<D> KalmanFilter<D>::map() const {
  const std::vector<int> kept = known();
  Map<D> map;
  map.values = subset(values_, std::span<const int>(kept));
  map.anchor = map.solved_in = pose_anchor<D>(problem_->variables.key(first()));
  std::vector<int> rows;   // in P
  std::vector<int> place;  // in the map
  for (std::size_t k = 0; k < kept.size(); ++k) {
    for (int s = 0; s < kind(kept[k]).dim && row_[at(kept[k])] >= 0; ++s) {
      rows.push_back(row_[at(kept[k])] + s);
      place.push_back(map.variables().offset(static_cast<int>(k)) + s);
    }
  }
  const std::optional<Eigen::MatrixXd> information = P_.information(rows);
  if (!information) throw_indefinite();
  const Eigen::MatrixXd anchored = embedded(*information, place, map.variables().scalars());
  map.information =
      complete_gauge(map.values, map.anchor,
                     SymmetricBlockMatrix::from_dense(map.variables().offsets(), anchored));
  return map;
}

template class KalmanFilter<2>;
template class KalmanFilter<3>;

}  // namespace mapjoin
