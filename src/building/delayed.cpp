#include "mapjoin/building/delayed.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "mapjoin/graph/symmetric.h"

namespace mapjoin {

namespace {

constexpr int kHypotheses = 24;  // of each of at most kSources measurements
constexpr int kSources = 5;
constexpr int kIterations = 30;
constexpr double kWorseBy = 25.0;       // chi2 of another place
constexpr double kRelativeSigma = 0.2;  // of the distance
constexpr double kLinear = 1.0;         // chi2 two deviations away is 4 but for this

/// A minimum of chi2 over one feature, the poses held.
struct Minimum {
  std::vector<double> value;
  double chi2 = 0.0;
  double sigma = 0.0;         ///< worst direction, metres
  std::vector<double> worst;  ///< that direction, a unit tangent
};

// Without allocation: no model has more than 16 numbers (measurement_model.h).
using Residual = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 16, 1>;
using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 16, 16>;
using Jacobian = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor, 16, 16>;

/// All measurements of one feature.
template <int D>
class Feature {
 public:
  Feature(const LocalProblem<D>& problem, const std::vector<int>& measurements,
          const Values<D>& values)
      : problem_(problem),
        measurements_(measurements),
        values_(values),
        kind_(*problem.measurements[static_cast<std::size_t>(measurements[0])].model->target) {}

  std::optional<std::vector<double>> place() const {
    std::vector<Minimum> minima;
    const std::size_t step = std::max<std::size_t>(1, measurements_.size() / kSources);
    for (std::size_t s = 0; s < measurements_.size(); s += step) {
      for (std::vector<double>& start : best_hypotheses(measurements_[s])) {
        if (auto minimum = refined(std::move(start))) minima.push_back(std::move(*minimum));
      }
    }
    if (minima.empty()) return std::nullopt;
    const auto best =
        std::min_element(minima.begin(), minima.end(),
                         [](const Minimum& a, const Minimum& b) { return a.chi2 < b.chi2; });
    const double distance = nearest_pose(best->value);
    if (best->sigma > kRelativeSigma * distance || !is_linear(*best)) return std::nullopt;
    for (const Minimum& other : minima) {
      if (other.chi2 > best->chi2 + kWorseBy) continue;
      const double apart = (position(other.value) - position(best->value)).norm();
      if (apart > 3.0 * best->sigma + 1e-6 * distance) return std::nullopt;
    }
    return best->value;
  }

 private:
  const LocalMeasurement<D>& measurement(int k) const {
    return problem_.measurements[static_cast<std::size_t>(k)];
  }
  const Rigid<D>& pose(int i) const { return values_.pose(i); }

  std::vector<double> hypothesis(int k, double u) const {
    const LocalMeasurement<D>& m = measurement(k);
    std::vector<double> x(static_cast<std::size_t>(kind_.value_size));
    m.model->hypothesis(m.z, u, x.data());
    kind_.transform(pose(m.from), x.data(), 1);
    return x;
  }
  /// Of all a measurement leaves open, what fits the others better than its neighbours do: one for
  /// each place where the feature may be.
  std::vector<std::vector<double>> best_hypotheses(int k) const {
    std::vector<std::vector<double>> all;
    std::vector<double> fits;
    for (int h = 0; h < kHypotheses; ++h) {
      all.push_back(hypothesis(k, (h + 0.5) / kHypotheses));
      const double chi2 = fit(all.back());
      fits.push_back(std::isfinite(chi2) ? chi2 : std::numeric_limits<double>::infinity());
    }
    std::vector<std::vector<double>> out;
    for (std::size_t h = 0; h < all.size(); ++h) {
      const bool low = h == 0 || fits[h] <= fits[h - 1];
      if (low && (h + 1 == all.size() || fits[h] <= fits[h + 1])) out.push_back(std::move(all[h]));
    }
    return out;
  }
  Vec<D> position(const std::vector<double>& x) const {
    const int zero = 0;
    Vec<D> p;
    kind_.positions(x.data(), &zero, 1, p.data());
    return p;
  }
  double nearest_pose(const std::vector<double>& x) const {
    const Vec<D> p = position(x);
    double least = std::numeric_limits<double>::infinity();
    for (const int k : measurements_)
      least = std::min(least, (p - pose(measurement(k).from).t).norm());
    return least;
  }

  double fit(const std::vector<double>& x) const {
    double sum = 0.0;
    for (const int k : measurements_) {
      const LocalMeasurement<D>& m = measurement(k);
      Residual r(m.model->dim);
      m.model->residual(m.z, values_.value(m.from), nullptr, x.data(), nullptr, r.data());
      sum += r.dot(Eigen::Map<const Eigen::MatrixXd>(m.info, r.size(), r.size()) * r);
    }
    return sum;
  }
  /// Is chi2 the parabola that the information says, as far as two standard deviations?
  bool is_linear(const Minimum& minimum) const {
    for (const double side : {-2.0, 2.0}) {
      std::vector<double> x = minimum.value;
      std::vector<double> d = minimum.worst;
      for (double& v : d) v *= side * minimum.sigma;
      kind_.retract(x.data(), d.data(), 1);
      if (!(std::abs(fit(x) - minimum.chi2 - 4.0) < kLinear)) return false;
    }
    return true;
  }

  /// H, b of the feature alone; \returns chi2.
  double linearize(const std::vector<double>& x, Square& H, Residual& b) const {
    const int n = kind_.dim;
    H = Square::Zero(n, n);
    b = Residual::Zero(n);
    double chi2 = 0.0;
    for (const int k : measurements_) {
      const LocalMeasurement<D>& m = measurement(k);
      Residual r(m.model->dim);
      Jacobian Jp(m.model->dim, kGauge<D>), Jx(m.model->dim, n);
      m.model->linearize(m.z, values_.value(m.from), nullptr, x.data(), nullptr, r.data(),
                         Jp.data(), Jx.data());
      const Eigen::Map<const Eigen::MatrixXd> info(m.info, m.model->dim, m.model->dim);
      const Residual Ir = info * r;
      const Jacobian IJ = info * Jx;
      H += Jx.transpose() * IJ;
      b -= Jx.transpose() * Ir;
      chi2 += r.dot(Ir);
    }
    return chi2;
  }

  /// Levenberg-Marquardt from a hypothesis. Nothing where it ends at no well-determined place.
  std::optional<Minimum> refined(std::vector<double> x) const {
    Square H, H_new;
    Residual b, b_new;
    double chi2 = linearize(x, H, b);
    double damping = 1e-3;
    for (int i = 0; i < kIterations && std::isfinite(chi2); ++i) {
      Square damped = H;
      damped.diagonal() *= 1.0 + damping;
      const Residual d = damped.ldlt().solve(b);
      if (!d.allFinite()) return std::nullopt;
      std::vector<double> next = x;
      kind_.retract(next.data(), d.data(), 1);
      const double after = linearize(next, H_new, b_new);
      if (std::isfinite(after) && after <= chi2) {
        const bool done = chi2 - after < 1e-6;
        x = std::move(next);
        chi2 = after;
        std::swap(H, H_new);
        std::swap(b, b_new);
        damping = std::max(1e-9, 0.1 * damping);
        if (done) break;
      } else {
        damping *= 10.0;
        if (damping > 1e8) break;
      }
    }
    if (!std::isfinite(chi2)) return std::nullopt;
    const Spectrum eigen = spectrum(H);
    const double weakest = eigen.values(0);
    if (!(weakest > 1e-12 * eigen.values.maxCoeff())) {
      return Minimum{std::move(x), chi2, std::numeric_limits<double>::infinity(), {}};
    }
    const Residual worst = eigen.vectors.col(0);
    return Minimum{std::move(x), chi2, 1.0 / std::sqrt(weakest),
                   std::vector<double>(worst.data(), worst.data() + worst.size())};
  }

  const LocalProblem<D>& problem_;
  const std::vector<int>& measurements_;
  const Values<D>& values_;
  const VariableKind<D>& kind_;
};

}  // namespace

template <int D>
std::vector<std::int64_t> place_delayed(const LocalProblem<D>& problem, InitialValues<D>& values) {
  std::vector<std::vector<int>> of(static_cast<std::size_t>(problem.variables.size()));
  for (std::size_t k = 0; k < problem.measurements.size(); ++k) {
    const auto to = static_cast<std::size_t>(problem.measurements[k].to);
    if (!values.known[to]) of[to].push_back(static_cast<int>(k));
  }
  std::vector<std::int64_t> refused;
  for (std::size_t i = 0; i < of.size(); ++i) {
    if (of[i].empty()) continue;
    const bool has_position = problem.variables.kind(static_cast<int>(i)).has_position;
    const auto place = has_position && of[i].size() > 1
                           ? Feature<D>(problem, of[i], values.values).place()
                           : std::nullopt;
    if (place) {
      std::copy(place->begin(), place->end(), values.values.value(static_cast<int>(i)));
      values.known[i] = 1;
      continue;
    }
    for (const int k : of[i])
      refused.push_back(problem.measurements[static_cast<std::size_t>(k)].number);
  }
  std::sort(refused.begin(), refused.end());
  return refused;
}

template std::vector<std::int64_t> place_delayed<2>(const LocalProblem<2>&, InitialValues<2>&);
template std::vector<std::int64_t> place_delayed<3>(const LocalProblem<3>&, InitialValues<3>&);

}  // namespace mapjoin
