#include "mapjoin/solvers/clusters.h"

#include <numeric>

namespace mapjoin {
namespace {

using Index = std::int32_t;

/// Fills `of` and `size`.
void grow(const BlockGraph& graph, std::size_t most, Clusters& out) {
  out.of.assign(static_cast<std::size_t>(graph.size()), -1);
  std::vector<Index> members;  // of the cluster that grows
  for (Index v = 0; v < graph.size(); ++v) {
    if (out.of[v] >= 0) continue;
    const auto c = static_cast<Index>(out.size.size());
    out.of[v] = c;
    members.assign(1, v);
    for (std::size_t k = 0; k < members.size() && members.size() < most; ++k) {
      for (const Index u : graph[members[k]]) {
        if (out.of[u] >= 0 || members.size() >= most) continue;
        out.of[u] = c;
        members.push_back(u);
      }
    }
    Index smallest = -1;
    if (4 * members.size() < most) {
      for (const Index m : members) {
        for (const Index u : graph[m]) {
          const Index d = out.of[u];
          if (d >= 0 && d != c && (smallest < 0 || out.size[d] < out.size[smallest])) smallest = d;
        }
      }
    }
    const auto grown = static_cast<Index>(members.size());
    if (smallest < 0) {
      out.size.push_back(grown);
    } else {
      for (const Index m : members) out.of[m] = smallest;
      out.size[smallest] += grown;
    }
  }
}

}  // namespace

Clusters grow_clusters(const BlockGraph& graph, std::size_t size) {
  Clusters out;
  grow(graph, size, out);
  std::vector<Index> start(out.size.size() + 1, 0);
  std::inclusive_scan(out.size.begin(), out.size.end(), start.begin() + 1);
  std::vector<Index> members(out.of.size());
  std::vector<Index> next(start.begin(), start.end() - 1);
  for (Index v = 0; v < graph.size(); ++v) members[next[out.of[v]]++] = v;
  std::vector<Index> seen_by(out.size.size(), -1);
  for (Index c = 0; c < static_cast<Index>(out.size.size()); ++c) {
    seen_by[c] = c;
    for (Index k = start[c]; k < start[c + 1]; ++k) {
      for (const Index u : graph[members[k]]) {
        const Index d = out.of[u];
        if (seen_by[d] == c) continue;
        seen_by[d] = c;
        out.graph.neighbours.push_back(d);
      }
    }
    out.graph.end_row();
  }
  return out;
}

Clusters clusters_of_part(const Clusters& clusters, std::span<const std::int32_t> number) {
  std::vector<Index> members(clusters.size.size(), 0);
  for (std::size_t v = 0; v < number.size(); ++v) {
    if (number[v] >= 0) ++members[clusters.of[v]];
  }
  Clusters out;
  std::vector<Index> renumbered(members.size(), -1);
  for (std::size_t c = 0; c < members.size(); ++c) {
    if (members[c] == 0) continue;
    renumbered[c] = static_cast<Index>(out.size.size());
    out.size.push_back(members[c]);
  }
  for (std::size_t v = 0; v < number.size(); ++v) {
    if (number[v] >= 0) out.of.push_back(renumbered[clusters.of[v]]);
  }
  out.graph = part_of_graph(clusters.graph, renumbered);
  return out;
}

}  // namespace mapjoin
