#include "mapjoin/solvers/separator.h"

#include <metis.h>

#include <algorithm>
#include <numeric>

#include "mapjoin/solvers/metis_turn.h"

namespace mapjoin {

namespace {

using Index = std::int32_t;

// All by measurement, on streets, corridors, spheres, tori and landmarks of 10^3 to 10^6 variables:
// docs/decisions.md.
constexpr Index kClusterSize = 32;   // variables, where there are many
constexpr Index kFewClusters = 256;  // a graph has this many, if it has as many variables
constexpr int kRings = 8;            // neighbours of neighbours ... that a cut may move by
constexpr Index kMostOfSide = 4;     // but through no more than this fraction of a side

}  // namespace

/// Breadth first, each until it is large enough. What is left between clusters joins the smallest
/// of them.
void SeparatorFinder::grow_clusters(const BlockGraph& graph, std::size_t size) {
  cluster_.assign(static_cast<std::size_t>(graph.size()), -1);
  cluster_size_.clear();
  for (Index v = 0; v < graph.size(); ++v) {
    if (cluster_[v] >= 0) continue;
    const auto c = static_cast<Index>(cluster_size_.size());
    cluster_[v] = c;
    members_.assign(1, v);
    for (std::size_t k = 0; k < members_.size() && members_.size() < size; ++k) {
      for (const Index u : graph[members_[k]]) {
        if (cluster_[u] >= 0 || members_.size() >= size) continue;
        cluster_[u] = c;
        members_.push_back(u);
      }
    }
    Index smallest = -1;
    if (4 * members_.size() < size) {
      for (const Index m : members_) {
        for (const Index u : graph[m]) {
          const Index d = cluster_[u];
          if (d >= 0 && d != c && (smallest < 0 || cluster_size_[d] < cluster_size_[smallest]))
            smallest = d;
        }
      }
    }
    const auto grown = static_cast<Index>(members_.size());
    if (smallest < 0) {
      cluster_size_.push_back(grown);
    } else {
      for (const Index m : members_) cluster_[m] = smallest;
      cluster_size_[smallest] += grown;
    }
  }
}

BlockGraph SeparatorFinder::gather(const BlockGraph& graph, std::size_t size) {
  grow_clusters(graph, size);
  BlockGraph out;
  std::vector<Index> start(cluster_size_.size() + 1, 0);
  for (const Index c : cluster_) ++start[c];
  std::exclusive_scan(start.begin(), start.end(), start.begin(), 0);
  members_.resize(cluster_.size());
  std::vector<Index> next(start.begin(), start.end() - 1);
  for (Index v = 0; v < graph.size(); ++v) members_[next[cluster_[v]]++] = v;
  std::vector<Index> seen_by(cluster_size_.size(), -1);
  for (Index c = 0; c < static_cast<Index>(cluster_size_.size()); ++c) {
    seen_by[c] = c;
    for (Index k = start[c]; k < start[c + 1]; ++k) {
      for (const Index u : graph[members_[k]]) {
        const Index d = cluster_[u];
        if (seen_by[d] == c) continue;
        seen_by[d] = c;
        out.neighbours.push_back(d);
      }
    }
    out.end_row();
  }
  return out;
}

bool SeparatorFinder::part(BlockGraph& clusters, int seed) {
  static_assert(sizeof(idx_t) == sizeof(Index), "mapjoin expects METIS with 32-bit indices");
  idx_t n = clusters.size();
  idx_t separator = 0;
  idx_t options[METIS_NOPTIONS];
  METIS_SetDefaultOptions(options);
  options[METIS_OPTION_SEED] = seed;
  part_.resize(cluster_size_.size());
  const MetisTurn turn;
  return METIS_ComputeVertexSeparator(&n, clusters.start.data(), clusters.neighbours.data(),
                                      cluster_size_.data(), options, &separator,
                                      part_.data()) == METIS_OK;
}

/// The cut with rings of neighbours about it.
void SeparatorFinder::widen(const BlockGraph& graph) {
  members_.clear();
  Index left[2] = {0, 0};
  for (Index v = 0; v < graph.size(); ++v) {
    if (side_[v] == Side::kCut) {
      members_.push_back(v);
    } else {
      ++left[side_[v] == Side::kRight ? 1 : 0];
    }
  }
  for (Index& count : left) count /= kMostOfSide;
  std::size_t k = 0;
  for (int ring = 0; ring < kRings; ++ring) {
    for (const std::size_t end = members_.size(); k < end; ++k) {
      for (const Index u : graph[members_[k]]) {
        if (side_[u] == Side::kCut || left[side_[u] == Side::kRight ? 1 : 0]-- <= 0) continue;
        side_[u] = Side::kCut;
        members_.push_back(u);
      }
    }
  }
}

std::span<const Side> SeparatorFinder::find(const BlockGraph& graph, int seed) {
  const Index size = std::clamp(graph.size() / kFewClusters, 1, kClusterSize);
  BlockGraph clusters = gather(graph, static_cast<std::size_t>(size));
  if (!part(clusters, seed)) return {};
  side_.resize(static_cast<std::size_t>(graph.size()));
  for (Index v = 0; v < graph.size(); ++v) {
    const Index part = part_[cluster_[v]];
    side_[v] = part == 0 ? Side::kLeft : part == 1 ? Side::kRight : Side::kCut;
  }
  widen(graph);
  cut_.shrink(graph, side_);
  const bool halves = std::ranges::find(side_, Side::kLeft) != side_.end() &&
                      std::ranges::find(side_, Side::kRight) != side_.end();
  return halves ? std::span<const Side>(side_) : std::span<const Side>();
}

}  // namespace mapjoin
