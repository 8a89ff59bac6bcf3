#pragma once

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <functional>
#include <utility>
#include <vector>

#include "mapjoin/frames/anchors.h"
#include "mapjoin/graph/testing/variable_conformance.h"

/// \file
/// The conformance suite for kinds of anchors: for tests, like
/// graph/testing/variable_conformance.h.
///
///     std::pair<Values<2>, Anchor<2>> some_map(mapjoin::testing::Generator& generator);
///     MAPJOIN_TEST_ANCHOR(TwoWalls, 2, some_map);

namespace mapjoin::testing {

/// The contract of frames/anchors.h for one kind of anchor in D dimensions.
template <int D>
class AnchorConformance {
 public:
  static constexpr int G = kGauge<D>;
  /// Values in any frame that contain the anchor's variables, and the anchor.
  using RandomCase = std::function<std::pair<Values<D>, Anchor<D>>(Generator&)>;

  explicit AnchorConformance(RandomCase random_case) : random_case_(std::move(random_case)) {}

  /// frame(T x) = frame(x) T^-1.
  void frame_follows_the_map() const {
    for_samples([](Generator& generator, Values<D>& x, const Anchor<D>& anchor) {
      const Rigid<D> here = motion_into(anchor, x);
      const Rigid<D> T = random_motion<D>(generator);
      x.transform(T);
      expect_same(motion_into(anchor, x), here * T.inverse());
    });
  }

  /// Written in the frame, the motion into it is the identity.
  void frame_of_its_own_frame_is_the_identity() const {
    for_samples([](Generator&, Values<D>& x, const Anchor<D>& anchor) {
      x.transform(motion_into(anchor, x));
      expect_same(motion_into(anchor, x), Rigid<D>());
    });
  }

  /// P g can be inverted, and frame(x [+] d) moves by -(P g)^-1 P d: what P holds is the frame.
  void rows_say_how_the_frame_moves() const {
    for_samples([](Generator&, Values<D>& x, const Anchor<D>& anchor) {
      x.transform(motion_into(anchor, x));
      const AnchorRows rows = anchor_rows(anchor, x);
      ASSERT_EQ(rows.P.rows(), G);
      ASSERT_EQ(rows.P.cols(), static_cast<int>(rows.scalars.size()));
      ASSERT_EQ(rows.P.cols(), anchor.kind->tangent);
      const Eigen::FullPivLU<Eigen::MatrixXd> C(rows.C);
      ASSERT_GT(C.rcond(), 1e-9);
      const Eigen::MatrixXd expected = -C.solve(rows.P);
      constexpr double h = 1e-6;
      for (std::size_t k = 0; k < rows.scalars.size(); ++k) {
        Vec<G> moved[2];
        for (const int side : {0, 1}) {
          std::vector<double> d(static_cast<std::size_t>(x.variables().scalars()), 0.0);
          d[static_cast<std::size_t>(rows.scalars[k])] = side == 0 ? h : -h;
          Values<D> y = x;
          y.retract(d);
          moved[side] = twist(motion_into(anchor, y));
        }
        for (int i = 0; i < G; ++i) {
          const double slope = (moved[0](i) - moved[1](i)) / (2.0 * h);
          EXPECT_NEAR(slope, expected(i, static_cast<Eigen::Index>(k)),
                      1e-6 * (1.0 + detail::largest(expected)))
              << "scalar " << k << " moves coordinate " << i << " of the frame";
        }
      }
    });
  }

  /// pin() changes nothing but rounding errors of values in the frame, and fixes them for good.
  void pin_changes_nothing_in_the_frame() const {
    for_samples([](Generator&, Values<D>& x, const Anchor<D>& anchor) {
      x.transform(motion_into(anchor, x));
      Values<D> pinned = x;
      std::vector<double*> pointers;
      for (const int i : anchor_variables(anchor, x.variables()))
        pointers.push_back(pinned.value(i));
      anchor.kind->pin(pointers.data());
      EXPECT_LT(detail::largest(x.local(pinned)), 1e-9);
      expect_same(motion_into(anchor, pinned), Rigid<D>(), 1e-14);
      std::vector<std::vector<double>> once;
      for (std::size_t k = 0; k < pointers.size(); ++k) {
        const int size =
            x.variables().kind(x.variables().require(anchor.keys[k], "pin")).value_size;
        once.emplace_back(pointers[k], pointers[k] + size);
      }
      anchor.kind->pin(pointers.data());
      for (std::size_t k = 0; k < pointers.size(); ++k) {
        for (std::size_t s = 0; s < once[k].size(); ++s) EXPECT_EQ(pointers[k][s], once[k][s]);
      }
    });
  }

 private:
  template <class Check>
  void for_samples(Check&& check) const {
    for (std::uint64_t seed = 1; seed <= 25 && !::testing::Test::HasFailure(); ++seed) {
      SCOPED_TRACE("sample " + std::to_string(seed));
      Generator generator(seed);
      std::pair<Values<D>, Anchor<D>> sample = random_case_(generator);
      check(generator, sample.first, std::as_const(sample.second));
    }
  }
  static Vec<G> twist(const Rigid<D>& motion) {
    Vec<G> out;
    const Vec<kRotation<D>> turn = rotation_log<D, double>(motion.R);
    for (int k = 0; k < G; ++k) out(k) = k < D ? motion.t(k) : turn(k - D);
    return out;
  }
  static void expect_same(const Rigid<D>& a, const Rigid<D>& b, double tolerance = 1e-9) {
    EXPECT_LT(detail::largest(detail::difference(a.R, b.R)), tolerance);
    EXPECT_LT(detail::largest(detail::difference(a.t, b.t)), tolerance * (1.0 + b.t.norm()));
  }

  RandomCase random_case_;
};

}  // namespace mapjoin::testing

#define MAPJOIN_TEST_ANCHOR_LAW(Name, D, random_case, Test, law) \
  TEST(Name##AnchorConformance, Test) {                          \
    ::mapjoin::testing::AnchorConformance<D>(random_case).law(); \
  }

/// Tests a kind of anchor in D dimensions: a name for the tests, and a function that makes up a
/// case.
#define MAPJOIN_TEST_ANCHOR(Name, D, random_case)                                          \
  MAPJOIN_TEST_ANCHOR_LAW(Name, D, random_case, FrameFollowsTheMap, frame_follows_the_map) \
  MAPJOIN_TEST_ANCHOR_LAW(Name, D, random_case, FrameOfItsOwnFrameIsTheIdentity,           \
                          frame_of_its_own_frame_is_the_identity)                          \
  MAPJOIN_TEST_ANCHOR_LAW(Name, D, random_case, RowsSayHowTheFrameMoves,                   \
                          rows_say_how_the_frame_moves)                                    \
  MAPJOIN_TEST_ANCHOR_LAW(Name, D, random_case, PinChangesNothingInTheFrame,               \
                          pin_changes_nothing_in_the_frame)                                \
  static_assert(true, "asks for a semicolon")
