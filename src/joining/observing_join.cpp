#include "mapjoin/joining/observing_join.h"

#include <memory>

#include "mapjoin/joining/leaf.h"
#include "mapjoin/joining/place.h"
#include "mapjoin/joining/refine.h"
#include "mapjoin/joining/tree_walk.h"

namespace mapjoin {

namespace {

/// What one thread needs to do joins.
struct Desk {
  explicit Desk(int variables) : places(variables) {}
  Places places;
  FrontalCholesky cholesky;
  WorkerPool alone;
};

/// One global elimination order serves every join: restricted to the variables of a node it fills
/// no more than it does in the whole.
template <int D>
std::vector<std::int32_t> elimination_rank(const MeasurementGraph<D>& graph) {
  const CliqueList all = cliques(graph);
  const std::vector<int> dims = graph.variables.dims();
  const std::vector<std::int32_t> order = order_blocks(dims, {all.start, all.variables});
  std::vector<std::int32_t> rank(order.size());
  for (std::size_t k = 0; k < order.size(); ++k)
    rank[static_cast<std::size_t>(order[k])] = static_cast<std::int32_t>(k);
  return rank;
}

template <int D>
class TreeWalk {
 public:
  TreeWalk(const MeasurementGraph<D>& graph, const JoinTree& tree, const JoinOptions& options,
           WorkerPool& pool, JoinReport& report)
      : graph_(graph),
        tree_(tree),
        options_(options),
        pool_(pool),
        report_(report),
        rank_(elimination_rank(graph)) {
    for (int t = 0; t < pool.threads(); ++t)
      desks_.push_back(std::make_unique<Desk>(graph.variables.size()));
    results_.resize(static_cast<std::size_t>(tree.nodes()));
  }

  std::vector<Piece<D>> run() {
    walk_tree(tree_, pool_, options_.progress, [&](int node, int thread, bool alone) {
      Desk& desk = *desks_[static_cast<std::size_t>(thread)];
      do_node(node, desk, alone ? pool_ : desk.alone);
    });
    return std::move(results_.back());
  }

 private:
  void do_node(int node, Desk& desk, WorkerPool& pool) {
    std::vector<Piece<D>> pieces;
    if (node < tree_.leaves()) {
      pieces = leaf_pieces(graph_, tree_.leaf(node), desk.places);
    } else {
      for (const std::int32_t child : tree_.children_of(node)) {
        for (Piece<D>& piece : results_[static_cast<std::size_t>(child)])
          pieces.push_back(std::move(piece));
        results_[static_cast<std::size_t>(child)] = {};
      }
    }
    pieces = place(graph_.variables, std::move(pieces), desk.places);
    const bool root = node + 1 == tree_.nodes();
    for (Piece<D>& piece : pieces) {
      ObservationSystem<D> system(graph_, piece, rank_, desk.places);
      const int solves = root ? report_.root_solves : report_.solves_per_join;
      for (int s = 0; s < solves; ++s) {
        if (root) {
          linear_step(graph_, piece, system, desk.cholesky, pool);
        } else {
          linear_step_if_determined(graph_, piece, system, desk.cholesky, pool);
        }
      }
    }
    results_[static_cast<std::size_t>(node)] = std::move(pieces);
  }

  const MeasurementGraph<D>& graph_;
  const JoinTree& tree_;
  const JoinOptions& options_;
  WorkerPool& pool_;
  JoinReport& report_;
  std::vector<std::int32_t> rank_;
  std::vector<std::unique_ptr<Desk>> desks_;
  std::vector<std::vector<Piece<D>>> results_;
};

}  // namespace

template <int D>
std::vector<Piece<D>> observing_join(const MeasurementGraph<D>& graph, const JoinTree& tree,
                                     const JoinOptions& options, WorkerPool& pool,
                                     JoinReport& report) {
  return TreeWalk<D>(graph, tree, options, pool, report).run();
}

template std::vector<Piece<2>> observing_join<2>(const MeasurementGraph<2>&, const JoinTree&,
                                                 const JoinOptions&, WorkerPool&, JoinReport&);
template std::vector<Piece<3>> observing_join<3>(const MeasurementGraph<3>&, const JoinTree&,
                                                 const JoinOptions&, WorkerPool&, JoinReport&);

}  // namespace mapjoin
