#include "mapjoin/solvers/separator.h"

#include <metis.h>

#include <algorithm>
#include <mutex>
#include <numeric>

namespace mapjoin {

namespace {

using Index = std::int32_t;

// All by measurement, on streets, corridors, spheres, tori and landmarks of 10^3 to 10^6 variables:
// docs/decisions.md.
constexpr std::int64_t kClusterSize = 32;   // variables, where there are many
constexpr std::int64_t kFewClusters = 256;  // a graph has this many, if it has as many variables
constexpr int kRings = 8;                   // neighbours of neighbours ... that a cut may move by
constexpr Index kMostOfSide = 4;            // but through no more than this fraction of a side

// METIS is one at a time: it seeds and uses the random numbers of the whole process.
std::mutex metis_in_use;

}  // namespace

/// Breadth first, each until it has its weight. What is left between clusters joins the lightest
/// of them.
void SeparatorFinder::grow_clusters(const BlockGraph& graph, std::span<const Index> weight,
                                    std::int64_t cluster_weight) {
  cluster_.assign(weight.size(), -1);
  cluster_weight_.clear();
  for (Index v = 0; v < graph.size(); ++v) {
    if (cluster_[v] >= 0) continue;
    const auto c = static_cast<Index>(cluster_weight_.size());
    Index sum = weight[v];
    cluster_[v] = c;
    members_.assign(1, v);
    for (std::size_t k = 0; k < members_.size() && sum < cluster_weight; ++k) {
      for (const Index u : graph[members_[k]]) {
        if (cluster_[u] >= 0 || sum >= cluster_weight) continue;
        cluster_[u] = c;
        sum += weight[u];
        members_.push_back(u);
      }
    }
    Index lightest = -1;
    if (4 * sum < cluster_weight) {
      for (const Index m : members_) {
        for (const Index u : graph[m]) {
          const Index d = cluster_[u];
          if (d >= 0 && d != c && (lightest < 0 || cluster_weight_[d] < cluster_weight_[lightest]))
            lightest = d;
        }
      }
    }
    if (lightest < 0) {
      cluster_weight_.push_back(sum);
    } else {
      for (const Index m : members_) cluster_[m] = lightest;
      cluster_weight_[lightest] += sum;
    }
  }
}

SeparatorFinder::Clusters SeparatorFinder::gather(const BlockGraph& graph,
                                                  std::span<const Index> weight,
                                                  std::int64_t cluster_weight) {
  grow_clusters(graph, weight, cluster_weight);
  Clusters out;
  out.weight = cluster_weight_;
  std::vector<Index> start(out.weight.size() + 1, 0);
  for (const Index c : cluster_) ++start[c];
  std::exclusive_scan(start.begin(), start.end(), start.begin(), 0);
  members_.resize(cluster_.size());
  std::vector<Index> next(start.begin(), start.end() - 1);
  for (Index v = 0; v < graph.size(); ++v) members_[next[cluster_[v]]++] = v;
  std::vector<Index> seen_by(out.weight.size(), -1);
  for (Index c = 0; c < static_cast<Index>(out.weight.size()); ++c) {
    seen_by[c] = c;
    for (Index k = start[c]; k < start[c + 1]; ++k) {
      for (const Index u : graph[members_[k]]) {
        const Index d = cluster_[u];
        if (seen_by[d] == c) continue;
        seen_by[d] = c;
        out.graph.neighbours.push_back(d);
      }
    }
    out.graph.end_row();
  }
  return out;
}

bool SeparatorFinder::part(Clusters& clusters, int seed) {
  static_assert(sizeof(idx_t) == sizeof(Index), "mapjoin expects METIS with 32-bit indices");
  idx_t n = clusters.graph.size();
  idx_t separator = 0;
  idx_t options[METIS_NOPTIONS];
  METIS_SetDefaultOptions(options);
  options[METIS_OPTION_SEED] = seed;
  part_.resize(clusters.weight.size());
  const std::lock_guard lock(metis_in_use);
  return METIS_ComputeVertexSeparator(&n, clusters.graph.start.data(),
                                      clusters.graph.neighbours.data(), clusters.weight.data(),
                                      options, &separator, part_.data()) == METIS_OK;
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

std::span<const Side> SeparatorFinder::find(const BlockGraph& graph, std::span<const Index> weight,
                                            int seed) {
  const std::int64_t total = std::accumulate(weight.begin(), weight.end(), std::int64_t{0});
  const std::int64_t size = std::clamp<std::int64_t>(graph.size() / kFewClusters, 1, kClusterSize);
  Clusters clusters = gather(graph, weight, size * total / std::max<Index>(1, graph.size()));
  if (!part(clusters, seed)) return {};
  side_.resize(weight.size());
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
