#include "mapjoin/solvers/fronts.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <string>

#include "mapjoin/graph/error.h"
#include "mapjoin/solvers/front_layout.h"
#include "mapjoin/solvers/pool_loop.h"
#include "mapjoin/solvers/symbolic_elimination.h"

namespace mapjoin {
namespace {

using Index = std::int32_t;

// dims[index[0]], dims[index[1]], ... summed up from 0.
template <class IndexOf>
std::vector<Index> running_sums(std::span<const Index> dims, IndexOf index) {
  std::vector<Index> sums(dims.size() + 1);
  std::int64_t sum = 0;
  for (std::size_t i = 0; i < dims.size(); ++i) {
    const Index dim = dims[index(i)];
    if (dim < 1) throw InputError("analyze: a variable has dimension " + std::to_string(dim));
    sums[i] = static_cast<Index>(sum);
    sum += dim;
    if (sum > std::numeric_limits<Index>::max())
      throw InputError("analyze: more than 2^31 scalars");
  }
  sums.back() = static_cast<Index>(sum);
  return sums;
}

class Analysis {
 public:
  Analysis(std::span<const Index> dims, Cliques cliques, std::span<const Index> order,
           const MergingOptions& options, Index eliminated, WorkerPool* pool)
      : cliques_(cliques), options_(options), eliminated_(eliminated), pool_(pool) {
    if (order.size() != dims.size())
      throw InputError("analyze: the order has another size than dims");
    s_.dims.assign(dims.begin(), dims.end());
    s_.order.assign(order.begin(), order.end());
    given_position_ = inverse_permutation(order);
    s_.scalar_of = running_sums(dims, [](std::size_t v) { return v; });
  }

  BlockGraph stars() const { return star_graph(given_position_, cliques_); }

  FrontalStructure run(const BlockGraph& graph) {
    run_both(
        pool_,
        [&] {
          form_fronts(graph);
          list_children();
        },
        [&] { find_owners(); });
    run_both(
        pool_, [&] { list_updates(); },
        [&] {
          assign_cliques();
          plan();
        });
    run_both(
        pool_, [&] { locate_children(); }, [&] { locate_cliques(); });
    return std::move(s_);
  }

 private:
  Index front_count() const { return static_cast<Index>(s_.fronts.size()); }
  Index dim_at(Index position) const { return s_.scalar_at[position + 1] - s_.scalar_at[position]; }

  void form_fronts(const BlockGraph& graph) {
    supernodes_ = eliminate_symbolically(s_.dims, graph, s_.order, given_position_, eliminated_);
    FrontPartition partition = partition_into_fronts(supernodes_, options_);
    s_.fronts.resize(static_cast<std::size_t>(partition.fronts()));
    s_.update_start.assign(s_.fronts.size() + 1, 0);
    for (Index f = 0; f < front_count(); ++f) {
      const Index s = partition.supernode[f];
      s_.fronts[f].parent = partition.parent[f];
      s_.fronts[f].pivot_dim = partition.pivot_dim[f];
      s_.fronts[f].update_dim = supernodes_.update_dim[s];
      s_.update_start[f + 1] = s_.update_start[f] + supernodes_.update_blocks[s];
    }
    supernode_of_front_ = std::move(partition.supernode);
    reorder_by_front(partition.front_of);
  }

  // Makes the pivots of each front consecutive, in their former order.
  void reorder_by_front(const std::vector<Index>& front_of) {
    std::vector<Index> next(s_.fronts.size() + 1, 0);
    for (const Index f : front_of) ++next[f + 1];
    std::inclusive_scan(next.begin(), next.end(), next.begin());
    for (Index f = 0; f < front_count(); ++f) {
      s_.fronts[f].first_position = next[f];
      s_.fronts[f].end_position = next[f + 1];
    }
    const std::vector<Index> old_order = std::move(s_.order);
    s_.order.assign(old_order.size(), 0);
    front_at_.resize(old_order.size());
    moved_to_.resize(old_order.size());
    s_.position.resize(old_order.size());
    for (std::size_t k = 0; k < old_order.size(); ++k) {
      const Index position = next[front_of[k]]++;
      moved_to_[k] = position;
      s_.order[position] = old_order[k];
      s_.position[old_order[k]] = position;
      front_at_[position] = front_of[k];
    }
    s_.scalar_at = running_sums(s_.dims, [&](std::size_t k) { return s_.order[k]; });
    for (Front& front : s_.fronts) front.first_scalar = s_.scalar_at[front.first_position];
  }

  void list_children() {
    s_.child_start.assign(s_.fronts.size() + 1, 0);
    for (const Front& front : s_.fronts) {
      if (front.parent >= 0) ++s_.child_start[front.parent + 1];
    }
    std::inclusive_scan(s_.child_start.begin(), s_.child_start.end(), s_.child_start.begin());
    s_.children.resize(static_cast<std::size_t>(s_.child_start.back()));
    std::vector<Index> next(s_.child_start.begin(), s_.child_start.end() - 1);
    for (Index f = 0; f < front_count(); ++f) {
      if (s_.fronts[f].parent >= 0) s_.children[next[s_.fronts[f].parent]++] = f;
    }
  }

  void list_updates() {
    s_.updates.resize(static_cast<std::size_t>(s_.update_start.back()));
    for (Index f = 0; f < front_count(); ++f) {
      Index* const begin = s_.updates.data() + s_.update_start[f];
      Index* to = begin;
      supernodes_.for_each_update(supernode_of_front_[f], [&](Index k) { *to++ = moved_to_[k]; });
      std::sort(begin, to);
    }
  }

  void plan() {
    if (eliminated_ >= 0) {  // tree by tree, and what a tree leaves is used before the next one
      s_.tasks = {{.begin = 0, .end = front_count()}};
    } else {
      plan_tasks(s_, options_.cost);
    }
    plan_memory(s_);
  }

  // Who is eliminated first, of each clique, in the order that was given.
  void find_owners() {
    owner_.resize(static_cast<std::size_t>(cliques_.size()));
    for (std::int64_t k = 0; k < cliques_.size(); ++k) {
      Index first = std::numeric_limits<Index>::max();
      for (const Index v : cliques_[k]) first = std::min(first, given_position_[v]);
      owner_[k] = cliques_[k].empty() ? -1 : first;
    }
  }

  void assign_cliques() {
    s_.owned_start.assign(s_.fronts.size() + 1, 0);
    for (Index& owner : owner_) {
      if (owner < 0) continue;
      owner = front_at_[moved_to_[owner]];
      ++s_.owned_start[owner + 1];
    }
    std::inclusive_scan(s_.owned_start.begin(), s_.owned_start.end(), s_.owned_start.begin());
    s_.owned.resize(static_cast<std::size_t>(s_.owned_start.back()));
    std::vector<std::int64_t> next(s_.owned_start.begin(), s_.owned_start.end() - 1);
    for (std::int64_t k = 0; k < cliques_.size(); ++k) {
      if (owner_[k] >= 0) s_.owned[next[owner_[k]]++] = k;
    }
  }

  // Writes down the row of each of a front's variables. Returns how many rows there are.
  Index number_rows(Index f, std::span<Index> row_at) const {
    const Front& front = s_.fronts[f];
    for (Index k = front.first_position; k < front.end_position; ++k) {
      row_at[k] = s_.scalar_at[k] - front.first_scalar;
    }
    Index row = front.pivot_dim;
    for (const Index k : s_.updates_of(f)) {
      row_at[k] = row;
      row += dim_at(k);
    }
    return row;
  }

  void locate_children() {
    std::vector<Index> row_at(s_.order.size());
    s_.run_range.resize(s_.fronts.size());
    for (Index f = 0; f < front_count(); ++f) {
      if (s_.children_of(f).empty()) continue;
      const Index rows = number_rows(f, row_at);
      for (const Index child : s_.children_of(f)) find_runs(child, row_at, rows);
    }
  }

  void locate_cliques() {
    std::vector<Index> row_at(s_.order.size());
    s_.clique_start.assign(cliques_.start.begin(), cliques_.start.end());
    s_.clique_row.resize(cliques_.vars.size());
    for (Index f = 0; f < front_count(); ++f) {
      if (s_.owned_by(f).empty()) continue;
      number_rows(f, row_at);
      for (const std::int64_t clique : s_.owned_by(f)) {
        for (std::int64_t e = cliques_.start[clique]; e < cliques_.start[clique + 1]; ++e) {
          s_.clique_row[e] = row_at[s_.position[cliques_.vars[e]]];
        }
      }
    }
  }

  // Appends the runs of `child` in its parent's rows; the right-hand side goes from its last row to
  // `rhs_row`.
  void find_runs(Index child, std::span<const Index> row_at, Index rhs_row) {
    const std::int64_t begin = static_cast<std::int64_t>(s_.runs.size());
    RowRun run;
    const auto append = [&](Index to, Index length) {
      if (run.length > 0 && run.to + run.length == to) {
        run.length += length;
        return;
      }
      if (run.length > 0) s_.runs.push_back(run);
      run = {.from = run.from + run.length, .to = to, .length = length};
    };
    for (const Index k : s_.updates_of(child)) append(row_at[k], dim_at(k));
    append(rhs_row, 1);
    s_.runs.push_back(run);
    s_.run_range[child] = {.begin = begin, .end = static_cast<std::int64_t>(s_.runs.size())};
  }

  Cliques cliques_;
  MergingOptions options_;
  Index eliminated_;
  WorkerPool* pool_;
  FrontalStructure s_;
  std::vector<Index> given_position_;      // per variable, in the order that was given
  std::vector<Index> owner_;               // per clique: the first position, later the front; or -1
  SupernodeTree supernodes_;               // of the order that was given
  std::vector<Index> supernode_of_front_;  // whose update set it has
  std::vector<Index> moved_to_;            // per given position
  std::vector<Index> front_at_;            // per final position
};

}  // namespace

FrontalStructure analyze(std::span<const std::int32_t> dims, Cliques cliques,
                         std::span<const std::int32_t> order, const MergingOptions& options,
                         std::int32_t eliminated) {
  Analysis analysis(dims, cliques, order, options, eliminated, nullptr);
  return analysis.run(analysis.stars());
}

FrontalStructure analyze(std::span<const std::int32_t> dims, Cliques cliques,
                         const BlockGraph& graph, std::span<const std::int32_t> order,
                         WorkerPool* pool) {
  return Analysis(dims, cliques, order, {}, -1, pool).run(graph);
}

}  // namespace mapjoin
