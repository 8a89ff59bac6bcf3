#include "mapjoin/building/filter.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "mapjoin/frames/anchors.h"
#include "mapjoin/frames/gauge.h"
#include "mapjoin/graph/error.h"

namespace mapjoin {

namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr double kNothingKnown = 1e4;  // metres: sigma of a feature before its first measurement

/// A measurement linearised: r + J_a da + J_x dx = n.
struct Linear {
  Eigen::VectorXd r;
  RowMajor Ja, Jx;
  Eigen::MatrixXd noise;  // covariance of n
};

template <int D>
class Filter {
 public:
  Filter(const LocalProblem<D>& problem, const InitialValues<D>& values, std::span<const char> keep)
      : problem_(problem), keep_(keep), values_(problem.variables) {
    const auto n = static_cast<std::size_t>(problem.variables.size());
    row_.assign(n, kAbsent);
    row_[static_cast<std::size_t>(first())] = kFixed;
    value<Rigid<D>>(first()) = Rigid<D>::identity();
    for (int i = 0; i < problem.variables.size(); ++i) {
      if (problem.is_pose(i) || !waits(i)) continue;
      std::copy(values.values.value(i), values.values.value(i) + kind(i).value_size,
                values_.value(i));
    }
    last_use_.assign(n, 0);
    for (const auto& m : problem.measurements) {
      const int until = waits(m.to) ? problem.last_pose() + 1 : time(m);
      for (const int i : {m.from, m.to}) {
        auto& last = last_use_[static_cast<std::size_t>(i)];
        last = std::max(last, until);
      }
    }
  }

  void run() {
    std::vector<std::vector<int>> at(static_cast<std::size_t>(problem_.last_pose() + 2));
    for (std::size_t k = 0; k < problem_.measurements.size(); ++k) {
      const auto& m = problem_.measurements[k];
      const int t = waits(m.to) ? problem_.last_pose() + 1 : time(m);
      at[static_cast<std::size_t>(t)].push_back(static_cast<int>(k));
    }
    std::vector<int> waiting;
    for (int t = first(); t <= problem_.last_pose() + 1; ++t) {
      const auto& now = at[static_cast<std::size_t>(t)];
      waiting.insert(waiting.end(), now.begin(), now.end());
      take(waiting);
      forget(t);
    }
    if (!waiting.empty())  // cannot be: the pieces of a problem hang together
      throw Error("a filter was left with measurements of poses it never reached");
  }

  FilteredMap<D> result() const {
    std::vector<int> kept;
    for (int i = 0; i < problem_.variables.size(); ++i) {
      if (row_[static_cast<std::size_t>(i)] != kAbsent) kept.push_back(i);
    }
    FilteredMap<D> out;
    out.chi2 = chi2_;
    Map<D>& map = out.map;
    map.values = subset(values_, std::span<const int>(kept));
    map.anchor = map.solved_in = pose_anchor<D>(problem_.variables.key(first()));
    const auto n = static_cast<Eigen::Index>(P_.rows());
    const Eigen::LLT<Eigen::MatrixXd> llt(P_);
    if (llt.info() != Eigen::Success) {
      throw SingularError(fmt::format(
          "the filter's covariance of the local map from {} is not positive definite: its "
          "measurements contradict each other far beyond their noise; use the nonlinear builder",
          to_string(problem_.variables.key(first()))));
    }
    const Eigen::MatrixXd I = llt.solve(Eigen::MatrixXd::Identity(n, n));
    Eigen::MatrixXd anchored =
        Eigen::MatrixXd::Zero(map.variables().scalars(), map.variables().scalars());
    for (std::size_t a = 0; a < kept.size(); ++a) {
      for (std::size_t b = 0; b < kept.size(); ++b) {
        const int i = row_[static_cast<std::size_t>(kept[a])];
        const int j = row_[static_cast<std::size_t>(kept[b])];
        if (i < 0 || j < 0) continue;
        const int rows = kind(kept[a]).dim;
        const int columns = kind(kept[b]).dim;
        anchored.block(map.variables().offset(static_cast<int>(a)),
                       map.variables().offset(static_cast<int>(b)), rows, columns) =
            0.5 * (I.block(i, j, rows, columns) + I.block(j, i, columns, rows).transpose());
      }
    }
    map.information =
        complete_gauge(map.values, map.anchor,
                       SymmetricBlockMatrix::from_dense(map.variables().offsets(), anchored));
    return out;
  }

 private:
  static constexpr int kAbsent = -1;
  static constexpr int kFixed = -2;

  int first() const { return problem_.first_pose(); }
  const VariableKind<D>& kind(int i) const { return problem_.variables.kind(i); }
  template <class Value>
  Value& value(int i) {
    return *reinterpret_cast<Value*>(values_.value(i));
  }
  bool known(int i) const { return row_[static_cast<std::size_t>(i)] != kAbsent; }
  bool is_pose(int i) const { return problem_.is_pose(i); }
  int time(const LocalMeasurement<D>& m) const {
    return is_pose(m.to) ? std::max(m.from, m.to) : m.from;
  }
  /// Is the variable a feature that no single measurement places?
  bool waits(int i) {
    if (waits_.empty()) {
      waits_.assign(static_cast<std::size_t>(problem_.variables.size()), 1);
      for (const auto& m : problem_.measurements) {
        if (m.model->seen != nullptr) waits_[static_cast<std::size_t>(m.to)] = 0;
      }
    }
    return !is_pose(i) && waits_[static_cast<std::size_t>(i)];
  }

  Linear linearized(const LocalMeasurement<D>& m) const {
    const int n = m.model->dim;
    Linear out{Eigen::VectorXd(n), RowMajor(n, kGauge<D>), RowMajor(n, m.model->target->dim), {}};
    m.model->linearize(m.z, values_.value(m.from), nullptr, values_.value(m.to), nullptr,
                       out.r.data(), out.Ja.data(), out.Jx.data());
    out.noise = Eigen::Map<const Eigen::MatrixXd>(m.info, n, n).inverse();
    return out;
  }

  /// Uses all measurements that reach the state, predictions and augmentations first.
  void take(std::vector<int>& waiting) {
    bool moved = true;
    while (moved) {
      moved = false;
      for (int& k : waiting) {
        if (k < 0) continue;
        const auto& m = problem_.measurements[static_cast<std::size_t>(k)];
        if (known(m.from) == known(m.to) || m.model->seen == nullptr) continue;
        if (!known(m.from) && !is_pose(m.to)) continue;
        augment(m);
        k = -1;
        moved = true;
      }
    }
    std::erase(waiting, -1);
    for (const int k : waiting) {
      const auto& m = problem_.measurements[static_cast<std::size_t>(k)];
      if (known(m.from) && !known(m.to) && waits(m.to)) add_unknown(m.to);
    }
    std::vector<int> now;
    for (const int k : waiting) {
      const auto& m = problem_.measurements[static_cast<std::size_t>(k)];
      if (known(m.from) && known(m.to)) now.push_back(k);
    }
    update(now);
    std::erase_if(waiting,
                  [&](int k) { return std::find(now.begin(), now.end(), k) != now.end(); });
  }

  int grow(int i) {
    const auto n = P_.rows();
    P_.conservativeResize(n + kind(i).dim, n + kind(i).dim);
    P_.bottomRows(kind(i).dim).setZero();
    P_.rightCols(kind(i).dim).setZero();
    row_[static_cast<std::size_t>(i)] = static_cast<int>(n);
    return static_cast<int>(n);
  }

  void add_unknown(int i) {
    const int row = grow(i);
    P_.block(row, row, kind(i).dim, kind(i).dim)
        .diagonal()
        .setConstant(kNothingKnown * kNothingKnown);
  }

  /// The measurement places one end, its residual becoming zero: of J_a da + J_x dx = n the tangent
  /// of the new end is solved for.
  void augment(const LocalMeasurement<D>& m) {
    const bool forward = known(m.from);
    const int fresh = forward ? m.to : m.from;
    const int old = forward ? m.from : m.to;
    if (forward) {
      m.model->seen(m.z, values_.value(m.to));
      kind(m.to).transform(value<Rigid<D>>(m.from), values_.value(m.to), 1);
    } else {
      Rigid<D> step;
      m.model->seen(m.z, reinterpret_cast<double*>(&step));
      value<Rigid<D>>(fresh) = value<Rigid<D>>(old) * step.inverse();
    }
    const Linear l = linearized(m);
    const Eigen::MatrixXd inverse =
        (forward ? Eigen::MatrixXd(l.Jx) : Eigen::MatrixXd(l.Ja)).inverse();
    const Eigen::MatrixXd G = -inverse * (forward ? l.Ja : l.Jx);
    const int row = grow(fresh);
    const int dim = kind(fresh).dim;
    P_.block(row, row, dim, dim) = inverse * l.noise * inverse.transpose();
    const int from = row_[static_cast<std::size_t>(old)];
    if (from < 0) return;  // the fixed pose: without error
    const Eigen::MatrixXd cross = G * P_.block(from, 0, kind(old).dim, row);
    P_.block(row, 0, dim, row) = cross;
    P_.block(0, row, row, dim) = cross.transpose();
    P_.block(row, row, dim, dim) += cross.middleCols(from, kind(old).dim) * G.transpose();
  }

  /// One Kalman update by several measurements.
  void update(const std::vector<int>& now) {
    if (now.empty()) return;
    int rows = 0;
    for (const int k : now) rows += problem_.measurements[static_cast<std::size_t>(k)].model->dim;
    const auto n = P_.rows();
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(rows, n);
    Eigen::MatrixXd PHt = Eigen::MatrixXd::Zero(n, rows);
    Eigen::MatrixXd R = Eigen::MatrixXd::Zero(rows, rows);
    Eigen::VectorXd r(rows);
    int at = 0;
    for (const int k : now) {
      const auto& m = problem_.measurements[static_cast<std::size_t>(k)];
      const Linear l = linearized(m);
      const int dim = m.model->dim;
      r.segment(at, dim) = l.r;
      R.block(at, at, dim, dim) = l.noise;
      const auto put = [&](int variable, const RowMajor& J) {
        const int column = row_[static_cast<std::size_t>(variable)];
        if (column < 0) return;
        H.block(at, column, dim, J.cols()) = J;
        PHt.middleCols(at, dim).noalias() += P_.middleCols(column, J.cols()) * J.transpose();
      };
      put(m.from, l.Ja);
      put(m.to, l.Jx);
      at += dim;
    }
    const Eigen::LLT<Eigen::MatrixXd> S(H * PHt + R);
    const Eigen::MatrixXd Kt = S.solve(PHt.transpose());
    const Eigen::VectorXd d = -(Kt.transpose() * r);
    chi2_ += r.dot(S.solve(r));
    P_.noalias() -= PHt * Kt;
    P_ = (0.5 * (P_ + P_.transpose())).eval();
    move(d);
  }

  /// x [+] d, and the covariance in the tangents there.
  void move(const Eigen::VectorXd& d) {
    std::vector<double> before;
    for (int i = 0; i < problem_.variables.size(); ++i) {
      const int row = row_[static_cast<std::size_t>(i)];
      if (row < 0) continue;
      const VariableKind<D>& k = kind(i);
      double* const x = values_.value(i);
      before.assign(x, x + k.value_size);
      k.retract(x, d.data() + row, 1);
      if (k.action == FrameAction::kRotating || k.action == FrameAction::kInvariant) continue;
      Eigen::MatrixXd turn(k.dim, k.dim);
      k.local_jacobian(x, before.data(), 1, turn.data());
      P_.middleRows(row, k.dim) = (turn * P_.middleRows(row, k.dim)).eval();
      P_.middleCols(row, k.dim) = (P_.middleCols(row, k.dim) * turn.transpose()).eval();
    }
  }

  /// Drops poses that nobody keeps and no later measurement refers to.
  void forget(int t) {
    for (int i = first(); i <= problem_.last_pose(); ++i) {
      const auto k = static_cast<std::size_t>(i);
      if (row_[k] < 0 || keep_[k] || last_use_[k] > t) continue;
      const int dim = kind(i).dim;
      const int row = row_[k];
      const auto rest = P_.rows() - row - dim;
      P_.middleRows(row, rest) = P_.bottomRows(rest).eval();
      P_.middleCols(row, rest) = P_.rightCols(rest).eval();
      P_.conservativeResize(row + rest, row + rest);
      row_[k] = kAbsent;
      for (int& other : row_) other -= other > row ? dim : 0;
    }
  }

  const LocalProblem<D>& problem_;
  std::span<const char> keep_;
  Values<D> values_;
  std::vector<int> row_;       ///< first row in P; kAbsent; kFixed
  std::vector<int> last_use_;  ///< time after which no measurement refers to a variable
  std::vector<char> waits_;
  Eigen::MatrixXd P_;
  double chi2_ = 0.0;
};

}  // namespace

template <int D>
FilteredMap<D> filter(const LocalProblem<D>& problem, const InitialValues<D>& values,
                      std::span<const char> keep) {
  Filter<D> filter(problem, values, keep);
  filter.run();
  return filter.result();
}

template FilteredMap<2> filter<2>(const LocalProblem<2>&, const InitialValues<2>&,
                                  std::span<const char>);
template FilteredMap<3> filter<3>(const LocalProblem<3>&, const InitialValues<3>&,
                                  std::span<const char>);

}  // namespace mapjoin
