#include "mapjoin/association/candidates.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

#include "mapjoin/evaluation/chi_squared.h"
#include "mapjoin/frames/anchors.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/graph/builtin_types.h"
#include "mapjoin/graph/dense.h"
#include "mapjoin/graph/index.h"
#include "mapjoin/graph/symmetric.h"
#include "mapjoin/joining/common_points.h"
#include "mapjoin/solvers/covariance.h"
#include "mapjoin/solvers/relative.h"

namespace mapjoin {

namespace {

/// The lowest pose of both, or the one where B starts if A has it.
template <int D>
std::optional<Key> common_pose(const Map<D>& a, const Map<D>& b) {
  if (is_pose_anchor(b.anchor) && a.variables().find(b.anchor.keys[0])) return b.anchor.keys[0];
  const int c = b.variables().find_column(Tag("pose"));
  if (c < 0) return std::nullopt;
  for (const Key& key : b.variables().column(c).keys) {
    if (a.variables().find(key)) return key;
  }
  return std::nullopt;
}

/// Variables of one type on their way to pairs: what the sweep needs to know of each.
template <int D>
struct Spots {
  std::vector<int> variables;
  std::vector<Vec<D>> positions;  ///< empty for a type that has none
  std::vector<double> variance;   ///< largest eigenvalue of the covariance of the position
};

/// Positions alone.
template <int D>
Spots<D> places_of(const Map<D>& map, std::vector<int> variables) {
  Spots<D> out;
  out.variables = std::move(variables);
  for (const int i : out.variables) {
    const int zero = 0;
    Vec<D> p;
    map.variables().kind(i).positions(map.values.value(i), &zero, 1, p.data());
    out.positions.push_back(p);
  }
  out.variance.assign(out.variables.size(), 0.0);
  return out;
}

template <int D>
Spots<D> spots_of(const Map<D>& map, const Covariance<D>& covariance, std::vector<int> variables) {
  if (variables.empty() || !map.variables().kind(variables[0]).has_position)
    return {std::move(variables), {}, {}};
  Spots<D> out = places_of(map, std::move(variables));
  const CovarianceBlocks blocks = covariance.blocks(out.variables);
  for (std::size_t k = 0; k < out.variables.size(); ++k) {
    const Mat<D, D> S = position_covariance(map.values, out.variables[k], blocks.block(k));
    out.variance[k] = std::max(0.0, eigenvalues(S)(D - 1));
  }
  return out;
}

/// Of points, the density at which the nearest neighbour is as far as half of them have theirs:
/// 1 / (4 d^2) in the plane, where d is its mean; 0.17 / d^3 in space. 0 for fewer than two.
template <int D>
double density_of_points(const Values<D>& values) {
  const std::span<const Vec<D>> points = values.template column<PointType<D>>();
  std::vector<double> nearest;
  for (std::size_t k = 0; k < points.size(); ++k) {
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t l = 0; l < points.size(); ++l) {
      if (l != k) least = std::min(least, (points[k] - points[l]).norm());
    }
    if (std::isfinite(least) && least > 0.0) nearest.push_back(least);
  }
  if (nearest.empty()) return 0.0;
  std::nth_element(nearest.begin(),
                   nearest.begin() + static_cast<std::ptrdiff_t>(nearest.size() / 2),
                   nearest.end());
  const double d = nearest[nearest.size() / 2];
  return D == 2 ? 0.25 / (d * d) : 0.17 / (d * d * d);
}

using NumberPairs = std::vector<std::pair<int, int>>;  // (b, a)

/// All pairs near enough, by a sweep along x. `reach(va, vb)` is the farthest that a pair with
/// these variances may be apart.
template <int D, class Reach>
void sweep(const Spots<D>& a, const Spots<D>& b, const Reach& reach, NumberPairs& out) {
  std::vector<std::size_t> order(a.variables.size());
  for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
  std::sort(order.begin(), order.end(), [&](std::size_t k, std::size_t l) {
    return std::pair(a.positions[k](0), k) < std::pair(a.positions[l](0), l);
  });
  double widest = 0.0;
  for (const double v : a.variance) widest = std::max(widest, v);
  for (std::size_t j = 0; j < b.variables.size(); ++j) {
    const double x = b.positions[j](0);
    const double window = reach(widest, b.variance[j]);
    auto k =
        std::lower_bound(order.begin(), order.end(), x - window,
                         [&](std::size_t l, double least) { return a.positions[l](0) < least; });
    for (; k != order.end() && a.positions[*k](0) <= x + window; ++k) {
      if ((a.positions[*k] - b.positions[j]).norm() <= reach(a.variance[*k], b.variance[j]))
        out.emplace_back(b.variables[j], a.variables[*k]);
    }
  }
}

/// Numbers of the variables of a column of `map` that the other map does not know by key.
template <int D>
std::vector<int> unknown_in(const typename VariableSet<D>::Column& column,
                            const std::vector<int>& in_other) {
  std::vector<int> out;
  for (int i = column.first; i < column.end(); ++i) {
    if (in_other[at(i)] < 0) out.push_back(i);
  }
  return out;
}

/// Sorted, once each.
std::vector<int> distinct(std::vector<int> numbers) {
  std::sort(numbers.begin(), numbers.end());
  numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
  return numbers;
}

template <int D>
class PairMaker {
 public:
  explicit PairMaker(const ComparedMaps<D>& maps)
      : maps_(maps), covariance_a_(maps.a), covariance_b_(maps.b) {}

  CandidatePairs known() const {
    NumberPairs pairs;
    const std::vector<int> there = numbers_in(maps_.b.variables(), maps_.a.variables());
    for (int j = 0; j < maps_.b.values.size(); ++j) {
      if (there[at(j)] >= 0 && !pinned_whole(maps_.b.variables().key(j)))
        pairs.emplace_back(j, there[at(j)]);
    }
    return make(pairs, static_cast<int>(pairs.size()));
  }

  CandidatePairs candidates(const CandidateOptions& options) const {
    NumberPairs near;
    const std::vector<int> b_in_a = numbers_in(maps_.b.variables(), maps_.a.variables());
    const std::vector<int> a_in_b = numbers_in(maps_.a.variables(), maps_.b.variables());
    for (const auto& column : maps_.b.variables().columns()) {
      const int c = maps_.a.variables().find_column(column.kind->tag);
      if (c < 0 || !may_be_matched(*column.kind, options)) continue;
      find_near(unknown_in<D>(maps_.a.variables().column(c), a_in_b), unknown_in<D>(column, b_in_a),
                options, near);
    }
    CandidatePairs out = known();
    NumberPairs all;
    for (const CandidatePairs::Pair& pair : out.pairs) all.emplace_back(pair.b, pair.a);
    std::sort(near.begin(), near.end());
    all.insert(all.end(), near.begin(), near.end());
    out = within_gate(make(all, out.known), options.gate);
    set_density(out, options.density);
    return out;
  }

 private:
  /// A pose, or the point at the origin: no uncertainty is left of it, and no innovation.
  bool pinned_whole(const Key& key) const {
    return !maps_.b.anchor.keys.empty() && key == maps_.b.anchor.keys[0] &&
           key == maps_.a.anchor.keys[0];
  }

  void find_near(std::vector<int> a, std::vector<int> b, const CandidateOptions& options,
                 NumberPairs& out) const {
    if (a.empty() || b.empty()) return;
    if (!maps_.a.variables().kind(a[0]).has_position) {
      for (const int j : b) {
        for (const int i : a) out.emplace_back(j, i);
      }
      return;
    }
    const double gate = chi_squared_quantile(options.gate, maps_.a.variables().dim(a[0]));
    const double farthest = options.max_distance;
    if (farthest > 0.0) a = within(farthest, std::move(a), b);
    sweep(
        spots_of(maps_.a, covariance_a_, std::move(a)),
        spots_of(maps_.b, covariance_b_, std::move(b)),
        [&](double va, double vb) {
          const double reach = std::sqrt(gate * (va + vb));
          return farthest > 0.0 ? std::min(farthest, reach) : reach;
        },
        out);
  }

  /// Of these variables of A, those so near to one of B: the covariances of others are not needed.
  std::vector<int> within(double farthest, std::vector<int> a, const std::vector<int>& b) const {
    NumberPairs near;
    sweep(
        places_of(maps_.a, std::move(a)), places_of(maps_.b, b),
        [&](double, double) { return farthest; }, near);
    std::vector<int> out;
    for (const auto& [j, i] : near) out.push_back(i);
    return distinct(std::move(out));
  }

  /// Innovations and joint covariances of pairs (b, a), the first `known` of them known.
  CandidatePairs make(const NumberPairs& numbers, int known) const;
  CandidatePairs within_gate(CandidatePairs pairs, double probability) const;
  void set_density(CandidatePairs& pairs, double of_points) const;

  const ComparedMaps<D>& maps_;
  Covariance<D> covariance_a_, covariance_b_;
};

/// The first row of each of the variables in a joint covariance; -1 for others.
template <int D>
std::vector<int> rows_of(const VariableSet<D>& all, const std::vector<int>& variables) {
  std::vector<int> out(at(all.size()), -1);
  int row = 0;
  for (const int i : variables) {
    out[at(i)] = row;
    row += all.dim(i);
  }
  return out;
}

template <int D>
Eigen::MatrixXd joint(const Covariance<D>& covariance, const std::vector<int>& variables) {
  return symmetric_part(covariance.between(variables, variables));
}

template <int D>
CandidatePairs PairMaker<D>::make(const NumberPairs& numbers, int known) const {
  CandidatePairs out;
  out.known = known;
  std::vector<int> in_a, in_b;
  for (const auto& [b, a] : numbers) {
    in_a.push_back(a);
    in_b.push_back(b);
  }
  in_a = distinct(std::move(in_a));
  in_b = distinct(std::move(in_b));
  const std::vector<int> row_a = rows_of(maps_.a.variables(), in_a);
  const std::vector<int> row_b = rows_of(maps_.b.variables(), in_b);
  out.covariance_a = joint(covariance_a_, in_a);
  out.covariance_b = joint(covariance_b_, in_b);
  int row = 0;
  for (const auto& [b, a] : numbers) {
    const int dim = maps_.a.variables().dim(a);
    out.pairs.push_back(
        {a, b, dim, row, row_a[at(a)], row_b[at(b)], static_cast<std::int64_t>(out.slopes.size())});
    out.slopes.resize(out.slopes.size() + at(dim) * at(dim));
    row += dim;
  }
  out.innovations.resize(row);
  for (const CandidatePairs::Pair& pair : out.pairs) {
    const VariableKind<D>& kind = maps_.a.variables().kind(pair.a);
    const double* const xa = maps_.a.values.value(pair.a);
    const double* const xb = maps_.b.values.value(pair.b);
    kind.local(xb, xa, 1, out.innovations.data() + pair.row);
    kind.local_jacobian(xb, xa, 1, out.slopes.data() + pair.slope);
  }
  return out;
}

template <int D>
CandidatePairs PairMaker<D>::within_gate(CandidatePairs pairs, double probability) const {
  int widest = 0;
  for (const CandidatePairs::Pair& pair : pairs.pairs) widest = std::max(widest, pair.dim);
  std::vector<double> gates{0.0};
  for (int n = 1; n <= widest; ++n) gates.push_back(chi_squared_quantile(probability, n));
  NumberPairs kept;
  for (int p = 0; p < pairs.size(); ++p) {
    const CandidatePairs::Pair& pair = pairs.pairs[at(p)];
    const Eigen::VectorXd r = pairs.innovation(p);
    const auto distance = [&] {
      return r.dot(Eigen::VectorXd(solve_definite(pairs.covariance(p, p), r)));
    };
    if (p < pairs.known || distance() <= gates[at(pair.dim)]) kept.emplace_back(pair.b, pair.a);
  }
  if (kept.size() < pairs.pairs.size()) pairs = make(kept, pairs.known);
  pairs.gates = std::move(gates);
  return pairs;
}

template <int D>
void PairMaker<D>::set_density(CandidatePairs& pairs, double of_points) const {
  if (of_points <= 0.0) of_points = density_of_points<D>(maps_.b.values);
  if (of_points <= 0.0) of_points = density_of_points<D>(maps_.a.values);
  for (int p = 0; p < pairs.size(); ++p) {
    const CandidatePairs::Pair& pair = pairs.pairs[at(p)];
    if (of_points > 0.0 && maps_.a.variables().kind(pair.a).tag == Tag("point")) {
      pairs.log_density.push_back(std::log(of_points));
      continue;
    }
    double sum = -0.5 * pairs.gate_of(p);  // log N(r; 0, S) at the gate
    for (const double d : pivots_of(pairs.covariance(p, p)))
      sum -=
          0.5 * std::log(2.0 * std::numbers::pi * std::max(d, std::numeric_limits<double>::min()));
    pairs.log_density.push_back(sum);
  }
}

}  // namespace

Eigen::MatrixXd CandidatePairs::covariance(int p, int q) const {
  const Pair& x = pairs[at(p)];
  const Pair& y = pairs[at(q)];
  const Eigen::Map<const Eigen::MatrixXd> Jx(slopes.data() + x.slope, x.dim, x.dim);
  const Eigen::Map<const Eigen::MatrixXd> Jy(slopes.data() + y.slope, y.dim, y.dim);
  return times(times(Jx, covariance_a.block(x.row_a, y.row_a, x.dim, y.dim)), Jy.transpose()) +
         covariance_b.block(x.row_b, y.row_b, x.dim, y.dim);
}

Eigen::MatrixXd CandidatePairs::covariance_with(int q) const {
  const Pair& y = pairs[at(q)];
  const Eigen::Map<const Eigen::MatrixXd> Jy(slopes.data() + y.slope, y.dim, y.dim);
  const Eigen::MatrixXd of_a = times(covariance_a.middleCols(y.row_a, y.dim), Jy.transpose());
  Eigen::MatrixXd out(innovations.size(), y.dim);
  for (int c = 0; c < y.dim; ++c) {
    for (const Pair& x : pairs) {
      const double* const Jx = slopes.data() + x.slope;
      for (int r = 0; r < x.dim; ++r) {
        double sum = 0.0;
        for (int k = 0; k < x.dim; ++k) sum += Jx[k * x.dim + r] * of_a(x.row_a + k, c);
        out(x.row + r, c) = sum + covariance_b(x.row_b + r, y.row_b + c);
      }
    }
  }
  return out;
}

template <int D>
bool may_be_matched(const VariableKind<D>& kind, const CandidateOptions& options) {
  if (options.types.empty())
    return kind.tag != Tag("pose") && kind.action != FrameAction::kInvariant;
  return std::find(options.types.begin(), options.types.end(), kind.tag) != options.types.end();
}

template <int D>
ComparedMaps<D> in_common_frame(const Map<D>& a, const Map<D>& b) {
  if (const auto pose = common_pose(a, b)) {
    const Anchor<D> anchor = pose_anchor<D>(*pose);
    return {change_frame(a, anchor), change_frame(b, anchor)};
  }
  const Map<D>* const both[2] = {&a, &b};
  if (const auto points = common_points<D>(both))
    return {change_frame(a, points->anchor), change_frame(b, points->anchor)};
  throw DisconnectedError(fmt::format(
      "the maps share by key neither a pose nor {}, so nothing says where one lies in the other; "
      "find such points by their constellation first (place_by_constellations)",
      D == 2 ? "two points that both can tell apart" : "three points that both can tell apart"));
}

template <int D>
CandidatePairs common_pairs(const ComparedMaps<D>& maps) {
  return PairMaker<D>(maps).known();
}

template <int D>
CandidatePairs candidate_pairs(const ComparedMaps<D>& maps, const CandidateOptions& options) {
  return PairMaker<D>(maps).candidates(options);
}

#define MAPJOIN_INSTANTIATE(D)                                                      \
  template bool may_be_matched<D>(const VariableKind<D>&, const CandidateOptions&); \
  template ComparedMaps<D> in_common_frame<D>(const Map<D>&, const Map<D>&);        \
  template CandidatePairs common_pairs<D>(const ComparedMaps<D>&);                  \
  template CandidatePairs candidate_pairs<D>(const ComparedMaps<D>&, const CandidateOptions&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
