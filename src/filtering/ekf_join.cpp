#include "mapjoin/filtering/ekf_join.h"

#include <fmt/format.h>

#include <cstring>
#include <optional>
#include <utility>

#include "mapjoin/frames/anchors.h"
#include "mapjoin/frames/gauge.h"
#include "mapjoin/graph/dense.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/graph/index.h"
#include "mapjoin/joining/join.h"
#include "mapjoin/joining/report.h"
#include "mapjoin/solvers/dense_blas.h"

namespace mapjoin {

namespace {

/// The covariance of what a map's frame leaves free, in the order of its variables.
template <int D>
Eigen::MatrixXd covariance_of(const Map<D>& map) {
  std::optional<Eigen::MatrixXd> out = inverse_of_definite(anchored_information(map).dense());
  if (!out)
    throw SingularError(fmt::format(
        "the local map of {} has no covariance: its information leaves some variable undetermined; "
        "a Kalman filter cannot take it",
        to_string(map.anchor)));
  return *std::move(out);
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

/// A local map beside the state and written in its frame.
template <int D>
struct EkfJoin<D>::Beside {
  Values<D> values;
  std::vector<int> rows;  ///< of each variable in P
  std::vector<int> twin;  ///< the same variable in the state, -1 where it is new
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
    rows_ = enter(estimate_.variables(), Eigen::MatrixXd(), P_local);
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

  Beside beside{without(local.values, begin), {}, {}};
  Values<D>& added = beside.values;
  const VariableSet<D>& variables = added.variables();
  beside.twin = numbers_in(variables, estimate_.variables());
  const Rigid<D> T = estimate_.pose(begin);
  Eigen::MatrixXd J(variables.scalars(), kGauge<D>);  // by the last pose
  Eigen::MatrixXd turned = P_local;
  // What the state has is linearised where the state has it, as any observation is; what is new,
  // where it was measured.
  const Rigid<D> back = T.inverse();
  for (int i = 0; i < added.size(); ++i) {
    const VariableKind<D>& kind = variables.kind(i);
    const int row = variables.offset(i);
    const int twin = beside.twin[at(i)];
    const double* const seen = twin < 0 ? added.value(i) : estimate_.value(twin);
    std::vector<double> x(seen, seen + kind.value_size);
    if (twin >= 0) kind.transform(back, x.data(), 1);
    const Eigen::MatrixXd turn = frame_jacobian(kind, T, x.data());
    Eigen::MatrixXd g(kind.dim, kGauge<D>);
    kind.gauge(x.data(), 1, g.data());
    J.middleRows(row, kind.dim) = times(turn, g);
    turned.middleRows(row, kind.dim) = times(turn, turned.middleRows(row, kind.dim));
    turned.middleCols(row, kind.dim) = times(turned.middleCols(row, kind.dim), turn.transpose());
  }
  added.transform(T);
  const Eigen::MatrixXd of_pose = P_.columns(rows_[at(*last)], kGauge<D>);
  turned += carried(J, of_pose.middleRows(rows_[at(*last)], kGauge<D>));
  beside.rows = enter(variables, times(of_pose, J.transpose()), turned);
  fusion.seconds_update = seconds_since(start);

  const auto updating = Clock::now();
  update(beside);
  keep(beside);
  fusion.seconds_factor = seconds_since(updating);
  fusion.scalars = scalars();
  ++fused_;
  return fusion;
}

/// Rows for variables whose joint covariance is `own`, and with the state so far `cross`.
template <int D>
std::vector<int> EkfJoin<D>::enter(const VariableSet<D>& variables, const Eigen::MatrixXd& cross,
                                   const Eigen::MatrixXd& own) {
  std::vector<int> rows;
  for (int i = 0; i < variables.size(); ++i) rows.push_back(P_.add(variables.dim(i)));
  for (int i = 0; i < variables.size(); ++i) {
    Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(P_.size(), variables.dim(i));
    if (cross.size() > 0)  // the first map enters an empty state
      columns.topRows(cross.rows()) = cross.middleCols(variables.offset(i), variables.dim(i));
    for (int j = 0; j < variables.size(); ++j)
      columns.middleRows(rows[at(j)], variables.dim(j)) =
          own.block(variables.offset(j), variables.offset(i), variables.dim(j), variables.dim(i));
    P_.set_columns(rows[at(i)], columns);
  }
  return rows;
}

/// The Kalman update by what is there twice: x_state - x_local = 0, without noise.
template <int D>
void EkfJoin<D>::update(Beside& beside) {
  const VariableSet<D>& variables = beside.values.variables();
  int rows = 0;
  for (int i = 0; i < variables.size(); ++i) rows += beside.twin[at(i)] < 0 ? 0 : variables.dim(i);
  if (rows == 0) return;
  Eigen::MatrixXd PC(P_.size(), rows);  // P C^T
  Eigen::MatrixXd CPC(rows, rows);
  Eigen::MatrixXd r(rows, 1);
  const auto for_common = [&](const auto& visit) {
    int row = 0;
    for (int i = 0; i < variables.size(); ++i) {
      const int twin = beside.twin[at(i)];
      if (twin < 0) continue;
      const VariableKind<D>& kind = variables.kind(i);
      Eigen::MatrixXd S(kind.dim, kind.dim);
      kind.local_jacobian(beside.values.value(i), estimate_.value(twin), 1, S.data());
      visit(i, twin, row, S);
      row += kind.dim;
    }
  };
  for_common([&](int i, int twin, int row, const Eigen::MatrixXd& S) {
    const int dim = variables.dim(i);
    variables.kind(i).local(beside.values.value(i), estimate_.value(twin), 1, r.data() + row);
    PC.middleCols(row, dim) = times(P_.columns(rows_[at(twin)], dim), S.transpose()) -
                              P_.columns(beside.rows[at(i)], dim);
  });
  for_common([&](int i, int twin, int row, const Eigen::MatrixXd& S) {
    const int dim = variables.dim(i);
    CPC.middleRows(row, dim) =
        times(S, PC.middleRows(rows_[at(twin)], dim)) - PC.middleRows(beside.rows[at(i)], dim);
  });
  if (factor_lower(CPC) >= 0) {
    for (int i = 0; i < variables.size(); ++i) P_.remove(beside.rows[at(i)], variables.dim(i));
    throw SingularError(
        "the state and the local map both claim to know a common feature exactly; a "
        "Kalman filter cannot make them equal");
  }
  solve_lower_right(CPC, PC);  // P C^T L^-T
  solve_lower_left(CPC, r);
  P_.subtract_square(PC);
  const Eigen::VectorXd d = -times(PC, r);
  move(estimate_, rows_, d);
  move(beside.values, beside.rows, d);
}

/// x [+] d, and P, which was about its base, in the tangents there.
template <int D>
void EkfJoin<D>::move(Values<D>& x, const std::vector<int>& rows, const Eigen::VectorXd& d) {
  const Values<D> before = x;
  std::vector<double> step;
  for (int i = 0; i < x.size(); ++i) {
    const double* const first = d.data() + rows[at(i)];
    step.insert(step.end(), first, first + x.variables().dim(i));
  }
  x.retract(step);
  for (int i = 0; i < x.size(); ++i) {
    const VariableKind<D>& kind = x.variables().kind(i);
    Eigen::MatrixXd S(kind.dim, kind.dim);
    kind.local_jacobian(before.value(i), x.value(i), 1, S.data());
    if (S.isIdentity(0.0)) continue;
    P_.turn(rows[at(i)], inverse_of(S));
  }
}

/// The features of both, once, and the poses of the local map.
template <int D>
void EkfJoin<D>::keep(const Beside& beside) {
  std::vector<int> features;
  for (int i = 0; i < estimate_.size(); ++i) {
    if (estimate_.variables().key(i).type != Tag("pose")) features.push_back(i);
  }
  const VariableSet<D> kept = subset(estimate_.variables(), features);
  const VariableSet<D>* const sets[] = {&kept, &beside.values.variables()};
  Values<D> out{unite<D>(sets)};
  const VariableSet<D>& all = out.variables();
  const std::vector<int> in_state = numbers_in(all, estimate_.variables());
  const std::vector<int> in_local = numbers_in(all, beside.values.variables());
  std::vector<int> rows(at(all.size()));
  std::vector<char> stays(at(estimate_.size()), 0);
  for (int i = 0; i < all.size(); ++i) {
    const int known = in_state[at(i)], seen = in_local[at(i)];
    const double* const x = known >= 0 ? estimate_.value(known) : beside.values.value(seen);
    std::memcpy(out.value(i), x, at(all.kind(i).value_size) * sizeof(double));
    rows[at(i)] = known >= 0 ? rows_[at(known)] : beside.rows[at(seen)];
    if (known >= 0) stays[at(known)] = 1;
    if (known >= 0 && seen >= 0) P_.remove(beside.rows[at(seen)], all.dim(i));
  }
  for (int i = 0; i < estimate_.size(); ++i) {
    if (stays[at(i)] == 0) P_.remove(rows_[at(i)], estimate_.variables().dim(i));
  }
  estimate_ = std::move(out);
  rows_ = std::move(rows);
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
  const std::optional<Eigen::MatrixXd> I = P_.information(scalar_rows());
  if (!I)
    throw SingularError(
        "the covariance matrix has lost its rank: some features are known to be "
        "where others are; there is no information matrix");
  // Into the rows of all variables: the start pose has none.
  std::vector<int> rows;
  const std::vector<int> place = numbers_in(estimate_.variables(), out.variables());
  for (int i = 0; i < estimate_.size(); ++i) {
    for (int s = 0; s < estimate_.variables().dim(i); ++s)
      rows.push_back(out.variables().offset(place[at(i)]) + s);
  }
  const Eigen::MatrixXd all = embedded(*I, rows, out.variables().scalars());
  out.information = complete_gauge(
      out.values, anchor_, SymmetricBlockMatrix::from_dense(out.variables().offsets(), all));
  return out;
}

template <int D>
Eigen::MatrixXd EkfJoin<D>::covariance(std::span<const Key> keys) const {
  std::vector<int> rows;   // in P
  std::vector<int> place;  // in the result
  int n = 0;
  for (const Key& key : keys) {
    if (fused_ > 0 && key == anchor_.keys[0]) {
      n += kGauge<D>;
      continue;
    }
    const int i = estimate_.variables().require(key, "covariance");
    for (int s = 0; s < estimate_.variables().dim(i); ++s) {
      rows.push_back(rows_[at(i)] + s);
      place.push_back(n++);
    }
  }
  return embedded(P_.of(rows), place, n);
}

/// Rows in P of all scalars of the estimate, in its order.
template <int D>
std::vector<int> EkfJoin<D>::scalar_rows() const {
  std::vector<int> out;
  for (int i = 0; i < estimate_.size(); ++i) {
    for (int s = 0; s < estimate_.variables().dim(i); ++s) out.push_back(rows_[at(i)] + s);
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
