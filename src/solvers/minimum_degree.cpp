#include "mapjoin/solvers/minimum_degree.h"

#include <amd.h>
#include <camd.h>

#include <limits>
#include <string>

#include "mapjoin/graph/error.h"

namespace mapjoin {

using Index = std::int32_t;

/// Variables with more neighbours than so many times the square root of all are put last, unseen.
/// AMD's own 10 costs victoria_park, with features that thousands of poses see, 17 ms of a join of
/// 58, and gains 25% of operations that take as many.
constexpr double kLateAbove = 5.0;

// amd_2 is AMD without the checks and copies of amd_order; it destroys the graph it is given.
MinimumDegreeOrder minimum_degree(BlockGraph graph) {
  const Index n = graph.size();
  const Index entries = graph.start[n];
  const std::int64_t space = std::int64_t{entries} + entries / 5 + n + 1;
  if (space > std::numeric_limits<Index>::max())
    throw InputError("order_blocks: the block graph is too large");
  graph.neighbours.resize(static_cast<std::size_t>(space));

  std::vector<Index> work(static_cast<std::size_t>(n) * 8);
  const auto row = [&](int k) {
    return work.data() + static_cast<std::size_t>(k) * static_cast<std::size_t>(n);
  };
  Index* const length = row(0);
  for (Index v = 0; v < n; ++v) length[v] = graph.start[v + 1] - graph.start[v];
  std::vector<Index> order(static_cast<std::size_t>(n));
  double control[AMD_CONTROL];
  double info[AMD_INFO];
  amd_defaults(control);
  control[AMD_DENSE] = kLateAbove;
  amd_2(n, graph.start.data(), graph.neighbours.data(), length, static_cast<Index>(space), entries,
        row(1), row(2), order.data(), row(3), row(4), row(5), row(6), control, info);
  return {std::move(order), info[AMD_NMULTSUBS_LDL]};
}

std::vector<Index> minimum_degree_in_two(std::span<const char> late, const BlockGraph& graph) {
  // CAMD takes sorted or unsorted columns, each pair in both.
  std::vector<Index> group(late.begin(), late.end());
  std::vector<Index> order(late.size());
  const int status = camd_order(graph.size(), graph.start.data(), graph.neighbours.data(),
                                order.data(), nullptr, nullptr, group.data());
  if (status != CAMD_OK && status != CAMD_OK_BUT_JUMBLED)
    throw Error("order_blocks_in_two: CAMD failed, code " + std::to_string(status));
  return order;
}

}  // namespace mapjoin
