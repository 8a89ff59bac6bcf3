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
  from_.assign(band_.size(), kNowhere);
  to_.assign(band_.size(), kNowhere);
  tried_.resize(2 * band_.size());
}

/// Where a search goes next from a state; -1 when everything was tried. It may have been there.
Index VertexCut::next_state(const BlockGraph& graph, Index state) {
  const Index i = state / 2;
  const bool taken = from_[i] != kNowhere;
  if (state % 2 == 0) {
    if (tried_[state]++ > 0) return -1;
    if (!taken) return state + 1;
    return from_[i] >= 0 ? 2 * from_[i] + 1 : -1;  // back along the path that is here
  }
  const auto neighbours = graph[band_[i]];
  while (tried_[state] <= static_cast<Index>(neighbours.size())) {
    const Index k = tried_[state]++;
    Index next = -1;
    if (k == 0) {
      if (taken) next = state - 1;  // the path here is given up
    } else {
      const Index j = place_[neighbours[k - 1]];
      if (j >= 0 && to_[i] != j) next = 2 * j;
    }
    if (next >= 0 && visited_[next] == 0) return next;
  }
  return -1;
}

/// Depth first, without recursion.
bool VertexCut::find_path(const BlockGraph& graph, Index source) {
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
    const Index next = next_state(graph, state);
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
      if (!find_path(graph, i)) continue;
      reroute();
      found = true;
    }
  }
  cut_near_left(side);
  right_.assign(side.begin(), side.end());
  cut_near_right(graph, right_);
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
void VertexCut::cut_near_right(const BlockGraph& graph, std::span<Side> side) {
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
    for (const Index u : graph[band_[i]]) {
      const Index j = place_[u];
      if (j >= 0 && to_[j] != i) visit(2 * j + 1);
    }
  }
  for (std::size_t i = 0; i < band_.size(); ++i) {
    const bool enters = visited_[2 * i] != 0;
    const bool leaves = visited_[2 * i + 1] != 0;
    side[band_[i]] = enters ? Side::kRight : leaves ? Side::kCut : Side::kLeft;
  }
}

}  // namespace mapjoin
