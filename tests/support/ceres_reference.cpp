#include "tests/support/ceres_reference.h"

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <Eigen/Dense>
#include <algorithm>
#include <map>
#include <memory>

#include "mapjoin/graph/index.h"
#include "mapjoin/graph/symmetric.h"
#include "tests/support/dense.h"

namespace mapjoin::test {

namespace {

template <int D>
using StateOf = typename CeresReference<D>::State;
template <int D>
using ObservationOf = typename CeresReference<D>::Observation;

template <int D>
int dim(const Key& key) {
  return key.type == Tag("pose") ? D + CeresReference<D>::kTurn : D;
}
template <int D>
StateOf<D> state(const Key& key, const double* x) {
  StateOf<D> out;
  out.pose = key.type == Tag("pose");
  if (out.pose) {
    out.R = reinterpret_cast<const Rigid<D>*>(x)->R;
    out.t = reinterpret_cast<const Rigid<D>*>(x)->t;
  } else {
    out.t = *reinterpret_cast<const Vec<D>*>(x);
  }
  return out;
}
Eigen::MatrixXd root_of(const Eigen::MatrixXd& I) {
  const Spectrum found = spectrum(I);
  return found.values.cwiseMax(0.0).cwiseSqrt().asDiagonal() * found.vectors.transpose();
}

/// Increments of an anchor and of terms, about the values given.
template <int D>
struct Residual {
  using State = StateOf<D>;
  static constexpr int kTurn = CeresReference<D>::kTurn;

  std::vector<State> base;  // of each parameter block, the anchor's first
  std::vector<int> block;   // of each term
  const ObservationOf<D>* observation;

  template <class T>
  using Matrix = Eigen::Matrix<T, D, D>;
  template <class T>
  using Vector = Eigen::Matrix<T, D, 1>;

  template <class T>
  static void retract(const State& x, const T* d, Matrix<T>& R, Vector<T>& t) {
    const Matrix<T> base = x.R.template cast<T>();
    const Eigen::Map<const Vector<T>> rho(d);
    R = base;
    t = x.t.template cast<T>();
    if (!x.pose) {
      t += rho;
      return;
    }
    t += base * rho;
    Matrix<T> turn;
    if constexpr (D == 2) {
      using std::cos;
      using std::sin;
      turn << cos(d[2]), -sin(d[2]), sin(d[2]), cos(d[2]);
    } else {
      ceres::AngleAxisToRotationMatrix(d + 3, turn.data());
    }
    R = base * turn;
  }
  /// The frame of the anchor in that of the estimate: a pose's, or (B.2) and (B.3) of Linear
  /// SLAM.
  template <class T>
  void frame(T const* const* d, Matrix<T>& R, Vector<T>& t) const {
    retract(base[0], d[0], R, t);
    if (base[0].pose) return;
    Matrix<T> unused;
    Vector<T> x, y;
    retract(base[1], d[1], unused, x);
    const Vector<T> v1 = x - t;
    if constexpr (D == 2) {
      const T norm = v1.norm();
      R << v1(0) / norm, -v1(1) / norm, v1(1) / norm, v1(0) / norm;
    } else {
      retract(base[2], d[2], unused, y);
      const Vector<T> v3 = v1.cross(y - t);
      const Vector<T> v2 = v3.cross(v1);
      R.col(0) = v1 / v1.norm();
      R.col(1) = v2 / v2.norm();
      R.col(2) = v3 / v3.norm();
    }
  }
  template <class T>
  bool operator()(T const* const* d, T* out) const {
    Matrix<T> Ra, R;
    Vector<T> ta, t;
    frame(d, Ra, ta);
    Eigen::Matrix<T, Eigen::Dynamic, 1> r(observation->root.cols());
    Eigen::Index row = 0;
    for (std::size_t k = 0; k < block.size(); ++k) {
      const State& z = observation->measured[k];
      retract(base[at(block[k])], d[block[k]], R, t);
      const Vector<T> seen = Ra.transpose() * (t - ta) - z.t.template cast<T>();
      if (!z.pose) {
        r.template segment<D>(row) = seen;
        row += D;
        continue;
      }
      r.template segment<D>(row) = z.R.transpose().template cast<T>() * seen;
      row += D;
      const Matrix<T> turn = z.R.transpose().template cast<T>() * Matrix<T>(Ra.transpose() * R);
      if constexpr (D == 2) {
        using std::atan2;
        r(row) = atan2(turn(1, 0), turn(0, 0));
      } else {
        ceres::RotationMatrixToAngleAxis(turn.data(), &r(row));
      }
      row += kTurn;
    }
    Eigen::Map<Eigen::Matrix<T, Eigen::Dynamic, 1>> result(out, r.size());
    for (Eigen::Index i = 0; i < r.size(); ++i) {
      result(i) = T(0.0);
      for (Eigen::Index j = 0; j < r.size(); ++j) result(i) += observation->root(i, j) * r(j);
    }
    return true;
  }
};

template <int D>
struct Problem {
  ceres::Problem ceres;
  Values<D> base;
  std::vector<Key> keys;
  std::map<Key, std::vector<double>> increments;

  Problem(const std::vector<ObservationOf<D>>& observations, const Values<D>& x) : base(x) {
    for (int i = 0; i < x.size(); ++i) {
      keys.push_back(x.variables().key(i));
      increments[keys.back()].assign(at(dim<D>(keys.back())), 0.0);
      ceres.AddParameterBlock(block(keys.back()), dim<D>(keys.back()));
    }
    for (const ObservationOf<D>& o : observations) add(o);
  }
  double* block(const Key& key) { return increments.at(key).data(); }
  void add(const ObservationOf<D>& o) {
    auto residual = std::make_unique<Residual<D>>();
    residual->observation = &o;
    std::vector<Key> blocks = o.anchor;
    for (const Key& key : o.terms) {
      auto found = std::find(blocks.begin(), blocks.end(), key);
      if (found == blocks.end()) found = blocks.insert(blocks.end(), key);
      residual->block.push_back(static_cast<int>(found - blocks.begin()));
    }
    std::vector<double*> pointers;
    for (const Key& key : blocks) {
      residual->base.push_back(state<D>(key, base.value(*base.variables().find(key))));
      pointers.push_back(block(key));
    }
    auto* const cost = new ceres::DynamicAutoDiffCostFunction<Residual<D>, 6>(residual.release());
    for (const Key& key : blocks) cost->AddParameterBlock(dim<D>(key));
    cost->SetNumResiduals(static_cast<int>(o.root.rows()));
    ceres.AddResidualBlock(cost, nullptr, pointers);
  }
  Values<D> result() {
    for (std::size_t i = 0; i < keys.size(); ++i) {
      const int number = static_cast<int>(i);
      Eigen::Matrix<double, D, D> R;
      Eigen::Matrix<double, D, 1> t;
      Residual<D>::retract(state<D>(keys[i], base.value(number)), block(keys[i]), R, t);
      if (keys[i].type == Tag("pose")) {
        Rigid<D> pose;
        pose.R = R;
        pose.t = t;
        base.template set<PoseType<D>>(number, pose);
      } else {
        base.template set<PointType<D>>(number, t);
      }
    }
    return base;
  }
};

}  // namespace

template <int D>
void CeresReference<D>::add(const LocalMap<D>& map) {
  Observation out;
  out.anchor = map.anchor.keys;
  const double* x = map.values.data();
  for (std::size_t k = 0; k < map.keys.size(); ++k) {
    out.terms.push_back(map.keys[k]);
    out.measured.push_back(state<D>(map.keys[k], x));
    x += map.kinds[k]->value_size;
  }
  out.root = root_of(map.information.dense());
  observations_.push_back(std::move(out));
}

template <int D>
void CeresReference<D>::add(const MeasurementGraph<D>& graph) {
  for (const auto& c : graph.relative) {
    for (std::size_t k = 0; k < c.size(); ++k) {
      Observation out;
      out.anchor = {graph.variables.key(c.from[k])};
      out.terms = {graph.variables.key(c.to[k])};
      out.measured = {state<D>(out.terms[0], c.z.data() + k * at(c.kind->value_size))};
      out.root = root_of(Eigen::Map<const Eigen::MatrixXd>(
          c.info.data() + k * at(c.kind->dim * c.kind->dim), c.kind->dim, c.kind->dim));
      observations_.push_back(std::move(out));
    }
  }
  const auto& maps = graph.submaps;
  for (std::size_t m = 0; m < maps.size(); ++m) {
    Observation out;
    for (auto a = at(maps.anchor_start[m]); a < at(maps.anchor_start[m + 1]); ++a)
      out.anchor.push_back(graph.variables.key(maps.anchor_variables[a]));
    std::vector<int> first{0};
    for (auto t = at(maps.term_start[m]); t < at(maps.term_start[m + 1]); ++t) {
      out.terms.push_back(graph.variables.key(maps.term_variable[t]));
      out.measured.push_back(state<D>(out.terms.back(), maps.values.data() + maps.term_value[t]));
      first.push_back(first.back() + dim<D>(out.terms.back()));
    }
    Eigen::MatrixXd I = Eigen::MatrixXd::Zero(first.back(), first.back());
    for (auto b = at(maps.block_start[m]); b < at(maps.block_start[m + 1]); ++b) {
      const int i = first[at(maps.block_row[b])], j = first[at(maps.block_column[b])];
      const int rows = first[at(maps.block_row[b]) + 1] - i;
      const int columns = first[at(maps.block_column[b]) + 1] - j;
      const Eigen::Map<const Eigen::MatrixXd> block(maps.information.data() + maps.block_value[b],
                                                    rows, columns);
      I.block(i, j, rows, columns) = block;
      if (i != j) I.block(j, i, columns, rows) = block.transpose();
    }
    out.root = root_of(I);
    observations_.push_back(std::move(out));
  }
}

template <int D>
Values<D> CeresReference<D>::minimise(Values<D> start, const Key& held) const {
  for (int round = 0; round < 2; ++round) {  // again about the result: increments are then 0
    Problem<D> problem(observations_, start);
    problem.ceres.SetParameterBlockConstant(problem.block(held));
    ceres::Solver::Options options;
    options.linear_solver_type =
        start.size() < 40 ? ceres::DENSE_QR : ceres::SPARSE_NORMAL_CHOLESKY;
    options.max_num_iterations = 200;
    options.function_tolerance = 1e-16;
    options.gradient_tolerance = 1e-14;
    options.parameter_tolerance = 1e-15;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem.ceres, &summary);
    start = problem.result();
  }
  if (start.size() < 40) polish(start, held);
  return start;
}

template <int D>
typename CeresReference<D>::Normal CeresReference<D>::normal_equations(const Values<D>& x) const {
  Problem<D> problem(observations_, x);
  ceres::Problem::EvaluateOptions options;
  for (const Key& key : problem.keys) options.parameter_blocks.push_back(problem.block(key));
  ceres::CRSMatrix crs;
  std::vector<double> residuals;
  Normal out;
  problem.ceres.Evaluate(options, &out.chi2, &residuals, nullptr, &crs);
  out.chi2 *= 2.0;
  Eigen::MatrixXd J = Eigen::MatrixXd::Zero(crs.num_rows, crs.num_cols);
  for (int r = 0; r < crs.num_rows; ++r) {
    for (int k = crs.rows[at(r)]; k < crs.rows[at(r) + 1]; ++k)
      J(r, crs.cols[at(k)]) = crs.values[at(k)];
  }
  const Eigen::Map<const Eigen::VectorXd> r(residuals.data(),
                                            static_cast<Eigen::Index>(residuals.size()));
  out.H = J.transpose() * J;
  out.b = -J.transpose() * r;
  return out;
}

template <int D>
double CeresReference<D>::chi2(const Values<D>& x) const {
  Problem<D> problem(observations_, x);
  double cost = 0.0;
  problem.ceres.Evaluate({}, &cost, nullptr, nullptr, nullptr);
  return 2.0 * cost;
}

/// Ceres stops where the cost no longer changes, which is half the digits of the values: go on by
/// Gauss-Newton steps from its Jacobians.
template <int D>
void CeresReference<D>::polish(Values<D>& x, const Key& held) const {
  const int first = x.variables().offset(x.variables().require(held, "held"));
  double last = 1.0;
  for (int step = 0; step < 30; ++step) {
    Normal normal = normal_equations(x);
    for (int s = first; s < first + dim<D>(held); ++s) {
      normal.H.row(s).setZero();
      normal.H.col(s).setZero();
      normal.H(s, s) = 1.0;
      normal.b(s) = 0.0;
    }
    const Eigen::VectorXd d = dense_solve(normal.H, normal.b);
    const double size = d.cwiseAbs().maxCoeff();
    if (!(size < last)) return;
    last = size;
    x.retract({d.data(), at(d.size())});
  }
}

template class CeresReference<2>;
template class CeresReference<3>;

}  // namespace mapjoin::test
