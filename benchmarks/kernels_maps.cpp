// What is done to maps: changes of frame, merging, joining.
#include <benchmark/benchmark.h>

#include <algorithm>

#include "benchmarks/worlds.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/joining/join.h"

namespace mapjoin::benchmarks {

namespace {

/// The frame goes back and forth between the first and the last pose.
template <int D>
void change_of_frame(benchmark::State& state) {
  Map<D> map = SolvedWorld<D>::of_size(state.range(0)).map;
  const auto& poses = map.variables().column(map.variables().find_column(Tag("pose")));
  const Anchor<D> anchors[] = {pose_anchor<D>(poses.keys.back()),
                               pose_anchor<D>(poses.keys.front())};
  int turn = 0;
  for (auto _ : state) {
    map = change_frame(std::move(map), anchors[turn]);
    benchmark::DoNotOptimize(map.values.value(0));
    turn = 1 - turn;
  }
  state.SetItemsProcessed(state.iterations() * map.values.size());
}
MAPJOIN_KERNEL(change_of_frame);

/// Two maps of one world: the first and the second half of the drive, with some poses in both. As
/// summaries, each solved on its own.
template <int D>
std::vector<Map<D>> halves(const MeasurementGraph<D>& graph) {
  const int poses = graph.variables.size();
  const int overlap = std::max(1, poses / 20);
  std::vector<Map<D>> out;
  for (const auto& [from, to] : {std::pair(0, poses / 2 + overlap), std::pair(poses / 2, poses)}) {
    std::vector<std::int64_t> inside;
    std::int64_t number = 0;
    for (const auto& column : graph.relative) {
      for (std::size_t e = 0; e < column.size(); ++e, ++number) {
        const auto [low, high] = std::minmax(column.from[e], column.to[e]);
        if (low >= from && high < to) inside.push_back(number);
      }
    }
    Map<D> half =
        std::move(join_all(subgraph(graph, std::span<const std::int64_t>(inside))).maps[0]);
    half.observations = nullptr;
    out.push_back(std::move(half));
  }
  return out;
}

/// Placing and lining up the equations of one join. The maps are copied each time: merge() keeps
/// what it is given.
template <int D>
void merge_two(benchmark::State& state) {
  const std::vector<Map<D>> maps = halves(SolvedWorld<D>::of_size(state.range(0)).graph);
  for (auto _ : state) benchmark::DoNotOptimize(merge(maps).x0.size());
  state.SetItemsProcessed(state.iterations() * (maps[0].values.size() + maps[1].values.size()));
}
MAPJOIN_KERNEL(merge_two);

/// The one linear solve of that join.
template <int D>
void solve_join_of_two(benchmark::State& state) {
  const Merge<D> merged = merge(halves(SolvedWorld<D>::of_size(state.range(0)).graph));
  for (auto _ : state) benchmark::DoNotOptimize(solve(merged).values.size());
  state.SetItemsProcessed(state.iterations() * merged.variables.size());
}
MAPJOIN_KERNEL(solve_join_of_two);

}  // namespace

}  // namespace mapjoin::benchmarks
