#include "mapjoin/solvers/minimum_degree.h"

#include <amd.h>
#include <camd.h>

#include <limits>
#include <utility>

#include "mapjoin/graph/error.h"
#include "mapjoin/graph/index.h"

namespace mapjoin {

using Index = std::int32_t;

/// Variables with more neighbours than so many times the square root of all are put last, unseen.
/// AMD's own 10 costs victoria_park, with features that thousands of poses see, 17 ms of a join of
/// 58, and gains 25% of operations that take as many.
constexpr double kLateAbove = 5.0;

namespace {

/// amd_2 and camd_2 are AMD and CAMD without the checks and copies of amd_order and camd_order;
/// they destroy the graph they are given, which must have room to grow. Both want arrays of n + 1.
class Workspace {
 public:
  explicit Workspace(BlockGraph graph)
      : graph_(std::move(graph)), entries_(graph_.start.back()), rows_(at(kRows) * at(n() + 1)) {
    const std::int64_t space = std::int64_t{entries_} + entries_ / 5 + n() + 1;
    if (space > std::numeric_limits<Index>::max())
      throw InputError("order_blocks: the block graph is too large");
    graph_.neighbours.resize(at(space));
    for (Index v = 0; v < n(); ++v) row(0)[v] = graph_.start[v + 1] - graph_.start[v];
  }
  Index n() const { return graph_.size(); }
  Index entries() const { return entries_; }
  Index space() const { return static_cast<Index>(graph_.neighbours.size()); }
  Index* start() { return graph_.start.data(); }
  Index* neighbours() { return graph_.neighbours.data(); }
  Index* lengths() { return row(0); }
  Index* row(int k) { return rows_.data() + at(k) * at(n() + 1); }

 private:
  static constexpr int kRows = 8;

  BlockGraph graph_;
  Index entries_;
  std::vector<Index> rows_;
};

}  // namespace

MinimumDegreeOrder minimum_degree(BlockGraph graph) {
  Workspace w(std::move(graph));
  std::vector<Index> order(static_cast<std::size_t>(w.n()));
  double control[AMD_CONTROL];
  double info[AMD_INFO];
  amd_defaults(control);
  control[AMD_DENSE] = kLateAbove;
  amd_2(w.n(), w.start(), w.neighbours(), w.lengths(), w.space(), w.entries(), w.row(1), w.row(2),
        order.data(), w.row(3), w.row(4), w.row(5), w.row(6), control, info);
  return {std::move(order), info[AMD_NMULTSUBS_LDL]};
}

std::vector<Index> minimum_degree_in_two(std::span<const char> late, BlockGraph graph) {
  const std::vector<Index> group(late.begin(), late.end());
  Workspace w(std::move(graph));
  std::vector<Index> order(static_cast<std::size_t>(w.n()));
  double control[CAMD_CONTROL];
  double info[CAMD_INFO];
  camd_defaults(control);
  control[CAMD_DENSE] = kLateAbove;
  camd_2(w.n(), w.start(), w.neighbours(), w.lengths(), w.space(), w.entries(), w.row(1), w.row(2),
         order.data(), w.row(3), w.row(4), w.row(5), w.row(6), control, info, group.data(),
         w.row(7));
  return order;
}

}  // namespace mapjoin
