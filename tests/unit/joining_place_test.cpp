// Pieces of maps laid on one another, before any solve.
#include "mapjoin/joining/place.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <random>
#include <vector>

#include "mapjoin/graph/builtin_types.h"
#include "mapjoin/joining/options.h"
#include "mapjoin/joining/report.h"
#include "mapjoin/joining/sharing.h"
#include "mapjoin/solvers/pool_loop.h"

namespace mapjoin::test {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;

Rigid<2> pose(double x, double y, double angle) {
  Rigid<2> out;
  out.R << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle);
  out.t << x, y;
  return out;
}

double angle_of(const Rigid<2>& x) { return std::atan2(x.R(1, 0), x.R(0, 0)); }

/// Poses around a ring, driven once, in pieces that share their ends.
class Ring {
 public:
  static constexpr int kPieces = 8;
  static constexpr int kPosesOfPiece = 40;
  static constexpr int kPoses = kPieces * kPosesOfPiece;

  explicit Ring(int points = 0) {
    MeasurementGraphBuilder<2> builder;
    const Mat<3, 3> information = Mat<3, 3>::Identity();
    for (int k = 0; k < kPoses; ++k)
      builder.add<PoseType<2>>(key(k), key(k + 1), Rigid<2>(), information);
    for (int p = 0; p < points; ++p)
      builder.add<PointType<2>>(key(0), point_key(static_cast<std::uint64_t>(p)), Vec<2>(1, 1),
                                Mat<2, 2>::Identity());
    graph_ = std::move(builder).build();
  }

  /// Each piece turns `excess` too much on its way, and begins at the origin.
  std::vector<Piece<2>> pieces(double excess) const {
    std::vector<Piece<2>> out;
    for (int p = 0; p < kPieces; ++p) {
      std::vector<Rigid<2>> poses{Rigid<2>()};
      for (int k = 0; k < kPosesOfPiece; ++k) poses.push_back(poses.back() * step(excess));
      std::vector<int> variables;
      for (int k = 0; k <= kPosesOfPiece; ++k) variables.push_back(number(p * kPosesOfPiece + k));
      std::vector<int> sorted = variables;
      std::sort(sorted.begin(), sorted.end());
      Piece<2> piece = make_piece(all(), sorted);
      for (int k = 0; k <= kPosesOfPiece; ++k) {
        const auto at =
            std::lower_bound(sorted.begin(), sorted.end(), variables[static_cast<std::size_t>(k)]) -
            sorted.begin();
        rigid(piece, static_cast<int>(at)) = poses[static_cast<std::size_t>(k)];
      }
      out.push_back(std::move(piece));
    }
    return out;
  }

  /// From each pose of a united piece to the next, against what the pieces say: the largest
  /// difference, rad and m.
  std::array<double, 2> largest_gap(Piece<2>& piece, double excess) const {
    std::array<double, 2> out{0.0, 0.0};
    for (int k = 0; k < kPoses; ++k) {
      const Rigid<2> between = rigid(piece, number(k)).inverse() * rigid(piece, number(k + 1));
      const Rigid<2> gap = step(excess).inverse() * between;
      out[0] = std::max(out[0], std::abs(angle_of(gap)));
      out[1] = std::max(out[1], gap.t.norm());
    }
    return out;
  }

  const VariableSet<2>& all() const { return graph_.variables; }
  static Key key(int k) { return pose_key(static_cast<std::uint64_t>(k % kPoses)); }
  int number(int k) const { return all().find(key(k)).value(); }
  Rigid<2>& rigid(Piece<2>& piece, int place) const {
    return *reinterpret_cast<Rigid<2>*>(value_of(all(), piece, place));
  }

 private:
  static Rigid<2> step(double excess) {
    return pose(1.0, 0.0, (kTurn / kPieces + excess) / kPosesOfPiece);
  }

  MeasurementGraph<2> graph_;
};

TEST(Place, SpreadsTheErrorOfALoopOverAllSeams) {
  constexpr double kExcess = 0.02;  // 0.16 rad all around
  const Ring ring;
  Places places(ring.all().size());
  std::vector<Piece<2>> placed = place(ring.all(), ring.pieces(kExcess), places);
  ASSERT_EQ(placed.size(), 1U);
  ASSERT_EQ(placed[0].size(), Ring::kPoses);
  const auto spread = ring.largest_gap(placed[0], kExcess);

  // What laying each but once on those before it leaves, where the loop is closed last.
  std::vector<Piece<2>> pieces = ring.pieces(kExcess);
  const auto groups = place_groups(ring.all(), pieces, places);
  ASSERT_EQ(groups.size(), 1U);
  Piece<2> once = unite(ring.all(), pieces, groups[0].members);
  const auto left = ring.largest_gap(once, kExcess);
  EXPECT_GT(left[0], 0.07);
  EXPECT_LT(spread[0], 0.4 * left[0]);
  EXPECT_LT(spread[1], 0.4 * left[1]);
}

TEST(Place, LeavesPiecesThatMeetAsTheyAre) {
  const Ring ring;
  Places places(ring.all().size());
  std::vector<Piece<2>> placed = place(ring.all(), ring.pieces(0.0), places);
  ASSERT_EQ(placed.size(), 1U);
  const auto gap = ring.largest_gap(placed[0], 0.0);
  EXPECT_LT(gap[0], 1e-12);
  EXPECT_LT(gap[1], 1e-10);
}

TEST(Unite, TakesTheMeanOfWhatSeveralPiecesHold) {
  const Ring ring(1);
  const int a = ring.number(3);
  const int point = ring.all().find(point_key(0)).value();
  std::vector<Piece<2>> pieces;
  for (int p = 0; p < 3; ++p) {
    Piece<2> piece = make_piece(ring.all(), {std::min(a, point), std::max(a, point)});
    ring.rigid(piece, a < point ? 0 : 1) = pose(p, 2.0 * p, 0.1 * p);
    double* const x = value_of(ring.all(), piece, a < point ? 1 : 0);
    x[0] = 3.0 * p;
    x[1] = 1.0;
    pieces.push_back(piece);
  }
  Piece<2> first = unite(ring.all(), pieces, {0, 1, 2});
  EXPECT_EQ(angle_of(ring.rigid(first, a < point ? 0 : 1)), 0.0);
  EXPECT_EQ(value_of(ring.all(), first, a < point ? 1 : 0)[0], 0.0);
  Piece<2> mean = unite(ring.all(), pieces, {0, 1, 2}, SharedValue::kMean);
  const Rigid<2>& x = ring.rigid(mean, a < point ? 0 : 1);
  EXPECT_NEAR(angle_of(x), 0.1, 1e-12);
  EXPECT_LT((x.t - Vec<2>(1.0, 2.0)).norm(), 1e-12);
  EXPECT_NEAR(value_of(ring.all(), mean, a < point ? 1 : 0)[0], 3.0, 1e-12);
  EXPECT_EQ(mean.variables, first.variables);
}

TEST(Unite, KeepsTheFirstOfHeadingsThatContradictOneAnother) {
  const Ring ring;
  std::vector<Piece<2>> pieces;
  for (int p = 0; p < 2; ++p) {
    pieces.push_back(make_piece(ring.all(), {ring.number(3)}));
    ring.rigid(pieces.back(), 0) = pose(p, 0.0, 0.6 * p);
  }
  Piece<2> out = unite(ring.all(), pieces, {1, 0}, SharedValue::kMean);
  EXPECT_EQ(angle_of(ring.rigid(out, 0)), angle_of(pose(1.0, 0.0, 0.6)));
  EXPECT_EQ(ring.rigid(out, 0).t(0), 1.0);
}

/// A chain of poses, and pieces that hold any of them, at x = their number.
struct Scattered {
  MeasurementGraph<2> graph;
  std::vector<Piece<2>> pieces;

  Scattered(int poses, const std::vector<double>& shares) {
    MeasurementGraphBuilder<2> builder;
    for (int k = 0; k + 1 < poses; ++k) {
      const auto id = static_cast<std::uint64_t>(k);
      builder.add<PoseType<2>>(pose_key(id), pose_key(id + 1), Rigid<2>(), Mat<3, 3>::Identity());
    }
    graph = std::move(builder).build();
    std::mt19937 random(1);
    for (const double share : shares) {
      std::bernoulli_distribution holds(share);
      std::vector<int> variables;
      for (int v = 0; v < poses; ++v) {
        if (holds(random)) variables.push_back(v);
      }
      Piece<2> piece = make_piece(graph.variables, variables);
      for (int k = 0; k < piece.size(); ++k)
        *reinterpret_cast<Rigid<2>*>(value_of(graph.variables, piece, k)) =
            pose(variables[static_cast<std::size_t>(k)], 0.0, 0.0);
      pieces.push_back(std::move(piece));
    }
  }
};

TEST(Unite, HoldsEveryVariableOnceAndInOrderForAnyNumberOfThreads) {
  constexpr int kPoses = 70000;  // more than two bytes can count
  for (const int threads : {1, 2, 5}) {
    Scattered world(kPoses, {0.3, 0.001, 0.3, 0.0, 0.2});
    std::vector<char> held(kPoses, 0);
    for (const Piece<2>& piece : world.pieces) {
      for (const int v : piece.variables) held[static_cast<std::size_t>(v)] = 1;
    }
    std::vector<int> expected;
    for (int v = 0; v < kPoses; ++v) {
      if (held[static_cast<std::size_t>(v)] != 0) expected.push_back(v);
    }
    WorkerPool pool(threads);
    Piece<2> out = unite(world.graph.variables, world.pieces, {2, 0, 3, 4, 1}, SharedValue::kMean,
                         loop_on(pool));
    ASSERT_EQ(out.variables, expected);
    for (int k = 0; k < out.size(); ++k) {
      const double x = value_of(world.graph.variables, out, k)[4];  // R, then t
      ASSERT_NEAR(x, expected[static_cast<std::size_t>(k)], 1e-9);
    }
  }
}

TEST(Sharing, ListsWhoHoldsWhatIsHeldMoreThanOnce) {
  const Scattered world(500, {0.5, 0.02, 0.3, 0.0, 0.4, 0.02});
  std::map<int, std::vector<std::array<int, 2>>> holders;  // of each variable: piece, place
  for (int p = 0; p < 6; ++p) {
    const Piece<2>& piece = world.pieces[static_cast<std::size_t>(p)];
    for (int k = 0; k < piece.size(); ++k)
      holders[piece.variables[static_cast<std::size_t>(k)]].push_back({p, k});
  }
  Places places(500);
  const Sharing sharing(world.pieces, places);
  for (int v = 0; v < 500; ++v) EXPECT_EQ(places[v], -1);
  EXPECT_EQ(sharing.variables(),
            std::ranges::count_if(holders, [](const auto& h) { return h.second.size() > 1; }));
  for (int p = 0; p < 6; ++p) {
    std::size_t next = 0;
    for (const auto& [variable, list] : holders) {  // ascending, as places are
      const auto own =
          std::ranges::find_if(list, [&](const std::array<int, 2>& h) { return h[0] == p; });
      if (own == list.end() || list.size() < 2) continue;
      ASSERT_LT(next, sharing.of(p).size());
      const Sharing::Shared shared = sharing.of(p)[next++];
      EXPECT_EQ(shared.place, (*own)[1]);
      std::vector<std::array<int, 2>> found;
      for (const Sharing::Holder& h : sharing.holders(shared.number))
        found.push_back({h.piece, h.place});
      EXPECT_EQ(found, list);
    }
    EXPECT_EQ(next, sharing.of(p).size());
  }
}

TEST(SubmapSizes, AreTwoUpToAMillionVariablesUnlessAskedFor) {
  const JoinOptions own;
  EXPECT_EQ(submap_sizes(own, 10), (std::vector<std::int64_t>{64}));
  EXPECT_EQ(submap_sizes(own, 2048), (std::vector<std::int64_t>{64, 2048}));
  EXPECT_EQ(submap_sizes(own, 1000000), (std::vector<std::int64_t>{64, 2048}));
  EXPECT_EQ(submap_sizes(own, 3000000), (std::vector<std::int64_t>{64, 2048, 2097152}));
  JoinOptions asked;
  asked.leaf_variables = 10;
  asked.arity = 4;
  EXPECT_EQ(submap_sizes(asked, 1000), (std::vector<std::int64_t>{10, 40, 160, 640}));
}

}  // namespace
}  // namespace mapjoin::test
