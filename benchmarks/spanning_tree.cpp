#include "benchmarks/spanning_tree.h"

#include <algorithm>
#include <numeric>

#include "mapjoin/graph/index.h"

namespace mapjoin::benchmarks {

namespace {

template <int D>
std::size_t count_of(const MeasurementGraph<D>& graph, Tag type) {
  const int c = graph.variables.find_column(type);
  return c < 0 ? 0 : at(graph.variables.column(c).size());
}

/// Which measurements touch each pose.
struct Incidence {
  std::vector<std::size_t> start, edge;
};

template <int D>
Incidence incidence(const MeasurementGraph<D>& graph, const RelativeMeasurements<D>& edges,
                    std::size_t poses) {
  Incidence out;
  out.start.assign(poses + 1, 0);
  const auto for_each_end = [&](auto&& body) {
    for (std::size_t e = 0; e < edges.size(); ++e) {
      body(place_of(graph, "pose", edges.from[e]), e);
      body(place_of(graph, "pose", edges.to[e]), e);
    }
  };
  for_each_end([&](std::size_t pose, std::size_t) { ++out.start[pose + 1]; });
  std::partial_sum(out.start.begin(), out.start.end(), out.start.begin());
  out.edge.resize(out.start.back());
  std::vector<std::size_t> next(out.start.begin(), out.start.end() - 1);
  for_each_end([&](std::size_t pose, std::size_t e) { out.edge[next[pose]++] = e; });
  return out;
}

template <int D>
std::vector<bool> chain_poses(const MeasurementGraph<D>& graph, std::vector<Rigid<D>>& poses) {
  std::vector<bool> reached(poses.size(), false);
  const RelativeMeasurements<D>* edges = measurements_of(graph, "pose");
  if (poses.empty()) return reached;
  reached[0] = true;
  if (edges == nullptr) return reached;
  const Incidence touching = incidence(graph, *edges, poses.size());
  const auto* const z = reinterpret_cast<const Rigid<D>*>(edges->z.data());
  std::vector<std::size_t> queue{0};
  for (std::size_t head = 0; head < queue.size(); ++head) {
    const std::size_t here = queue[head];
    for (std::size_t k = touching.start[here]; k < touching.start[here + 1]; ++k) {
      const std::size_t e = touching.edge[k];
      const std::size_t from = place_of(graph, "pose", edges->from[e]);
      const std::size_t to = place_of(graph, "pose", edges->to[e]);
      const std::size_t there = from == here ? to : from;
      if (reached[there]) continue;
      poses[there] = poses[here] * (from == here ? z[e] : z[e].inverse());
      reached[there] = true;
      queue.push_back(there);
    }
  }
  return reached;
}

}  // namespace

template <int D>
const RelativeMeasurements<D>* measurements_of(const MeasurementGraph<D>& graph, Tag type) {
  for (const auto& column : graph.relative) {
    if (column.kind->tag == type) return &column;
  }
  return nullptr;
}

template <int D>
Start<D> spanning_tree_start(const MeasurementGraph<D>& graph) {
  Start<D> out;
  out.poses.resize(count_of(graph, "pose"));
  out.points.assign(count_of(graph, "point"), Vec<D>::Zero());
  const std::vector<bool> reached = chain_poses(graph, out.poses);
  std::vector<bool> seen(out.points.size(), false);
  if (const auto* sightings = measurements_of(graph, Tag("point"))) {
    const auto* const z = reinterpret_cast<const Vec<D>*>(sightings->z.data());
    for (std::size_t e = 0; e < sightings->size(); ++e) {
      const std::size_t from = place_of(graph, "pose", sightings->from[e]);
      const std::size_t point = place_of(graph, "point", sightings->to[e]);
      if (seen[point] || !reached[from]) continue;
      out.points[point] = out.poses[from] * z[e];
      seen[point] = true;
    }
  }
  const auto all = [](const std::vector<bool>& flags) {
    return std::all_of(flags.begin(), flags.end(), [](bool flag) { return flag; });
  };
  out.complete = all(reached) && all(seen);
  return out;
}

#define MAPJOIN_INSTANTIATE(D)                                                                 \
  template const RelativeMeasurements<D>* measurements_of<D>(const MeasurementGraph<D>&, Tag); \
  template Start<D> spanning_tree_start<D>(const MeasurementGraph<D>&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin::benchmarks
