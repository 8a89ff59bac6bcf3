#pragma once

#include <algorithm>
#include <numeric>
#include <vector>

namespace mapjoin {

/// Sets of the numbers 0 .. n-1, each named by its lowest member (union-find, paths halved on the
/// way up; no recursion).
class DisjointSets {
 public:
  explicit DisjointSets(int n) : parent_(static_cast<std::size_t>(n)) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }
  int size() const { return static_cast<int>(parent_.size()); }
  /// The lowest member of the set of i.
  int root(int i) {
    while (up(i) != i) i = up(i) = up(up(i));
    return i;
  }
  void unite(int i, int j) {
    i = root(i);
    j = root(j);
    up(std::max(i, j)) = std::min(i, j);
  }

 private:
  int& up(int i) { return parent_[static_cast<std::size_t>(i)]; }

  std::vector<int> parent_;
};

}  // namespace mapjoin
