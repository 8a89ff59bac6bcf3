#include "mapjoin/solvers/separator.h"

#include <metis.h>

#include <algorithm>

#include "mapjoin/solvers/metis_turn.h"

namespace mapjoin {

namespace {

using Index = std::int32_t;

// All by measurement, on streets, corridors, spheres, tori and landmarks of 10^3 to 10^6 variables:
// docs/decisions.md.
constexpr Index kClusterSize = 32;     // variables, where there are many
constexpr Index kFewClusters = 128;    // a graph has this many, if it has as many variables
constexpr int kRings = 8;              // neighbours of neighbours ... that a cut may move by
constexpr Index kMostOfSide = 4;       // but through no more than this fraction of a side
constexpr std::size_t kMostOfCut = 8;  // and only as long as there are fewer times the cut's

}  // namespace

bool SeparatorFinder::part(Clusters& clusters, int seed) {
  static_assert(sizeof(idx_t) == sizeof(Index), "mapjoin expects METIS with 32-bit indices");
  idx_t n = clusters.graph.size();
  idx_t separator = 0;
  idx_t options[METIS_NOPTIONS];
  METIS_SetDefaultOptions(options);
  options[METIS_OPTION_SEED] = seed;
  part_.resize(clusters.size.size());
  const MetisTurn turn;
  return METIS_ComputeVertexSeparator(&n, clusters.graph.start.data(),
                                      clusters.graph.neighbours.data(), clusters.size.data(),
                                      options, &separator, part_.data()) == METIS_OK;
}

/// The cut with rings of neighbours about it.
void SeparatorFinder::widen(const BlockGraph& graph) {
  band_.clear();
  Index left[2] = {0, 0};
  for (Index v = 0; v < graph.size(); ++v) {
    if (side_[v] == Side::kCut) {
      band_.push_back(v);
    } else {
      ++left[side_[v] == Side::kRight ? 1 : 0];
    }
  }
  for (Index& count : left) count /= kMostOfSide;
  const std::size_t enough = kMostOfCut * band_.size();
  std::size_t k = 0;
  for (int ring = 0; ring < kRings && band_.size() < enough; ++ring) {
    for (const std::size_t end = band_.size(); k < end; ++k) {
      for (const Index u : graph[band_[k]]) {
        if (side_[u] == Side::kCut || left[side_[u] == Side::kRight ? 1 : 0]-- <= 0) continue;
        side_[u] = Side::kCut;
        band_.push_back(u);
      }
    }
  }
}

std::span<const Side> SeparatorFinder::find(const BlockGraph& graph, Clusters& clusters, int seed) {
  if (clusters.empty()) {
    const Index size = std::clamp(graph.size() / kFewClusters, 1, kClusterSize);
    clusters = grow_clusters(graph, static_cast<std::size_t>(size));
  }
  if (!part(clusters, seed)) return {};
  side_.resize(static_cast<std::size_t>(graph.size()));
  for (Index v = 0; v < graph.size(); ++v) {
    const Index part = part_[clusters.of[v]];
    side_[v] = part == 0 ? Side::kLeft : part == 1 ? Side::kRight : Side::kCut;
  }
  widen(graph);
  cut_.shrink(graph, side_);
  const bool halves = std::ranges::find(side_, Side::kLeft) != side_.end() &&
                      std::ranges::find(side_, Side::kRight) != side_.end();
  return halves ? std::span<const Side>(side_) : std::span<const Side>();
}

bool large_enough_for_clusters(std::int32_t variables) {
  return variables / kFewClusters >= kClusterSize;
}

}  // namespace mapjoin
