// The filters on the data sets: Table 2 of Linear SLAM (SLSJF, I-SLSJF), Table 5 (D-SLAM map
// joining, I-DMJ), and SLSJF beside map joining by a Kalman filter.
#include <gtest/gtest.h>

#include <cmath>

#include "mapjoin/evaluation/consistency.h"
#include "mapjoin/evaluation/evaluate.h"
#include "mapjoin/filtering/dslam.h"
#include "mapjoin/filtering/ekf_join.h"
#include "mapjoin/filtering/slsjf.h"
#include "mapjoin/joining/features_only.h"
#include "mapjoin/solvers/covariance.h"
#include "tests/support/beacons.h"
#include "tests/support/data_sets.h"

namespace mapjoin::test {
namespace {

/// A row of Table 2: chi2 of SLSJF as printed, and of the optimum (I-SLSJF).
struct FilterRow {
  std::string maps;
  double slsjf, optimum;

  friend std::ostream& operator<<(std::ostream& out, const FilterRow& row) {
    return out << row.maps;
  }
};

class Table2 : public testing::TestWithParam<FilterRow> {};

TEST_P(Table2, OfSlsjfIsReachedToTheDigit) {
  const FilterRow& row = GetParam();
  const DataSet set{"local_maps", row.maps};
  const auto problem = load(set);
  if (!problem) GTEST_SKIP() << missing(set);
  const auto& maps = std::get<Problem<2>>(*problem).local_maps;
  const FilterResult<2> filtered = slsjf(std::span<const LocalMap<2>>(maps));
  EXPECT_NEAR(filtered.report.chi2, row.slsjf, 0.5) << "printed without decimals";
  EXPECT_NEAR(chi2(filtered.map.values, std::get<Problem<2>>(*problem).graph), filtered.report.chi2,
              1e-6 * row.slsjf);
  const FilterResult<2> smoothed =
      smooth(std::span<const LocalMap<2>>(maps), filtered.map.values, filtered.map.anchor);
  EXPECT_TRUE(smoothed.report.minimum);
  EXPECT_NEAR(smoothed.report.chi2, row.optimum, 1e-6 * row.optimum);
  RecordProperty("slsjf_chi2", std::to_string(filtered.report.chi2));
}

INSTANTIATE_TEST_SUITE_P(, Table2,
                         testing::Values(FilterRow{"victoria_park_200", 3644, 3643.4349},
                                         FilterRow{"dlr_200", 14603, 11163.6435},
                                         FilterRow{"victoria_park_6898", 9013, 9012.7196},
                                         FilterRow{"dlr_3298", 28316, 27688.5556}));

/// A row of Table 5: RMSE of D-SLAM map joining's features to the optimum, I-DMJ, as printed.
struct FeatureRow {
  std::string maps;
  double rmse;

  friend std::ostream& operator<<(std::ostream& out, const FeatureRow& row) {
    return out << row.maps;
  }
};

class Table5OfDslam : public testing::TestWithParam<FeatureRow> {};

TEST_P(Table5OfDslam, IsReachedAndItsIteratedFormIsTheOptimum) {
  const FeatureRow& row = GetParam();
  const DataSet set{"local_maps", row.maps};
  const auto problem = load(set);
  if (!problem) GTEST_SKIP() << missing(set);
  const std::span<const LocalMap<2>> maps(std::get<Problem<2>>(*problem).local_maps);
  const auto features = features_only(maps);
  const JoinResult<2> best = join_all(std::span<const Map<2>>(features.maps), {});
  const FilterResult<2> iterated = idslam(maps);
  EXPECT_TRUE(iterated.report.minimum);
  EXPECT_NEAR(iterated.report.chi2, best.report.chi2, 1e-6 * best.report.chi2);
  const FilterResult<2> filtered = dslam(maps);
  const double rmse = deviation(filtered.map.values, best.maps.at(0).values).aligned_feature_rmse;
  EXPECT_LE(rmse, 1.1 * row.rmse);
  RecordProperty("dslam_rmse", std::to_string(rmse));
  const FilterResult<2> by_gradients =
      dslam(maps, {.recovery = FilterRecovery::kConjugateGradients});
  EXPECT_LT(deviation(by_gradients.map.values, filtered.map.values).aligned_feature_rmse, 1e-6);
}

INSTANTIATE_TEST_SUITE_P(, Table5OfDslam,
                         testing::Values(FeatureRow{"victoria_park_200", 0.268626},
                                         FeatureRow{"dlr_200", 0.536729}));

/// SLSJF's simulation: same features, nearly the same estimates.
TEST(SlsjfAndEkf, AgreeOnTheFeaturesOfVictoriaParkWithinATenthOfASigma) {
  const DataSet set{"local_maps", "victoria_park_200"};
  const auto problem = load(set);
  if (!problem) GTEST_SKIP() << missing(set);
  const auto& maps = std::get<Problem<2>>(*problem).local_maps;
  Slsjf<2> information;
  EkfJoin<2> covariance;
  for (const LocalMap<2>& map : maps) {
    information.fuse(map);
    covariance.fuse(map);
  }
  const Values<2> a = information.values(), b = covariance.values();
  double worst = 0.0;
  for (const Key& key : b.variables().column(b.variables().find_column(Tag("point"))).keys) {
    const Eigen::MatrixXd P = covariance.covariance(std::span(&key, 1));
    const Vec<2> d = a.point(key) - b.point(key);
    for (int s = 0; s < 2; ++s) worst = std::max(worst, std::abs(d(s)) / std::sqrt(P(s, s)));
  }
  RecordProperty("largest_difference_in_sigmas", std::to_string(worst));
  EXPECT_LT(worst, 0.1);
}

/// Share of the features' coordinates that lie within two standard deviations of the truth.
double within_two_sigma(const Map<2>& map, const Values<2>& truth) {
  const CovarianceBlocks blocks = Covariance<2>(map).blocks();
  int count = 0, inside = 0;
  for (std::size_t k = 0; k < blocks.size(); ++k) {
    const Key& key = map.variables().key(blocks.variables[k]);
    if (key.type != Tag("point")) continue;
    const Vec<2> error = map.values.point(key) - truth.point(key);
    for (int s = 0; s < 2; ++s) {
      ++count;
      inside += std::abs(error(s)) < 2.0 * std::sqrt(blocks.block(k)(s, s)) ? 1 : 0;
    }
  }
  return static_cast<double>(inside) / count;
}

/// SLSJF V-G: linearising anew improves the consistency significantly.
TEST(SlsjfSimulation, IsOverconfidentUnlessItIsLinearisedAnew) {
  const DataSet set{"local_maps", "simu_8240_50"};
  const auto problem = load(set);
  const auto truth = true_beacons("simu_8240");
  if (!problem || !truth) GTEST_SKIP() << missing(set);
  const std::span<const LocalMap<2>> maps(std::get<Problem<2>>(*problem).local_maps);
  const double once = within_two_sigma(slsjf(maps).map, *truth);
  const double often = within_two_sigma(slsjf(maps, {.relinearise_every = 5}).map, *truth);
  const double smoothed = within_two_sigma(islsjf(maps).map, *truth);
  EXPECT_GE(often, 0.93);
  EXPECT_GE(smoothed, 0.93);
  EXPECT_LT(once, 0.93) << "better than known: say so in docs/filters.md";
  RecordProperty("share_once", std::to_string(once));
  RecordProperty("share_relinearised", std::to_string(often));
}

}  // namespace
}  // namespace mapjoin::test
