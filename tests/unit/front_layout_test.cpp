#include "mapjoin/solvers/front_layout.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "tests/support/clique_problem.h"

namespace mapjoin {
namespace {

using testing_support::analyze;
using testing_support::grid_problem;

using Place = std::pair<std::int64_t, std::int64_t>;  // begin, end

Place place_of(const FrontalStructure& s, std::int32_t f) {
  const Front& front = s.fronts[static_cast<std::size_t>(f)];
  return {front.update, front.update + update_size(front)};
}

bool overlap(const Place& a, const Place& b) {
  return std::max(a.first, b.first) < std::min(a.second, b.second);
}

/// In the order of the fronts, as one thread eliminates them: a front's update matrix must not lie
/// on any that still waits for its parent, nor on those it takes in.
void expect_no_live_update_overwritten(const FrontalStructure& s) {
  std::vector<std::int32_t> live;
  for (std::int32_t f = 0; f < static_cast<std::int32_t>(s.fronts.size()); ++f) {
    for (const std::int32_t other : live)
      ASSERT_FALSE(overlap(place_of(s, f), place_of(s, other))) << f << " lies on " << other;
    const auto children = s.children_of(f);
    std::erase_if(live, [&](std::int32_t other) {
      return std::find(children.begin(), children.end(), other) != children.end();
    });
    live.push_back(f);
  }
}

TEST(FrontLayout, NeverPutsAnUpdateMatrixOnOneThatIsStillNeeded) {
  for (const int side : {1, 7, 25, 60}) {
    SCOPED_TRACE(side);
    expect_no_live_update_overwritten(analyze(grid_problem(side, side, 3)));
  }
}

TEST(FrontLayout, PutsOnStacksWhatTheSameTaskUsesAndNothingElse) {
  const FrontalStructure s = analyze(grid_problem(60, 60, 3));
  int on_stack = 0, in_workspace = 0;
  for (const FrontTask& task : s.tasks) {
    for (std::int32_t f = task.begin; f < task.end; ++f) {
      const Front& front = s.fronts[static_cast<std::size_t>(f)];
      const Place place = place_of(s, f);
      EXPECT_GE(place.first, front.pivot_dim / kRowGroup * kRowGroup) << "starts before its memory";
      if (s.is_on_stack(front)) {
        ++on_stack;
        EXPECT_EQ(task.waits_for, 0);
        EXPECT_LT(front.parent, task.end) << "another task's thread looks for it elsewhere";
        EXPECT_LE(place.second, s.update_stack);
      } else {
        ++in_workspace;
        EXPECT_LE((place.second - s.update_stack) * 8, s.statistics.workspace_bytes);
      }
    }
  }
  EXPECT_GT(on_stack, 10 * in_workspace);
  EXPECT_GT(in_workspace, 0);
}

/// Of a task's update matrices that are not on a stack.
std::vector<Place> workspace_places(const FrontalStructure& s, const FrontTask& task) {
  std::vector<Place> places;
  for (std::int32_t f = task.begin; f < task.end; ++f) {
    if (!s.is_on_stack(s.fronts[static_cast<std::size_t>(f)])) places.push_back(place_of(s, f));
  }
  return places;
}

/// Tasks that do not wait for one another may run at the same time.
TEST(FrontLayout, KeepsTasksThatMayRunAtTheSameTimeApartInTheWorkspace) {
  const FrontalStructure s = analyze(grid_problem(40, 90, 2));
  const auto tasks = static_cast<int>(s.tasks.size());
  const auto is_above = [&](int a, int b) {  // whether b ends in a
    while (b >= 0 && b < a) b = s.tasks[static_cast<std::size_t>(b)].parent;
    return a == b;
  };
  std::vector<std::vector<Place>> places;
  for (const FrontTask& task : s.tasks) places.push_back(workspace_places(s, task));
  int pairs = 0;
  for (int a = 0; a < tasks; ++a) {
    for (int b = 0; b < a; ++b) {
      if (is_above(a, b)) continue;
      ++pairs;
      for (const Place& one : places[static_cast<std::size_t>(a)]) {
        for (const Place& other : places[static_cast<std::size_t>(b)])
          EXPECT_FALSE(overlap(one, other)) << "tasks " << a << " and " << b;
      }
    }
  }
  EXPECT_GT(pairs, 20);
}

}  // namespace
}  // namespace mapjoin
