#include "mapjoin/association/constellations.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "mapjoin/association/check_matches.h"
#include "mapjoin/evaluation/chi_squared.h"
#include "mapjoin/frames/align.h"
#include "mapjoin/graph/builtin_types.h"
#include "mapjoin/graph/index.h"
#include "mapjoin/graph/rename_keys.h"
#include "mapjoin/solvers/covariance.h"

namespace mapjoin {

namespace {

/// Three points, and the distances between them: side k is opposite corner k. Corners are in the
/// order of ascending sides, so that equal triangles have equal corners.
struct Triangle {
  std::array<int, 3> corners;
  std::array<double, 3> sides;
  std::array<double, 3> variances;  // of the sides
};

/// The points of a map and what is known of the distances between neighbours.
template <int D>
struct Sky {
  std::vector<Key> keys;
  std::vector<Vec<D>> points;
  std::vector<double> spacing;      // to the nearest
  std::vector<Triangle> triangles;  // ascending by the longest side
};

std::vector<int> nearest(const Eigen::VectorXd& distances, int self, int count) {
  std::vector<int> order;
  for (int k = 0; k < distances.size(); ++k) {
    if (k != self) order.push_back(k);
  }
  const auto wanted = std::min(at(count), order.size());
  std::partial_sort(
      order.begin(), order.begin() + static_cast<std::ptrdiff_t>(wanted), order.end(),
      [&](int k, int l) { return std::pair(distances(k), k) < std::pair(distances(l), l); });
  order.resize(wanted);
  return order;
}

template <int D>
Triangle triangle_of(const std::vector<Vec<D>>& points, const Eigen::MatrixXd& covariance,
                     std::array<int, 3> corners) {
  Triangle out;
  std::array<std::pair<double, int>, 3> opposite;  // (side, corner)
  for (std::size_t k = 0; k < 3; ++k) {
    const int i = corners[(k + 1) % 3], j = corners[(k + 2) % 3];
    opposite[k] = {(points[at(i)] - points[at(j)]).norm(), corners[k]};
  }
  std::sort(opposite.begin(), opposite.end());
  for (std::size_t k = 0; k < 3; ++k) {
    out.sides[k] = opposite[k].first;
    out.corners[k] = opposite[k].second;
  }
  for (std::size_t k = 0; k < 3; ++k) {
    const int i = out.corners[(k + 1) % 3], j = out.corners[(k + 2) % 3];
    const Eigen::Matrix<double, D, 1> u =
        (points[at(i)] - points[at(j)]) / std::max(out.sides[k], 1e-12);
    const auto block = [&](int x, int y) { return covariance.block<D, D>(x * D, y * D); };
    out.variances[k] = std::max(
        0.0, (u.transpose() * (block(i, i) + block(j, j) - block(i, j) - block(j, i)) * u).value());
  }
  return out;
}

template <int D>
Sky<D> sky_of(const Map<D>& map, int neighbours) {
  Sky<D> out;
  const int c = map.variables().find_column(Tag("point"));
  if (c < 0) return out;
  const auto& column = map.variables().column(c);
  std::vector<int> numbers;
  for (int i = column.first; i < column.end(); ++i) {
    numbers.push_back(i);
    out.keys.push_back(map.variables().key(i));
    out.points.push_back(map.values.point(out.keys.back()));
  }
  const Eigen::MatrixXd covariance = Covariance<D>(map).between(numbers, numbers);
  const auto n = static_cast<int>(out.points.size());
  std::vector<std::array<int, 3>> corners;
  for (int i = 0; i < n; ++i) {
    Eigen::VectorXd distances(n);
    for (int k = 0; k < n; ++k) distances(k) = (out.points[at(i)] - out.points[at(k)]).norm();
    const std::vector<int> near = nearest(distances, i, neighbours);
    out.spacing.push_back(near.empty() ? 0.0 : distances(near[0]));
    for (std::size_t k = 0; k < near.size(); ++k) {
      for (std::size_t l = k + 1; l < near.size(); ++l) {
        std::array<int, 3> t{i, near[k], near[l]};
        std::sort(t.begin(), t.end());
        corners.push_back(t);
      }
    }
  }
  std::sort(corners.begin(), corners.end());
  corners.erase(std::unique(corners.begin(), corners.end()), corners.end());
  for (const auto& t : corners) out.triangles.push_back(triangle_of<D>(out.points, covariance, t));
  std::sort(out.triangles.begin(), out.triangles.end(), [](const Triangle& x, const Triangle& y) {
    return std::pair(x.sides[2], x.corners) < std::pair(y.sides[2], y.corners);
  });
  return out;
}

/// Points sorted along x, to find the nearest to a place.
template <int D>
class NearestPoint {
 public:
  explicit NearestPoint(const std::vector<Vec<D>>& points) : points_(points) {
    for (std::size_t k = 0; k < points.size(); ++k) order_.push_back(static_cast<int>(k));
    std::sort(order_.begin(), order_.end(), [&](int k, int l) {
      return std::pair(points[at(k)](0), k) < std::pair(points[at(l)](0), l);
    });
  }
  /// The nearest within a distance; -1 where there is none.
  int operator()(const Vec<D>& place, double within) const {
    int best = -1;
    auto k = std::lower_bound(order_.begin(), order_.end(), place(0) - within,
                              [&](int l, double least) { return points_[at(l)](0) < least; });
    for (; k != order_.end() && points_[at(*k)](0) <= place(0) + within; ++k) {
      const double d = (points_[at(*k)] - place).norm();
      if (d > within) continue;
      best = *k;
      within = d;
    }
    return best;
  }

 private:
  const std::vector<Vec<D>>& points_;
  std::vector<int> order_;
};

double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto half = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), half, values.end());
  return *half;
}

template <int D>
class PlacementSearch {
 public:
  PlacementSearch(const Sky<D>& a, const Sky<D>& b, const ConstellationOptions& options)
      : a_(a), b_(b), gate_(std::sqrt(chi_squared_quantile(options.gate, 1))), near_(a.points) {
    spacing_ = median(a.spacing);
    within_ = 0.25 * spacing_;  // nearer to a point than halfway to any other, and twice that
    for (const Triangle& t : a.triangles) {
      for (std::size_t k = 0; k < 3; ++k) widest_ = std::max(widest_, t.variances[k]);
    }
  }

  struct Found {
    Rigid<D> a_from_b;
    std::vector<std::pair<int, int>> pairs;  // (b, a)
  };

  /// Looks at all triangles that agree.
  void run() {
    for (const Triangle& t : b_.triangles) {
      const double window = gate_ * std::sqrt(t.variances[2] + widest_);
      auto u = std::lower_bound(a_.triangles.begin(), a_.triangles.end(), t.sides[2] - window,
                                [](const Triangle& x, double side) { return x.sides[2] < side; });
      for (; u != a_.triangles.end() && u->sides[2] <= t.sides[2] + window; ++u) {
        if (agree(*u, t)) try_placement(*u, t);
      }
    }
  }
  const Found& best() const { return best_; }    ///< that fits most points
  const Found& rival() const { return rival_; }  ///< of those that differ from it

 private:
  /// Do two placements put the points that either fits in different places?
  bool differ(const Found& x, const Found& y) const {
    std::size_t apart = 0;
    for (const auto& [b, a] : y.pairs) {
      const Vec<D> p = b_.points[at(b)];
      apart += (x.a_from_b * p - y.a_from_b * p).norm() > 0.5 * spacing_ ? 1 : 0;
    }
    return 2 * apart > y.pairs.size();
  }

  bool agree(const Triangle& x, const Triangle& y) const {
    for (std::size_t k = 0; k < 3; ++k) {
      const double bound = gate_ * std::sqrt(x.variances[k] + y.variances[k]);
      if (std::abs(x.sides[k] - y.sides[k]) > bound) return false;
    }
    return true;
  }

  std::optional<Rigid<D>> fit(const std::vector<std::pair<int, int>>& pairs) const {
    CommonGeometry<D> common;
    for (const auto& [b, a] : pairs)
      common.positions.add(a_.points[at(a)].data(), b_.points[at(b)].data());
    return align<D>(common);
  }

  std::vector<std::pair<int, int>> fitting(const Rigid<D>& T) const {
    std::vector<std::pair<int, int>> out;
    std::vector<char> used(a_.points.size(), 0);
    for (std::size_t k = 0; k < b_.points.size(); ++k) {
      const int i = near_(T * b_.points[k], within_);
      if (i < 0 || used[at(i)] != 0) continue;
      used[at(i)] = 1;
      out.emplace_back(static_cast<int>(k), i);
    }
    return out;
  }

  void try_placement(const Triangle& x, const Triangle& y) {
    Found here;
    for (std::size_t k = 0; k < 3; ++k) here.pairs.emplace_back(y.corners[k], x.corners[k]);
    std::optional<Rigid<D>> T = fit(here.pairs);
    if (!T) return;
    for (const auto& [b, a] : here.pairs) {  // a mirror image does not fit
      if ((*T * b_.points[at(b)] - a_.points[at(a)]).norm() > within_) return;
    }
    here.a_from_b = *T;
    if (explains(best_, here) || explains(rival_, here)) return;
    for (int round = 0; round < 3; ++round) {  // fit again by all that fit
      here.pairs = fitting(here.a_from_b);
      if (here.pairs.size() <= std::max<std::size_t>(3, rival_.pairs.size())) return;
      T = fit(here.pairs);
      if (!T) return;
      here.a_from_b = *T;
    }
    if (here.pairs.size() > best_.pairs.size()) std::swap(here, best_);
    if (here.pairs.size() > rival_.pairs.size() && differ(best_, here)) rival_ = std::move(here);
    if (!differ(best_, rival_)) rival_.pairs.clear();
  }

  /// Has a placement all pairs of another? Its pairs are in ascending order.
  static bool explains(const Found& placement, const Found& triangle) {
    return std::all_of(triangle.pairs.begin(), triangle.pairs.end(), [&](const auto& pair) {
      return std::binary_search(placement.pairs.begin(), placement.pairs.end(), pair);
    });
  }

  const Sky<D>& a_;
  const Sky<D>& b_;
  double gate_;
  NearestPoint<D> near_;
  double spacing_ = 0.0, within_ = 0.0, widest_ = 0.0;
  Found best_, rival_;
};

template <int D>
struct Judged {
  std::optional<Placement<D>> placement;
  int best = 0, rival = 0;  // points that fit
};

template <int D>
Judged<D> judge(const Map<D>& a, const Map<D>& b, const ConstellationOptions& options) {
  const Sky<D> in_a = sky_of(a, options.neighbours);
  const Sky<D> in_b = sky_of(b, options.neighbours);
  Judged<D> out;
  if (in_a.points.size() < 3 || in_b.points.size() < 3) return out;
  PlacementSearch<D> search(in_a, in_b, options);
  search.run();
  out.best = static_cast<int>(search.best().pairs.size());
  out.rival = static_cast<int>(search.rival().pairs.size());
  if (out.best < options.least_matches || out.best < options.least_ratio * out.rival) return out;
  Placement<D> placement{search.best().a_from_b, {}, out.rival};
  for (const auto& [j, i] : search.best().pairs)
    placement.names.emplace_back(in_b.keys[at(j)], in_a.keys[at(i)]);
  out.placement = std::move(placement);
  return out;
}

/// Those of the points a map was placed by that agree with the others.
template <int D>
std::vector<std::pair<Key, Key>> in_agreement(const Map<D>& a, const Map<D>& b,
                                              std::vector<std::pair<Key, Key>> names) {
  for (;;) {
    const std::vector<TestedPair> tested = check_matches(a, rename_keys(b, Renaming(names)));
    const auto removed = std::erase_if(names, [&](const auto& name) {
      return std::any_of(tested.begin(), tested.end(), [&](const TestedPair& pair) {
        return pair.flagged && pair.b == name.second;
      });
    });
    if (removed == 0) return names;
  }
}

}  // namespace

template <int D>
std::optional<Placement<D>> place_by_constellations(const Map<D>& a, const Map<D>& b,
                                                    const ConstellationOptions& options) {
  return judge(a, b, options).placement;
}

template <int D>
Association associate_unplaced(const Map<D>& a, const Map<D>& b, const AssociationOptions& options,
                               const ConstellationOptions& constellations) {
  Judged<D> judged = judge(a, b, constellations);
  if (!judged.placement) {
    throw DisconnectedError(fmt::format(
        "the maps cannot be placed by their points: the best placement fits {} points, another one "
        "{}; it takes {} at least, and {} times as many as any other",
        judged.best, judged.rival, constellations.least_matches, constellations.least_ratio));
  }
  const Renaming renaming(in_agreement(a, b, std::move(judged.placement->names)));
  Association out = associate(a, rename_keys(b, renaming), options);
  // The points it was placed by were known by then: matches, too.
  std::vector<TestedPair> known;
  for (const TestedPair& pair : out.known) {
    const auto name = std::find_if(renaming.names().begin(), renaming.names().end(),
                                   [&](const auto& entry) { return entry.second == pair.b; });
    if (name == renaming.names().end()) {
      known.push_back(pair);
      continue;
    }
    out.matches.push_back(
        {pair.a, name->first, pair.chi2, pair.dimension, pair.bound, false, pair.flagged});
  }
  for (const auto& name : renaming.names()) {  // what the frame pins is not among them
    const bool there = std::any_of(out.matches.begin(), out.matches.end(),
                                   [&](const Match& m) { return m.b == name.first; });
    if (!there) out.matches.push_back({name.second, name.first, 0.0, 0, 0.0, false, false});
  }
  out.known = std::move(known);
  std::sort(out.matches.begin(), out.matches.end(),
            [](const Match& x, const Match& y) { return x.b < y.b; });
  return out;
}

#define MAPJOIN_INSTANTIATE(D)                                                                  \
  template std::optional<Placement<D>> place_by_constellations<D>(const Map<D>&, const Map<D>&, \
                                                                  const ConstellationOptions&); \
  template Association associate_unplaced<D>(                                                   \
      const Map<D>&, const Map<D>&, const AssociationOptions&, const ConstellationOptions&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
