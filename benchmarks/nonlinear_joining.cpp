#include "benchmarks/nonlinear_joining.h"

#include <Eigen/Dense>
#include <cmath>
#include <utility>

#include "mapjoin/frames/anchors.h"
#include "mapjoin/frames/gauge.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/solvers/sparse_cholesky.h"

namespace mapjoin::benchmarks {

namespace {

constexpr int kMostIterations = 50;
constexpr double kConverged = 1e-6;  // metres and radians: the largest number of a step

/// A variable of one of the maps at the current estimate: r, V = d r / d x, U = d r / d P_1.
struct Term {
  int place = 0;  ///< in the joint map
  Eigen::VectorXd r;
  Eigen::MatrixXd V, U;
};

template <int D>
Term first_term(const StartFrameMap<D>& map, int i, int place, const Values<D>& x) {
  const VariableKind<D>& kind = map.values.variables().kind(i);
  Term out{place, Eigen::VectorXd(kind.dim), Eigen::MatrixXd(kind.dim, kind.dim), {}};
  kind.local(map.values.value(i), x.value(place), 1, out.r.data());
  kind.local_jacobian(map.values.value(i), x.value(place), 1, out.V.data());
  return out;
}

/// The second map's: x' = P_1^-1 x, r = local(z, x'), U = -S g(x'), V = S D.
template <int D>
Term second_term(const StartFrameMap<D>& map, int i, int place, const Rigid<D>& into,
                 const Values<D>& x) {
  const VariableKind<D>& kind = map.values.variables().kind(i);
  const int n = kind.dim;
  Term out{place, Eigen::VectorXd(n), Eigen::MatrixXd(n, n), Eigen::MatrixXd(n, kGauge<D>)};
  std::vector<double> seen(x.value(place), x.value(place) + kind.value_size);
  Eigen::MatrixXd turn(n, n), S(n, n), g(n, kGauge<D>);
  kind.frame_jacobian(into, seen.data(), 1, turn.data());
  kind.transform(into, seen.data(), 1);
  kind.local(map.values.value(i), seen.data(), 1, out.r.data());
  kind.local_jacobian(map.values.value(i), seen.data(), 1, S.data());
  kind.gauge(seen.data(), 1, g.data());
  out.V = S * turn;
  out.U = -S * g;
  return out;
}

/// Adds J^T I J of a map to H and -J^T I r to b. `pivot`: the place of P_1, -1 for the first map.
void accumulate(const SymmetricBlockMatrix& I, const std::vector<Term>& terms, int pivot,
                SymmetricBlockMatrix& H, Eigen::VectorXd& b) {
  const auto add_pair = [&](const Term& s, const Term& t, const Eigen::MatrixXd& block) {
    // One ordered pair: s^T I t; the mirrored one is added by its own call.
    const Eigen::VectorXd Ir = block * t.r;
    b.segment(H.offset(s.place), s.V.cols()) -= s.V.transpose() * Ir;
    if (pivot < 0) return;
    b.segment(H.offset(pivot), s.U.cols()) -= s.U.transpose() * Ir;
    H.add(s.place, pivot, s.V.transpose() * block * t.U);
    H.add(pivot, pivot, s.U.transpose() * block * t.U);
  };
  for (int j = 0; j < I.size(); ++j) {
    for (std::int64_t slot = I.begin(j); slot < I.end(j); ++slot) {
      const Term& s = terms[static_cast<std::size_t>(I.row(slot))];
      const Term& t = terms[static_cast<std::size_t>(j)];
      if (s.place == pivot || t.place == pivot) continue;
      const Eigen::MatrixXd block =
          Eigen::Map<const Eigen::MatrixXd>(I.block(slot), I.dim(I.row(slot)), I.dim(j));
      H.add(s.place, t.place, s.V.transpose() * block * t.V);
      add_pair(s, t, block);
      if (&s != &t) add_pair(t, s, block.transpose());
    }
  }
}

template <int D>
Values<D> joint_estimate(const StartFrameMap<D>& first, const StartFrameMap<D>& second,
                         const std::vector<int>& places_1, const std::vector<int>& places_2,
                         VariableSet<D> variables) {
  Values<D> x(std::move(variables));
  Values<D> moved = second.values;
  moved.transform(first.values.pose(second.values.variables().key(second.start)));
  const auto copy = [&](const Values<D>& from, const std::vector<int>& places) {
    for (int i = 0; i < from.size(); ++i) {
      const int size = from.variables().kind(i).value_size;
      std::copy(from.value(i), from.value(i) + size, x.value(places[static_cast<std::size_t>(i)]));
    }
  };
  copy(moved, places_2);
  copy(first.values, places_1);
  return x;
}

}  // namespace

template <int D>
StartFrameMap<D> start_frame_map(const Map<D>& map) {
  if (!is_pose_anchor(map.anchor))
    throw InputError("nonlinear joining is of maps in the frames of their start poses");
  StartFrameMap<D> out{map.values, map.variables().require(map.anchor.keys[0], "anchor"),
                       map.information};
  const AnchorRows rows = anchor_rows(map.anchor, map.values);
  leave_out(out.information, rows.pinned);
  return out;
}

template <int D>
StartFrameMap<D> join_nonlinearly(const StartFrameMap<D>& first, const StartFrameMap<D>& second,
                                  NonlinearJoining& cost) {
  const VariableSet<D>& a = first.values.variables();
  const VariableSet<D>& b = second.values.variables();
  const VariableSet<D>* const both[] = {&a, &b};
  const VariableSet<D> variables = unite<D>(both);
  const std::vector<int> places_1 = numbers_in(a, variables);
  const std::vector<int> places_2 = numbers_in(b, variables);
  const int start = places_1[static_cast<std::size_t>(first.start)];
  const int pivot = places_2[static_cast<std::size_t>(second.start)];
  Values<D> x = joint_estimate(first, second, places_1, places_2, variables);

  std::vector<std::pair<int, int>> pairs;
  const auto add_pattern = [&](const SymmetricBlockMatrix& I, const std::vector<int>& places) {
    for (int j = 0; j < I.size(); ++j) {
      for (std::int64_t s = I.begin(j); s < I.end(j); ++s)
        pairs.emplace_back(places[static_cast<std::size_t>(I.row(s))],
                           places[static_cast<std::size_t>(j)]);
    }
  };
  add_pattern(first.information, places_1);
  add_pattern(second.information, places_2);
  for (const int place : places_2) pairs.emplace_back(place, pivot);
  SymmetricBlockMatrix H(variables.offsets(), pairs);
  std::vector<int> fixed;
  for (int k = 0; k < variables.dim(start); ++k) fixed.push_back(variables.offset(start) + k);
  SparseCholesky cholesky;
  cholesky.analyze(H, fixed);
  ++cost.joins;

  std::vector<Term> terms_1(static_cast<std::size_t>(a.size()));
  std::vector<Term> terms_2(static_cast<std::size_t>(b.size()));
  for (int iteration = 0; iteration < kMostIterations; ++iteration) {
    ++cost.iterations;
    Eigen::VectorXd rhs = Eigen::VectorXd::Zero(variables.scalars());
    std::fill(H.values().begin(), H.values().end(), 0.0);
    for (int i = 0; i < a.size(); ++i) {
      const auto k = static_cast<std::size_t>(i);
      terms_1[k] = first_term(first, i, places_1[k], x);
    }
    const Rigid<D> into = x.pose(variables.key(pivot)).inverse();
    for (int i = 0; i < b.size(); ++i) {
      const auto k = static_cast<std::size_t>(i);
      terms_2[k] = second_term(second, i, places_2[k], into, x);
    }
    accumulate(first.information, terms_1, -1, H, rhs);
    accumulate(second.information, terms_2, pivot, H, rhs);
    if (cholesky.factorize(H) >= 0)
      throw SingularError("the two maps do not determine their joint map");
    const Eigen::VectorXd d = cholesky.solve(rhs);
    x.retract({d.data(), static_cast<std::size_t>(d.size())});
    if (d.cwiseAbs().maxCoeff() < kConverged) break;
  }
  leave_out(H, fixed);
  return {std::move(x), start, std::move(H)};
}

template <int D>
StartFrameMap<D> join_all_nonlinearly(std::span<const Map<D>> maps, bool sequential,
                                      NonlinearJoining& cost) {
  std::vector<StartFrameMap<D>> level;
  for (const Map<D>& map : maps) level.push_back(start_frame_map(map));
  if (sequential) {
    StartFrameMap<D> all = std::move(level[0]);
    for (std::size_t k = 1; k < level.size(); ++k) all = join_nonlinearly(all, level[k], cost);
    return all;
  }
  while (level.size() > 1) {
    std::vector<StartFrameMap<D>> above;
    for (std::size_t k = 0; k + 1 < level.size(); k += 2)
      above.push_back(join_nonlinearly(level[k], level[k + 1], cost));
    if (level.size() % 2 == 1) above.push_back(std::move(level.back()));
    level = std::move(above);
  }
  return std::move(level[0]);
}

#define MAPJOIN_INSTANTIATE(D)                                                                    \
  template StartFrameMap<D> start_frame_map<D>(const Map<D>&);                                    \
  template StartFrameMap<D> join_nonlinearly<D>(const StartFrameMap<D>&, const StartFrameMap<D>&, \
                                                NonlinearJoining&);                               \
  template StartFrameMap<D> join_all_nonlinearly<D>(std::span<const Map<D>>, bool,                \
                                                    NonlinearJoining&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin::benchmarks
