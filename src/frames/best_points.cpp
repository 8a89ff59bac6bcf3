#include "mapjoin/frames/best_points.h"

#include <algorithm>
#include <array>
#include <limits>

#include "mapjoin/frames/points_anchor.h"
#include "mapjoin/graph/index.h"

namespace mapjoin {

namespace {

/// Standard deviations in a length. One that is known exactly has more than any other.
double significance(double length, double sigma) {
  if (!(length > 0.0)) return 0.0;
  return sigma > 0.0 ? length / sigma : std::numeric_limits<double>::max();
}

/// What one map, or the one that knows them least, says of chosen points.
struct Quality {
  double determinant = std::numeric_limits<double>::max();  ///< det C
  double certainty = std::numeric_limits<double>::max();    ///< standard deviations in a length
};

template <int D>
Quality quality(const CandidatePoints<D>& map, const std::array<int, D>& chosen) {
  std::array<Vec<D>, D> points;
  Eigen::MatrixXd covariance(D * D, D * D);
  for (int a = 0; a < D; ++a) {
    points[at(a)] = map.positions[at(chosen[at(a)])];
    for (int b = 0; b < D; ++b)
      covariance.template block<D, D>(D * a, D * b) =
          map.covariance.template block<D, D>(D * chosen[at(a)], D * chosen[at(b)]);
  }
  const PointsCertainty known = certainty<D>(points.data(), covariance);
  const double distance = significance(known.distance, known.distance_sigma);
  if (D == 2) return {known.distance, distance};
  return {known.distance * known.distance * known.height,
          std::min(distance, significance(known.height, known.height_sigma))};
}

template <int D>
Quality quality(std::span<const CandidatePoints<D>> maps, const std::array<int, D>& chosen) {
  Quality least;
  for (const CandidatePoints<D>& map : maps) {
    const Quality here = quality<D>(map, chosen);
    least.determinant = std::min(least.determinant, here.determinant);
    least.certainty = std::min(least.certainty, here.certainty);
  }
  return least;
}

/// All ways to choose F_O before F_X, and in space any third as F_Y.
template <int D, class F>
void for_choices(int n, F&& f) {
  for (int o = 0; o < n; ++o) {
    for (int x = o + 1; x < n; ++x) {
      if constexpr (D == 2) {
        f(std::array<int, 2>{o, x});
      } else {
        for (int y = 0; y < n; ++y) {
          if (y != o && y != x) f(std::array<int, 3>{o, x, y});
        }
      }
    }
  }
}

}  // namespace

template <int D>
std::vector<int> spread_points(std::span<const Vec<D>> points, int most) {
  std::vector<int> out;
  const auto n = static_cast<int>(points.size());
  Vec<D> centroid = Vec<D>::Zero();
  for (const Vec<D>& p : points) centroid += p / static_cast<double>(n);
  std::vector<double> gap(points.size());  // to the nearest of those chosen
  for (int k = 0; k < n; ++k) gap[at(k)] = (points[at(k)] - centroid).norm();
  while (static_cast<int>(out.size()) < std::min(most, n)) {
    const auto next = static_cast<int>(std::max_element(gap.begin(), gap.end()) - gap.begin());
    for (int k = 0; k < n; ++k) {
      const double distance = (points[at(k)] - points[at(next)]).norm();
      gap[at(k)] = out.empty() ? distance : std::min(gap[at(k)], distance);
    }
    out.push_back(next);
    for (const int k : out) gap[at(k)] = -1.0;  // points at the same place are still others
  }
  std::sort(out.begin(), out.end());
  return out;
}

template <int D>
std::optional<ChosenPoints<D>> best_points(std::span<const Key> candidates,
                                           std::span<const CandidatePoints<D>> maps) {
  std::array<int, D> best{};
  Quality most{0.0, 0.0};
  for_choices<D>(static_cast<int>(candidates.size()), [&](const std::array<int, D>& chosen) {
    const Quality here = quality<D>(maps, chosen);
    if (!(here.certainty > kDistinctSigmas) || !(here.determinant > most.determinant)) return;
    most = here;
    best = chosen;
  });
  if (!(most.determinant > 0.0)) return std::nullopt;
  ChosenPoints<D> out{{&points_anchor_kind<D>(), {}}, most.certainty};
  for (const int k : best) out.anchor.keys.push_back(candidates[at(k)]);
  return out;
}

#define MAPJOIN_INSTANTIATE(D)                                                 \
  template std::vector<int> spread_points<D>(std::span<const Vec<D>>, int);    \
  template std::optional<ChosenPoints<D>> best_points<D>(std::span<const Key>, \
                                                         std::span<const CandidatePoints<D>>);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
