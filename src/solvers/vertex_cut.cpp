#include "mapjoin/solvers/vertex_cut.h"

#include <algorithm>
#include <cstdlib>

namespace mapjoin {

namespace {

using Index = std::int32_t;

// Ends of a path, besides places.
constexpr Index kNowhere = -1;
constexpr Index kLeftSide = -2;
constexpr Index kRightSide = -3;

std::ptrdiff_t unevenness(std::span<const Side> side) {
  return std::abs(std::ranges::count(side, Side::kLeft) - std::ranges::count(side, Side::kRight));
}

}  // namespace

void VertexCut::begin(const BlockGraph& graph, std::span<const Side> side) {
  band_.clear();
  place_.assign(side.size(), -1);
  for (Index v = 0; v < graph.size(); ++v) {
    if (side[v] != Side::kCut) continue;
    place_[v] = static_cast<Index>(band_.size());
    band_.push_back(v);
  }
  touches_left_.assign(band_.size(), 0);
  touches_right_.assign(band_.size(), 0);
  for (std::size_t i = 0; i < band_.size(); ++i) {
    for (const Index u : graph[band_[i]]) {
      if (side[u] == Side::kLeft) touches_left_[i] = 1;
      if (side[u] == Side::kRight) touches_right_[i] = 1;
    }
  }
  find_neighbours(graph);
  from_.assign(band_.size(), kNowhere);
  to_.assign(band_.size(), kNowhere);
  tried_.resize(2 * band_.size());
}

/// Breadth first from the right, then whatever is left: whoever comes is entered in the lists of
/// its neighbours, so that each list has those nearer to the right first.
void VertexCut::find_neighbours(const BlockGraph& graph) {
  inside_.start.assign(1, 0);
  for (const Index v : band_) {
    const auto inside = std::ranges::count_if(graph[v], [&](Index u) { return place_[u] >= 0; });
    inside_.start.push_back(inside_.start.back() + static_cast<Index>(inside));
  }
  inside_.neighbours.resize(static_cast<std::size_t>(inside_.start.back()));
  to_.assign(inside_.start.begin(), inside_.start.end() - 1);  // where each list goes on
  visited_.assign(band_.size(), 0);
  path_.clear();
  const auto visit = [&](Index i) {
    if (visited_[i] != 0) return;
    visited_[i] = 1;
    path_.push_back(i);
  };
  std::size_t k = 0;
  for (const bool from_right : {true, false}) {
    for (Index i = 0; i < static_cast<Index>(band_.size()); ++i) {
      if (!from_right || touches_right_[i] != 0) visit(i);
    }
    for (; k < path_.size(); ++k) {
      for (const Index u : graph[band_[path_[k]]]) {
        const Index j = place_[u];
        if (j < 0) continue;
        inside_.neighbours[to_[j]++] = path_[k];
        visit(j);
      }
    }
  }
}

/// Where a search goes next from a state; -1 when everything was tried. It may have been there.
Index VertexCut::next_state(Index state) {
  const Index i = state / 2;
  const bool taken = from_[i] != kNowhere;
  if (state % 2 == 0) {
    if (tried_[state]++ > 0) return -1;
    if (!taken) return state + 1;
    return from_[i] >= 0 ? 2 * from_[i] + 1 : -1;  // back along the path that is here
  }
  const std::span<const Index> around = inside_[i];
  const auto count = static_cast<Index>(around.size());
  while (tried_[state] < count) {
    const Index j = around[tried_[state]++];
    if (to_[i] != j && visited_[2 * j] == 0) return 2 * j;
  }
  if (!taken || tried_[state]++ > count) return -1;
  return state - 1;  // the path here is given up
}

/// Depth first, without recursion.
bool VertexCut::find_path(Index source) {
  const auto visit = [&](Index state) {
    visited_[state] = 1;
    tried_[state] = 0;
    path_.push_back(state);
  };
  path_.clear();
  visit(2 * source);
  while (!path_.empty()) {
    const Index state = path_.back();
    if (state % 2 == 1 && touches_right_[state / 2] != 0) return true;
    const Index next = next_state(state);
    if (next < 0) {
      path_.pop_back();
    } else if (visited_[next] == 0) {
      visit(next);
    }
  }
  return false;
}

void VertexCut::reroute() {
  from_[path_.front() / 2] = kLeftSide;
  for (std::size_t k = 1; k < path_.size(); ++k) {
    if (path_[k] % 2 == 1) continue;
    const Index i = path_[k] / 2;
    const Index before = path_[k - 1] / 2;
    if (i == before) {
      from_[i] = to_[i] = kNowhere;
    } else {
      to_[before] = i;
      from_[i] = before;
    }
  }
  to_[path_.back() / 2] = kRightSide;
}

void VertexCut::shrink(const BlockGraph& graph, std::span<Side> side) {
  begin(graph, side);
  // What a search has visited in vain stays in vain until paths change: only a round without any
  // new path has seen everything that can be reached.
  for (bool found = true; found;) {
    found = false;
    visited_.assign(2 * band_.size(), 0);
    for (Index i = 0; i < static_cast<Index>(band_.size()); ++i) {
      if (touches_left_[i] == 0 || from_[i] == kLeftSide || visited_[2 * i] != 0) continue;
      if (!find_path(i)) continue;
      reroute();
      found = true;
    }
  }
  cut_near_left(side);
  right_.assign(side.begin(), side.end());
  cut_near_right(right_);
  if (unevenness(right_) < unevenness(side)) std::ranges::copy(right_, side.begin());
}

/// Everything that could still be reached from the left is left.
void VertexCut::cut_near_left(std::span<Side> side) const {
  for (std::size_t i = 0; i < band_.size(); ++i) {
    const bool enters = visited_[2 * i] != 0 || touches_left_[i] != 0;
    const bool leaves = visited_[2 * i + 1] != 0;
    side[band_[i]] = leaves ? Side::kLeft : enters ? Side::kCut : Side::kRight;
  }
}

/// Everything that could still reach the right is right: the same search backward.
void VertexCut::cut_near_right(std::span<Side> side) {
  visited_.assign(2 * band_.size(), 0);
  path_.clear();
  const auto visit = [&](Index state) {
    if (visited_[state] != 0) return;
    visited_[state] = 1;
    path_.push_back(state);
  };
  for (Index i = 0; i < static_cast<Index>(band_.size()); ++i) {
    if (touches_right_[i] != 0) visit(2 * i + 1);
  }
  while (!path_.empty()) {
    const Index state = path_.back();
    path_.pop_back();
    const Index i = state / 2;
    const bool taken = from_[i] != kNowhere;
    if (state % 2 == 1) {
      if (!taken) visit(2 * i);
      if (to_[i] >= 0) visit(2 * to_[i]);
      continue;
    }
    if (taken) visit(2 * i + 1);
    for (const Index j : inside_[i]) {
      if (to_[j] != i) visit(2 * j + 1);
    }
  }
  for (std::size_t i = 0; i < band_.size(); ++i) {
    const bool enters = visited_[2 * i] != 0;
    const bool leaves = visited_[2 * i + 1] != 0;
    side[band_[i]] = enters ? Side::kRight : leaves ? Side::kCut : Side::kLeft;
  }
}

}  // namespace mapjoin
