#include "mapjoin/filtering/ekf_join.h"

#include <fmt/format.h>
#include <Eigen/Cholesky>
#include <Eigen/LU>

#include <cstring>
#include <utility>

#include "mapjoin/frames/anchors.h"
#include "mapjoin/frames/gauge.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/joining/join.h"
#include "mapjoin/joining/report.h"
#include "mapjoin/solvers/dense_blas.h"

namespace mapjoin {

namespace {

std::size_t at(std::int64_t k) { return static_cast<std::size_t>(k); }

/// The covariance of what a map's frame leaves free, in the order of its variables.
template <int D>
Eigen::MatrixXd covariance_of(const Map<D>& map) {
  const AnchoredInformation information = anchored_information(map);
  const auto n = static_cast<Eigen::Index>(information.scalars.size());
  const Eigen::LLT<Eigen::MatrixXd> llt(information.dense());
  if (llt.info() != Eigen::Success)
    throw SingularError(fmt::format(
        "the local map of {} has no covariance: its information leaves some variable undetermined; "
        "a Kalman filter cannot take it",
        to_string(map.anchor)));
  return llt.solve(Eigen::MatrixXd::Identity(n, n));
}

template <int D>
Eigen::MatrixXd frame_jacobian(const VariableKind<D>& kind, const Rigid<D>& T, const double* x) {
  Eigen::MatrixXd J(kind.dim, kind.dim);
  kind.frame_jacobian(T, x, 1, J.data());
  return J;
}

/// All but the map's anchor.
template <int D>
Values<D> without(const Values<D>& values, const Key& dropped) {
  std::vector<int> numbers;
  for (int i = 0; i < values.size(); ++i) {
    if (values.variables().key(i) != dropped) numbers.push_back(i);
  }
  return subset(values, numbers);
}

}  // namespace

/// The state and a local map written in the same frame, side by side, with their joint covariance.
template <int D>
struct EkfJoin<D>::Augmented {
  Values<D> state, local;
  Eigen::MatrixXd P;  ///< the lower triangle counts

  int row_of_local(int i) const {
    return state.variables().scalars() + local.variables().offset(i);
  }
  /// P after x [+] d, whose base is what P was about: tangents there.
  void move(Values<D>& x, Eigen::Index first, const Eigen::VectorXd& d) {
    const Values<D> before = x;
    x.retract({d.data() + first, at(x.variables().scalars())});
    for (int i = 0; i < x.size(); ++i) {
      const VariableKind<D>& kind = x.variables().kind(i);
      Eigen::MatrixXd S(kind.dim, kind.dim);
      kind.local_jacobian(before.value(i), x.value(i), 1, S.data());
      if (S.isIdentity(0.0)) continue;
      const Eigen::PartialPivLU<Eigen::MatrixXd> turn(S);
      const Eigen::Index row = first + x.variables().offset(i);
      P.middleRows(row, kind.dim) = turn.solve(P.middleRows(row, kind.dim)).eval();
      P.middleCols(row, kind.dim) =
          turn.solve(P.middleCols(row, kind.dim).transpose()).transpose().eval();
    }
  }
};

template <int D>
Fusion EkfJoin<D>::fuse(const LocalMap<D>& local_map) {
  Fusion fusion;
  const auto start = Clock::now();
  const Map<D> local = to_map(local_map);
  if (!is_pose_anchor(local.anchor))
    throw InputError(
        fmt::format("map joining by a Kalman filter takes local maps in the frame of the pose they "
                    "begin at, not "
                    "of {}",
                    to_string(local.anchor)));
  const Key& begin = local.anchor.keys[0];
  const Eigen::MatrixXd P_local = covariance_of(local);
  if (fused_ == 0) {
    anchor_ = local.anchor;
    estimate_ = without(local.values, begin);
    P_ = P_local;
    fusion.seconds_update = seconds_since(start);
    fusion.scalars = scalars();
    ++fused_;
    return fusion;
  }
  const auto last = estimate_.variables().find(begin);
  if (!last)
    throw DisconnectedError(fmt::format(
        "the local map of {} does not begin where the one before it ends; map joining by a Kalman "
        "filter keeps no other pose",
        to_string(begin)));

  Augmented both{estimate_, without(local.values, begin), {}};
  const Rigid<D> T = estimate_.pose(begin);
  const int n = estimate_.variables().scalars(), m = both.local.variables().scalars();
  const int pose = estimate_.variables().offset(*last);
  Eigen::MatrixXd J(m, kGauge<D>);  // by the last pose
  Eigen::MatrixXd turned = P_local;
  // What the state has is linearised where the state has it, as any observation is; what is new,
  // where it was measured.
  const Rigid<D> back = T.inverse();
  const std::vector<int> twin = numbers_in(both.local.variables(), estimate_.variables());
  for (int i = 0; i < both.local.size(); ++i) {
    const VariableKind<D>& kind = both.local.variables().kind(i);
    const int row = both.local.variables().offset(i);
    const double* const seen = twin[at(i)] < 0 ? both.local.value(i) : estimate_.value(twin[at(i)]);
    std::vector<double> x(seen, seen + kind.value_size);
    if (twin[at(i)] >= 0) kind.transform(back, x.data(), 1);
    const Eigen::MatrixXd turn = frame_jacobian(kind, T, x.data());
    Eigen::MatrixXd g(kind.dim, kGauge<D>);
    kind.gauge(x.data(), 1, g.data());
    J.middleRows(row, kind.dim) = turn * g;
    turned.middleRows(row, kind.dim) = (turn * turned.middleRows(row, kind.dim)).eval();
    turned.middleCols(row, kind.dim) = (turned.middleCols(row, kind.dim) * turn.transpose()).eval();
  }
  both.local.transform(T);
  both.P.resize(n + m, n + m);
  both.P.topLeftCorner(n, n) = P_;
  both.P.bottomLeftCorner(m, n) = J * P_.middleRows(pose, kGauge<D>);
  both.P.topRightCorner(n, m) = both.P.bottomLeftCorner(m, n).transpose();
  both.P.bottomRightCorner(m, m) =
      turned + J * P_.block(pose, pose, kGauge<D>, kGauge<D>) * J.transpose();
  fusion.seconds_update = seconds_since(start);

  const auto updating = Clock::now();
  update(both);
  keep(both);
  fusion.seconds_factor = seconds_since(updating);
  fusion.scalars = scalars();
  ++fused_;
  return fusion;
}

/// The Kalman update by what is there twice: x_state - x_local = 0, without noise.
template <int D>
void EkfJoin<D>::update(Augmented& both) const {
  const std::vector<int> twin = numbers_in(both.local.variables(), both.state.variables());
  std::vector<std::pair<int, int>> common;  // numbers in the state and in the local map
  int rows = 0;
  for (int i = 0; i < both.local.size(); ++i) {
    if (twin[at(i)] < 0) continue;
    common.emplace_back(twin[at(i)], i);
    rows += both.local.variables().dim(i);
  }
  if (rows == 0) return;
  const Eigen::Index total = both.P.rows();
  Eigen::MatrixXd PC(total, rows);  // P C^T
  Eigen::VectorXd r(rows);
  Eigen::Index row = 0;
  std::vector<Eigen::MatrixXd> S;
  for (const auto& [i, j] : common) {
    const VariableKind<D>& kind = both.local.variables().kind(j);
    S.emplace_back(kind.dim, kind.dim);
    kind.local_jacobian(both.local.value(j), both.state.value(i), 1, S.back().data());
    kind.local(both.local.value(j), both.state.value(i), 1, r.data() + row);
    PC.middleCols(row, kind.dim) =
        both.P.middleCols(both.state.variables().offset(i), kind.dim) * S.back().transpose() -
        both.P.middleCols(both.row_of_local(j), kind.dim);
    row += kind.dim;
  }
  Eigen::MatrixXd CPC(rows, rows);
  row = 0;
  for (std::size_t k = 0; k < common.size(); ++k) {
    const Eigen::Index dim = S[k].rows();
    CPC.middleRows(row, dim) =
        S[k] * PC.middleRows(both.state.variables().offset(common[k].first), dim) -
        PC.middleRows(both.row_of_local(common[k].second), dim);
    row += dim;
  }
  if (factor_lower(CPC) >= 0)
    throw SingularError(
        "the state and the local map both claim to know a common feature exactly; a "
        "Kalman filter cannot make them equal");
  solve_lower_right(CPC, PC);  // P C^T L^-T
  Eigen::MatrixXd innovation = -r;
  solve_lower_left(CPC, innovation);
  const Eigen::VectorXd d = PC * innovation;
  add_square(-1.0, PC, both.P);
  both.P.template triangularView<Eigen::StrictlyUpper>() = both.P.transpose();
  both.move(both.state, 0, d);
  both.move(both.local, both.state.variables().scalars(), d);
}

/// The features of both, once, and the poses of the local map.
template <int D>
void EkfJoin<D>::keep(const Augmented& both) {
  std::vector<int> features;
  for (int i = 0; i < both.state.size(); ++i) {
    if (both.state.variables().key(i).type != Tag("pose")) features.push_back(i);
  }
  const VariableSet<D> kept = subset(both.state.variables(), features);
  const VariableSet<D>* const sets[] = {&kept, &both.local.variables()};
  Values<D> out{unite<D>(sets)};
  const VariableSet<D>& all = out.variables();
  const std::vector<int> in_state = numbers_in(all, both.state.variables());
  const std::vector<int> in_local = numbers_in(all, both.local.variables());
  std::vector<int> rows;
  for (int i = 0; i < all.size(); ++i) {
    const VariableKind<D>& kind = all.kind(i);
    const bool from_state = in_state[at(i)] >= 0;
    const double* const x =
        from_state ? both.state.value(in_state[at(i)]) : both.local.value(in_local[at(i)]);
    std::memcpy(out.value(i), x, at(kind.value_size) * sizeof(double));
    const int first = from_state ? both.state.variables().offset(in_state[at(i)])
                                 : both.row_of_local(in_local[at(i)]);
    for (int s = 0; s < kind.dim; ++s) rows.push_back(first + s);
  }
  estimate_ = std::move(out);
  P_ = both.P(rows, rows);
}

template <int D>
Values<D> EkfJoin<D>::values() const {
  ValuesBuilder<D> builder;
  if (fused_ > 0) builder.template add<PoseType<D>>(anchor_.keys[0], Rigid<D>());
  for (int i = 0; i < estimate_.size(); ++i)
    builder.add(estimate_.variables().kind(i), estimate_.variables().key(i), estimate_.value(i));
  return std::move(builder).build();
}

template <int D>
Map<D> EkfJoin<D>::map() const {
  if (fused_ == 0) throw InputError("no local map has been fused: there is no map yet");
  Map<D> out;
  out.values = values();
  out.anchor = anchor_;
  out.solved_in = anchor_;
  Eigen::MatrixXd L = P_;
  if (factor_lower(L) >= 0)
    throw SingularError(
        "the covariance matrix has lost its rank: some features are known to be "
        "where others are; there is no information matrix");
  Eigen::MatrixXd inverse = Eigen::MatrixXd::Identity(L.rows(), L.cols());
  solve_lower_left(L, inverse);
  Eigen::MatrixXd I = Eigen::MatrixXd::Zero(L.rows(), L.cols());
  const Eigen::MatrixXd transposed = inverse.transpose();
  add_square(1.0, transposed, I);
  // Into the rows of all variables: the start pose has none.
  std::vector<Eigen::Index> rows;
  const std::vector<int> place = numbers_in(estimate_.variables(), out.variables());
  for (int i = 0; i < estimate_.size(); ++i) {
    for (int s = 0; s < estimate_.variables().dim(i); ++s)
      rows.push_back(out.variables().offset(place[at(i)]) + s);
  }
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(out.variables().scalars(), out.variables().scalars());
  all(rows, rows) = Eigen::MatrixXd(I.selfadjointView<Eigen::Lower>());
  out.information = complete_gauge(
      out.values, anchor_, SymmetricBlockMatrix::from_dense(out.variables().offsets(), all));
  return out;
}

template <int D>
Eigen::MatrixXd EkfJoin<D>::covariance(std::span<const Key> keys) const {
  std::vector<int> rows;
  std::vector<char> known;
  int n = 0;
  for (const Key& key : keys) {
    const bool first = fused_ > 0 && key == anchor_.keys[0];
    const int i = first ? 0 : estimate_.variables().require(key, "covariance");
    const int dim = first ? kGauge<D> : estimate_.variables().dim(i);
    for (int s = 0; s < dim; ++s) {
      rows.push_back(first ? 0 : estimate_.variables().offset(i) + s);
      known.push_back(first ? 1 : 0);
    }
    n += dim;
  }
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(n, n);
  for (int c = 0; c < n; ++c) {
    for (int r = 0; r < n; ++r) {
      if (known[at(r)] == 0 && known[at(c)] == 0) out(r, c) = P_(rows[at(r)], rows[at(c)]);
    }
  }
  return out;
}

template <int D>
FilterResult<D> ekf_join(std::span<const LocalMap<D>> local_maps,
                         const ProgressCallback& progress) {
  if (local_maps.empty()) throw InputError("there are no local maps: nothing to join");
  FilterResult<D> out;
  EkfJoin<D> filter;
  for (const LocalMap<D>& map : local_maps) {
    const double done = static_cast<double>(out.report.fusions.size());
    if (progress && !progress({"fuse", done / static_cast<double>(local_maps.size())}))
      throw CancelledError("cancelled while fusing local maps");
    out.report.fusions.push_back(filter.fuse(map));
  }
  out.map = filter.map();
  out.report.scalars = filter.scalars();
  out.report.nonzeros = static_cast<std::int64_t>(out.report.scalars) * out.report.scalars;
  return out;
}

template class EkfJoin<2>;
template class EkfJoin<3>;
template FilterResult<2> ekf_join<2>(std::span<const LocalMap<2>>, const ProgressCallback&);
template FilterResult<3> ekf_join<3>(std::span<const LocalMap<3>>, const ProgressCallback&);

}  // namespace mapjoin
