// Local maps: the optimum of their measurements, in any frame, by either builder.
#include "mapjoin/building/build.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <span>
#include <utility>

#include "mapjoin/building/solve.h"
#include "mapjoin/evaluation/chi_squared.h"
#include "mapjoin/evaluation/consistency.h"
#include "mapjoin/evaluation/evaluate.h"
#include "mapjoin/evaluation/simulate.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/frames/exact_gauge.h"
#include "mapjoin/frames/local_map.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/solvers/marginalize.h"
#include "tests/support/driven_worlds.h"

namespace mapjoin {
namespace {

using By = SegmentRule::By;
using test::Drive;
using test::drive;
using test::DrivenWorld;
using test::Sensor;

template <int D>
Simulation<D> world(World kind, int poses, double noise = 1.0) {
  SimulationOptions options = simulation_defaults(kind);
  options.poses = poses;
  options.noise = noise;
  return simulate<D>(options);
}

template <int D>
Segmentation in_one(const RawLog<D>& log) {
  Segmentation out;
  out.maps.emplace_back(log.size());
  std::iota(out.maps[0].begin(), out.maps[0].end(), 0);
  return out;
}

template <int D>
void expect_same(const Map<D>& a, const Map<D>& b, double tolerance) {
  ASSERT_EQ(a.variables(), b.variables());
  const Map<D> there = change_frame(b, a.anchor);
  EXPECT_LT(a.values.local(there.values).cwiseAbs().maxCoeff(), tolerance);
  const Eigen::MatrixXd I = a.information.dense();
  EXPECT_LT((I - there.information.dense()).cwiseAbs().maxCoeff(),
            tolerance * I.cwiseAbs().maxCoeff());
}

/// Joining the measurements as they are and refining ends in the same optimum.
template <int D>
void expect_optimum(const MeasurementGraph<D>& graph) {
  const RawLog<D> log = raw_log(graph);
  const BuiltMaps<D> built = build_local_maps(log, in_one(log));
  ASSERT_EQ(built.maps.size(), 1U);
  EXPECT_TRUE(is_gauge_free(built.maps[0]));
  const JoinResult<D> joined = join_all(graph, {});
  EXPECT_NEAR(built.chi2, joined.report.chi2, 1e-6 * joined.report.chi2);
  EXPECT_NEAR(chi2(built.maps[0].values, graph), built.chi2, 1e-9 * built.chi2);
  expect_same(built.maps[0], joined.maps[0], 2e-4);
}

TEST(BuiltMaps, AreTheOptimumOfTheirMeasurements) {
  expect_optimum(world<2>(World::kLandmarks2d, 60).graph);
  expect_optimum(world<2>(World::kManhattan, 60).graph);
  expect_optimum(world<3>(World::kLandmarks3d, 40).graph);
  expect_optimum(world<3>(World::kGrid3d, 40).graph);
}

TEST(BuiltMaps, AreTheSameInWhateverFrame) {
  const RawLog<2> log = drive({.sensor = Sensor::kRangeBearing, .poses = 60}).log;
  const Segmentation segments = segment(log, {By::kPoses, 20});
  const BuiltMaps<2> start = build_local_maps(log, segments);
  for (const LocalFrame frame : {LocalFrame::kEnd, LocalFrame::kFeatures}) {
    const BuiltMaps<2> other = build_local_maps(log, segments, {.frame = frame});
    ASSERT_EQ(other.maps.size(), start.maps.size());
    for (std::size_t k = 0; k < start.maps.size(); ++k) {
      EXPECT_FALSE(other.maps[k].anchor == start.maps[k].anchor);
      expect_same(start.maps[k], other.maps[k], 1e-8);
    }
  }
}

TEST(BuiltMaps, HaveTheSameBitsForAnyNumberOfThreads) {
  const RawLog<2> log = drive({}).log;
  const Segmentation segments = segment(log, {By::kPoses, 15});
  const BuiltMaps<2> one = build_local_maps(log, segments);
  const BuiltMaps<2> three = build_local_maps(log, segments, {.threads = 3});
  ASSERT_EQ(one.maps.size(), three.maps.size());
  for (std::size_t k = 0; k < one.maps.size(); ++k) {
    EXPECT_EQ(one.maps[k].information, three.maps[k].information);
    for (int c = 0; c < static_cast<int>(one.maps[k].variables().columns().size()); ++c) {
      const auto& column = one.maps[k].variables().column(c);
      const int doubles = column.size() * column.kind->value_size;
      EXPECT_TRUE(std::equal(one.maps[k].values.data(c), one.maps[k].values.data(c) + doubles,
                             three.maps[k].values.data(c)));
    }
  }
}

/// What a map carries as its observations says the same as the map, anywhere near.
template <int D>
void expect_same_observation(const RawLog<D>& log, LocalFrame frame) {
  const BuiltMaps<D> built =
      build_local_maps(log, segment(log, {By::kPoses, 12}), {.frame = frame});
  for (const Map<D>& map : built.maps) {
    ASSERT_NE(map.observations, nullptr);
    MeasurementGraphBuilder<D> whole;
    whole.add(as_local_map(map));
    const MeasurementGraph<D> dense = std::move(whole).build();
    Values<D> x = map.values;
    EXPECT_NEAR(chi2(x, *map.observations), 0.0, 1e-9);
    std::vector<double> d(static_cast<std::size_t>(x.variables().scalars()));
    for (std::size_t k = 0; k < d.size(); ++k) d[k] = 0.05 * std::sin(static_cast<double>(7 * k));
    x.retract(d);
    const double wanted = chi2(x, dense);
    EXPECT_NEAR(chi2(x, *map.observations), wanted, 1e-9 * wanted);
  }
}

TEST(BuiltMaps, AreObservationsOfThemselves) {
  const RawLog<2> plane = drive({.poses = 40}).log;
  expect_same_observation(plane, LocalFrame::kStart);
  expect_same_observation(plane, LocalFrame::kEnd);
  const RawLog<3> space = raw_log(world<3>(World::kLandmarks3d, 30).graph);
  expect_same_observation(space, LocalFrame::kStart);
}

/// An observation has an anchor of its own, so a map in a frame of features is taken apart like
/// any.
TEST(BuiltMaps, JoinTheSameFromFramesOfFeatures) {
  const auto joined = [](const auto& log, LocalFrame frame, Mode mode) {
    const auto built = build_local_maps(log, segment(log, {By::kPoses, 12}), {.frame = frame});
    JoinOptions options;
    options.mode = mode;
    return join_all(std::span(std::as_const(built.maps)), {}, options).maps.at(0);
  };
  const RawLog<2> plane = drive({.poses = 40}).log;
  const RawLog<3> space = raw_log(world<3>(World::kLandmarks3d, 40).graph);
  for (const Mode mode : {Mode::kObserve, Mode::kOptimal}) {
    const Map<2> start = joined(plane, LocalFrame::kStart, mode);
    const Map<2> features = joined(plane, LocalFrame::kFeatures, mode);
    EXPECT_EQ(start.observations->size(), features.observations->size());  // as sparse
    expect_same(start, features, 1e-9);
    expect_same(joined(space, LocalFrame::kStart, mode), joined(space, LocalFrame::kFeatures, mode),
                1e-9);
  }
}

TEST(BuiltMaps, MeasurementsOfSeveralModelsGoTogether) {
  RawLogBuilder<2> builder;
  const Mat<2, 2> I = 100.0 * Mat<2, 2>::Identity();
  builder.add<VelocityTurnRate>(pose_key(0), pose_key(1), {1.0, 0.0, 1.0},
                                100.0 * Mat<3, 3>::Identity());
  builder.add<RangeBearing>(pose_key(0), point_key(5), {std::sqrt(8.0), std::atan2(2.0, 2.0)}, I);
  builder.add<RelativeModel<Point2>>(pose_key(1), point_key(5), {1.0, 2.0}, I);
  builder.add<BearingOnly>(pose_key(1), point_key(5), Vec<1>(std::atan2(2.0, 1.0)),
                           Mat<1, 1>(100.0));
  const RawLog<2> log = std::move(builder).build();
  const BuiltMaps<2> built = build_local_maps(log, in_one(log));
  ASSERT_EQ(built.maps.size(), 1U);
  EXPECT_NEAR(built.chi2, 0.0, 1e-12);
  EXPECT_TRUE(built.maps[0].values.point(point_key(5)).isApprox(Vec<2>(2.0, 2.0), 1e-9));
  MeasurementGraph<2> graph;
  EXPECT_FALSE(as_graph(log, graph));
}

TEST(BuiltMaps, AFilterAgreesInTheLimitOfSmallNoise) {
  for (const Sensor sensor : {Sensor::kRangeBearing, Sensor::kPoint}) {
    double before = 0.0;
    for (const double noise : {1.0, 1e-2, 1e-4}) {
      const DrivenWorld w = drive({.sensor = sensor, .poses = 30, .noise = noise});
      const Segmentation segments = in_one(w.log);
      const BuiltMaps<2> nls = build_local_maps(w.log, segments);
      const BuiltMaps<2> ekf = build_local_maps(w.log, segments, {.builder = Builder::kFilter});
      const double apart =
          nls.maps[0].values.local(ekf.maps[0].values).cwiseAbs().maxCoeff() / noise;
      if (noise < 1.0) {
        EXPECT_LT(apart, 0.05 * before) << noise;
      }
      before = apart;
      if (noise < 1e-3) {
        expect_same(nls.maps[0], ekf.maps[0], 1e-3);
        EXPECT_NEAR(nls.chi2, ekf.chi2, 1e-3 * nls.chi2);
      }
    }
  }
}

TEST(BuiltMaps, AFilterOfRangesAgreesToo) {
  const DrivenWorld w = drive({.sensor = Sensor::kRange, .poses = 60, .noise = 1e-4});
  const Segmentation segments = in_one(w.log);
  const BuiltMaps<2> nls = build_local_maps(w.log, segments);
  const BuiltMaps<2> ekf = build_local_maps(w.log, segments, {.builder = Builder::kFilter});
  ASSERT_GT(nls.maps[0].variables().size(), 65);
  expect_same(nls.maps[0], ekf.maps[0], 1e-3);
}

TEST(BuiltMaps, WhatIsNotKeptIsMarginalised) {
  const RawLog<2> log = drive({.poses = 40}).log;
  const Segmentation segments = segment(log, {By::kPoses, 20});
  for (const Builder builder : {Builder::kNonlinear, Builder::kFilter}) {
    const BuiltMaps<2> all = build_local_maps(log, segments, {.builder = builder});
    const BuiltMaps<2> end =
        build_local_maps(log, segments, {.builder = builder, .keep = Keep::kEndPose});
    const BuiltMaps<2> features =
        build_local_maps(log, segments, {.builder = builder, .keep = Keep::kFeatures});
    for (std::size_t k = 0; k < all.maps.size(); ++k) {
      const VariableSet<2>& kept = end.maps[k].variables();
      EXPECT_EQ(kept.column(kept.find_column(Tag("pose"))).size(), 2);
      std::vector<Key> keys;
      for (int i = 0; i < kept.size(); ++i) keys.push_back(kept.key(i));
      expect_same(marginalize(all.maps[k], std::span<const Key>(keys)), end.maps[k], 1e-6);
      EXPECT_LT(features.maps[k].variables().find_column(Tag("pose")), 0);
      const std::vector<int> points = features_of(all.maps[k].variables());
      expect_same(features.maps[k],
                  marginalize(all.maps[k], std::span<const int>(points), features.maps[k].anchor),
                  1e-6);
    }
  }
}

TEST(BuiltMaps, KeepThePosesThatOthersKnowOf) {
  const RawLog<2> log = raw_log(world<2>(World::kManhattan, 200).graph);
  const Segmentation segments = segment(log, {By::kPoses, 40});
  const BuiltMaps<2> built = build_local_maps(log, segments, {.keep = Keep::kEndPose});
  const JoinResult<2> joined = join_all(std::span<const Map<2>>(built.maps), {}, {});
  EXPECT_EQ(joined.maps.size(), 1U);
  const JoinResult<2> full = join_all(world<2>(World::kManhattan, 200).graph, {});
  EXPECT_LT(deviation(joined.maps[0].values, full.maps[0].values).pose_rmse, 0.05);
}

template <int D>
void expect_one_optimum(const MeasurementGraph<D>& graph, bool features) {
  const RawLog<D> log = raw_log(graph);
  const double wanted = join_all(graph, {}).report.chi2;
  for (const double maps : {1.0, 3.0, 8.0, 50.0}) {
    for (const Builder builder : {Builder::kNonlinear, Builder::kFilter}) {
      for (const LocalFrame frame : {LocalFrame::kStart, LocalFrame::kEnd, LocalFrame::kFeatures}) {
        if (frame == LocalFrame::kFeatures && !features) continue;
        const SolvedLog<D> solved = solve_by_local_maps(log, segment(log, {By::kMaps, maps}),
                                                        {.builder = builder, .frame = frame}, {});
        EXPECT_NEAR(solved.result.report.chi2, wanted, 1e-6 * wanted) << maps;
        EXPECT_TRUE(solved.result.report.minimum);
      }
    }
  }
}

TEST(BuiltMaps, TheOptimumDoesNotDependOnHowTheRecordingWasCut) {
  expect_one_optimum(world<2>(World::kLandmarks2d, 100).graph, true);
  expect_one_optimum(world<2>(World::kManhattan, 100).graph, false);
  expect_one_optimum(world<3>(World::kGrid3d, 60).graph, false);
}

TEST(BuiltMaps, PiecesThatFallApartAreMapsOfTheirOwn) {
  MeasurementGraphBuilder<2> builder;
  const Mat<3, 3> I = Mat<3, 3>::Identity();
  for (const std::uint64_t i : {0, 1, 2, 10, 11})
    builder.add<Pose2>(pose_key(i), pose_key(i + 1), rigid2(1, 0, 0.1), I);
  const RawLog<2> log = raw_log(std::move(builder).build());
  const BuiltMaps<2> built = build_local_maps(log, in_one(log));
  ASSERT_EQ(built.maps.size(), 2U);
  EXPECT_EQ(built.maps[0].anchor.keys[0], pose_key(0));
  EXPECT_EQ(built.maps[1].anchor.keys[0], pose_key(10));
}

/// Beacons of ranges alone from a straight line may be on either side of it.
TEST(Delayed, RangesFromALineAreRefusedAndFromABendNot) {
  for (const bool bend : {false, true}) {
    RawLogBuilder<2> builder;
    const Vec<2> beacon(5.0, 3.0);
    Rigid2 pose;
    for (std::uint64_t i = 0; i < 8; ++i) {
      builder.add<RangeOnly>(pose_key(i), point_key(0), Vec<1>((beacon - pose.t).norm()),
                             Mat<1, 1>(400.0));
      const Rigid2 step = rigid2(0.8, 0.0, bend ? 0.3 : 0.0);
      if (i < 7)
        builder.add<RelativeModel<Pose2>>(pose_key(i), pose_key(i + 1), step,
                                          1e4 * Mat<3, 3>::Identity());
      pose = pose * step;
    }
    const RawLog<2> log = std::move(builder).build();
    const BuiltMaps<2> built = build_local_maps(log, in_one(log));
    ASSERT_EQ(built.maps.size(), 1U);
    EXPECT_EQ(built.refused.size(), bend ? 0U : 8U);
    EXPECT_EQ(built.used.size() + built.refused.size(), log.size());
    const auto found = built.maps[0].variables().find(point_key(0));
    EXPECT_EQ(found.has_value(), bend);
    if (bend) {
      EXPECT_TRUE(built.maps[0].values.point(point_key(0)).isApprox(beacon, 1e-6));
    }
  }
}

TEST(Delayed, ParallelBearingsAreRefusedAndCrossingOnesNot) {
  for (const double baseline : {0.001, 2.0}) {
    RawLogBuilder<2> builder;
    const Vec<2> beacon(3.0, 4.0);
    for (std::uint64_t i = 0; i < 3; ++i) {
      const Vec<2> p = beacon - Vec<2>(baseline * static_cast<double>(i), 0.0);
      builder.add<BearingOnly>(pose_key(i), point_key(0), Vec<1>(std::atan2(p(1), p(0))),
                               Mat<1, 1>(1e4));
      builder.add<RelativeModel<Pose2>>(pose_key(i), pose_key(i + 1), rigid2(baseline, 0, 0),
                                        1e6 * Mat<3, 3>::Identity());
    }
    const RawLog<2> log = std::move(builder).build();
    const BuiltMaps<2> built = build_local_maps(log, in_one(log));
    EXPECT_EQ(built.refused.size(), baseline > 1.0 ? 0U : 3U);
  }
}

TEST(Delayed, MeasurementsAreCarriedOverToWhereTheyPlaceTheirFeature) {
  for (const Sensor sensor : {Sensor::kRange, Sensor::kBearing}) {
    const DrivenWorld w = drive({.sensor = sensor});
    const Segmentation segments = segment(w.log, {By::kPoses, 20});
    const BuiltMaps<2> built = build_local_maps(w.log, segments);
    ASSERT_GT(built.maps.size(), 2U);
    EXPECT_LT(built.refused.size(), w.log.size() / 20);
    EXPECT_EQ(built.used.size() + built.refused.size(), w.log.size());
  }
}

/// The sum of NEES over many worlds lies in its interval.
void expect_consistent(Sensor sensor) {
  double nees = 0.0;
  int dimension = 0;
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const DrivenWorld w = drive({.sensor = sensor, .poses = 45, .beacons = 15, .seed = seed});
    const SolvedLog<2> solved =
        solve_by_local_maps(w.log, segment(w.log, {By::kPoses, 15}), {}, {});
    ASSERT_EQ(solved.result.maps.size(), 1U) << seed;
    const Consistency c = consistency(solved.result.maps[0], w.truth);
    nees += c.nees;
    dimension += c.dimension;
  }
  ::testing::Test::RecordProperty("nees_per_dimension", std::to_string(nees / dimension));
  EXPECT_GT(nees, chi_squared_quantile(0.025, dimension)) << nees / dimension;
  EXPECT_LT(nees, chi_squared_quantile(0.975, dimension)) << nees / dimension;
}

TEST(BuiltMaps, OfRangesAndBearingsAreConsistent) { expect_consistent(Sensor::kRangeBearing); }
TEST(BuiltMaps, OfRangesAloneAreConsistent) { expect_consistent(Sensor::kRange); }
TEST(BuiltMaps, OfBearingsAloneAreConsistent) { expect_consistent(Sensor::kBearing); }

TEST(BuiltMaps, ARobustLossKeepsOutliersOut) {
  const auto feature_rmse = [](double outliers, const RobustLoss& loss) {
    const DrivenWorld w = drive({.outliers = outliers});
    const SolvedLog<2> solved =
        solve_by_local_maps(w.log, segment(w.log, {By::kPoses, 40}), {.loss = loss}, {});
    return deviation(solved.result.maps[0].values, w.truth).feature_rmse;
  };
  const double clean = feature_rmse(0.0, {});
  EXPECT_GT(feature_rmse(0.05, {}), 2.0 * clean);  // else there is nothing to show
  for (const char* name : {"cauchy:2", "geman-mcclure:3"})
    EXPECT_LT(feature_rmse(0.05, parse_robust_loss(name)), 2.0 * clean) << name;
  EXPECT_LT(feature_rmse(0.05, parse_robust_loss("huber:1")), feature_rmse(0.05, {}));
}

TEST(BuiltMaps, RefuseWhatCannotBe) {
  const RawLog<2> log = drive({.poses = 10}).log;
  const Segmentation segments = in_one(log);
  EXPECT_THROW(build_local_maps(log, segments, {.threads = 0}), InputError);
  EXPECT_THROW(build_local_maps(log, segments, {.max_iterations = 0}), InputError);
  EXPECT_THROW(build_local_maps(log, segments,
                                {.builder = Builder::kFilter, .loss = parse_robust_loss("huber")}),
               InputError);
  const RawLog<2> poses = raw_log(world<2>(World::kManhattan, 20).graph);
  EXPECT_THROW(build_local_maps(poses, in_one(poses), {.keep = Keep::kFeatures}),
               DegenerateFrameError);
  EXPECT_THROW(build_local_maps(poses, in_one(poses), {.frame = LocalFrame::kFeatures}),
               InputError);
}

}  // namespace
}  // namespace mapjoin
