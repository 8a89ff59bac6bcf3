#include "mapjoin/solvers/nested_dissection.h"

#include <algorithm>
#include <exception>
#include <mutex>
#include <numeric>
#include <span>
#include <utility>

#include "mapjoin/solvers/minimum_degree.h"
#include "mapjoin/solvers/patience.h"
#include "mapjoin/solvers/pool_loop.h"
#include "mapjoin/solvers/separator.h"

namespace mapjoin {

namespace {

using Index = std::int32_t;

// Variables that minimum degree orders; and where many of them see the same features, whose poses
// it finds by itself and dissection only looks for longer.
constexpr Index kSmallPart = 1000, kSmallPartWithHubs = 2500;

bool is_small(const BlockGraph& graph) {
  return graph.size() <= kSmallPart || (graph.size() <= kSmallPartWithHubs && has_hubs(graph));
}

/// A part of the graph by itself, to be written to order[begin] and on.
struct Part {
  BlockGraph graph;
  std::vector<Index> variable;  // of the whole graph, per variable of the part
  Index begin = 0;
  Clusters clusters;  // or none yet
};

/// The variables of a part that lie on one side. `number` is a work array.
Part half(const Part& part, std::span<const Side> side, Side which, std::vector<Index>& number) {
  Part out;
  number.assign(side.size(), -1);
  for (Index v = 0; v < part.graph.size(); ++v) {
    if (side[v] != which) continue;
    number[v] = static_cast<Index>(out.variable.size());
    out.variable.push_back(part.variable[v]);
  }
  out.graph = part_of_graph(part.graph, number);
  if (large_enough_for_clusters(out.graph.size()))
    out.clusters = clusters_of_part(part.clusters, number);
  return out;
}

/// Parts that wait, the largest first; taken by any thread.
class Queue {
 public:
  void put(Part part) {
    const std::lock_guard lock(mutex_);
    ++unfinished_;
    parts_.push_back(std::move(part));
    std::push_heap(parts_.begin(), parts_.end(), smaller);
  }
  /// Waits for a part as long as one may still come. \returns whether there was one.
  bool take(Part& part) {
    for (Patience patience;; patience.wait()) {
      const std::lock_guard lock(mutex_);
      if (unfinished_ == 0 || abandoned_) return false;
      if (parts_.empty()) continue;
      std::pop_heap(parts_.begin(), parts_.end(), smaller);
      part = std::move(parts_.back());
      parts_.pop_back();
      return true;
    }
  }
  void finished() {
    const std::lock_guard lock(mutex_);
    --unfinished_;
  }
  /// No more parts are given out.
  void abandon() {
    const std::lock_guard lock(mutex_);
    abandoned_ = true;
  }

 private:
  static bool smaller(const Part& a, const Part& b) {
    return a.variable.size() < b.variable.size();
  }

  std::mutex mutex_;
  std::vector<Part> parts_;
  int unfinished_ = 0;
  bool abandoned_ = false;
};

/// One thread's share of the work.
class Dissector {
 public:
  Dissector(const BlockGraph& graph, int seed, std::span<Index> order)
      : graph_(graph), seed_(seed), order_(order) {}

  void work(Queue& queue) {
    for (Part part; queue.take(part); queue.finished()) {
      const std::span<const Side> side = is_small(part.graph)
                                             ? std::span<const Side>()
                                             : finder_.find(part.graph, part.clusters, seed_);
      if (side.empty()) {
        order_by_degree(part);
      } else {
        divide(part, side, queue);
      }
    }
  }

 private:
  void divide(const Part& part, std::span<const Side> side, Queue& queue) {
    Part left = half(part, side, Side::kLeft, number_);
    Part right = half(part, side, Side::kRight, number_);
    left.begin = part.begin;
    right.begin = left.begin + left.graph.size();
    Index end = right.begin + right.graph.size();
    for (Index v = 0; v < part.graph.size(); ++v) {
      if (side[v] == Side::kCut) order_[end++] = part.variable[v];
    }
    queue.put(std::move(left));
    queue.put(std::move(right));
  }

  /// With the separators around it, which will be eliminated later, so that degrees are right.
  void order_by_degree(const Part& part) {
    place_.resize(static_cast<std::size_t>(graph_.size()), -1);
    std::vector<Index> variables = part.variable;
    const std::size_t own = variables.size();
    for (std::size_t k = 0; k < own; ++k) place_[variables[k]] = static_cast<Index>(k);
    for (std::size_t k = 0; k < own; ++k) {
      for (const Index u : graph_[variables[k]]) {
        if (place_[u] >= 0) continue;
        place_[u] = static_cast<Index>(variables.size());
        variables.push_back(u);
      }
    }
    BlockGraph graph;
    for (std::size_t k = 0; k < variables.size(); ++k) {
      for (const Index u : graph_[variables[k]]) {
        const auto j = static_cast<std::size_t>(place_[u]);
        if (place_[u] >= 0 && (k < own || j < own)) graph.neighbours.push_back(place_[u]);
      }
      graph.end_row();
    }
    std::vector<char> late(variables.size(), 0);
    std::fill(late.begin() + static_cast<std::ptrdiff_t>(own), late.end(), 1);
    const std::vector<Index> order = minimum_degree_in_two(late, std::move(graph));
    for (std::size_t k = 0; k < own; ++k)
      order_[static_cast<std::size_t>(part.begin) + k] = variables[order[k]];
    for (const Index v : variables) place_[v] = -1;
  }

  const BlockGraph& graph_;
  int seed_;
  std::span<Index> order_;
  SeparatorFinder finder_;
  std::vector<Index> number_, place_;
};

}  // namespace

std::vector<Index> nested_dissection(const BlockGraph& graph, int seed, WorkerPool& pool) {
  std::vector<Index> order(static_cast<std::size_t>(graph.size()));
  Part all;
  all.graph = graph;
  all.variable.resize(order.size());
  std::iota(all.variable.begin(), all.variable.end(), 0);
  Queue queue;
  queue.put(std::move(all));
  std::vector<std::exception_ptr> failures(static_cast<std::size_t>(pool.threads()));
  pool.run([&](int thread) {
    try {
      Dissector(graph, seed, order).work(queue);
    } catch (...) {
      failures[static_cast<std::size_t>(thread)] = std::current_exception();
      queue.abandon();
    }
  });
  rethrow_first(failures);
  return order;
}

}  // namespace mapjoin
