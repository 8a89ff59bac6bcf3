// SLSJF: the published filter written densely, exact sparsity, orders that do not matter,
// covariances, and its smoothed form.

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>

#include "mapjoin/filtering/slsjf.h"
#include "mapjoin/frames/gauge.h"
#include "mapjoin/joining/join.h"
#include "mapjoin/joining/join_all.h"
#include "mapjoin/solvers/covariance.h"
#include "tests/support/dense.h"
#include "tests/support/local_map_chain.h"
#include "tests/support/user_types.h"

namespace mapjoin {
namespace {

using namespace test;  // NOLINT

template <class T>
class SlsjfFilter : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(SlsjfFilter, Dimensions);

template <int D>
Slsjf<D> fused(const std::vector<LocalMap<D>>& maps, const FilterOptions& options = {}) {
  Slsjf<D> filter(options);
  for (const LocalMap<D>& map : maps) filter.fuse(map);
  return filter;
}

TYPED_TEST(SlsjfFilter, OfOneLocalMapIsThatMap) {
  constexpr int D = TypeParam::value;
  const auto chain = random_chain<D>(1);
  const Slsjf<D> filter = fused<D>({chain.maps[0]});
  const Map<D> local = to_map(chain.maps[0]);
  EXPECT_EQ(filter.map().anchor, local.anchor);
  EXPECT_LT(distance(filter.values(), local.values), 1e-12);
  EXPECT_LT(relative_distance(filter.map().information.dense(), local.information.dense()), 1e-9);
}

TYPED_TEST(SlsjfFilter, FindsTheTruthInExactLocalMaps) {
  constexpr int D = TypeParam::value;
  const auto chain = random_chain<D>(2, {.noise = 0.0});
  EXPECT_LT(common_distance(fused<D>(chain.maps).values(), chain.truth), 1e-8);
}

/// Equations (7) and (8) of the paper, densely: x, y, heading and coordinates, in the order of
/// arrival, with derivatives by differences.
class TextbookFilter {
 public:
  void fuse(const LocalMap<2>& map) {
    const Key start = map.anchor.keys[0];
    std::vector<Key> keys = map.keys;
    Eigen::VectorXd z(map.information.scalars());
    Eigen::MatrixXd I_local = map.information.dense();
    const double* value = map.values.data();
    Eigen::Index row = 0;
    for (std::size_t k = 0; k < keys.size(); ++k) {
      if (keys[k].type == Tag("pose")) {
        const Rigid2& pose = *reinterpret_cast<const Rigid2*>(value);
        z.segment<3>(row) << pose.t, heading(pose);
        // The file's information is of (x, y, heading); the library's in the frame of the pose.
        Eigen::MatrixXd B = Eigen::MatrixXd::Identity(z.size(), z.size());
        B.block<2, 2>(row, row) = pose.R.transpose();
        I_local = (B.transpose() * I_local * B).eval();
        row += 3;
      } else {
        z.segment<2>(row) << value[0], value[1];
        row += 2;
      }
      value += map.kinds[k]->value_size;
    }
    const Eigen::Vector3d at = pose_of(start);
    for (const bool poses : {false, true}) {
      row = 0;
      for (const Key& key : keys) {
        const bool pose = key.type == Tag("pose");
        if (pose == poses && offset_.count(key) == 0)
          add(key, pose, compose(at, z.segment(row, pose ? 3 : 2)));
        row += pose ? 3 : 2;
      }
    }
    const auto h = [&](const Eigen::VectorXd& x) {
      const Eigen::Vector3d s = start_is_origin(start)
                                    ? Eigen::Vector3d(0, 0, 0)
                                    : Eigen::Vector3d(x.segment<3>(offset_.at(start)));
      Eigen::VectorXd out(z.size());
      Eigen::Index r = 0;
      for (const Key& key : keys) {
        const double dx = x(offset_.at(key)) - s(0), dy = x(offset_.at(key) + 1) - s(1);
        out(r) = dx * std::cos(s(2)) + dy * std::sin(s(2));
        out(r + 1) = dy * std::cos(s(2)) - dx * std::sin(s(2));
        if (key.type == Tag("pose")) out(r + 2) = x(offset_.at(key) + 2) - s(2);
        r += key.type == Tag("pose") ? 3 : 2;
      }
      return out;
    };
    Eigen::MatrixXd H(z.size(), x_.size());
    for (Eigen::Index c = 0; c < x_.size(); ++c) {
      const double step = 1e-6;
      Eigen::VectorXd up = x_, down = x_;
      up(c) += step;
      down(c) -= step;
      H.col(c) = (h(up) - h(down)) / (2 * step);
    }
    Eigen::VectorXd r = z - h(x_);
    row = 0;
    for (const Key& key : keys) {
      if (key.type == Tag("pose")) r(row + 2) = std::remainder(r(row + 2), 2 * M_PI);
      row += key.type == Tag("pose") ? 3 : 2;
    }
    I_ += H.transpose() * I_local * H;  // (8)
    i_ += H.transpose() * I_local * (r + H * x_);
    x_ = test::dense_solve(I_, i_);  // (13)
  }
  const Eigen::VectorXd& x() const { return x_; }
  int offset(const Key& key) const { return offset_.at(key); }
  const std::map<Key, int>& variables() const { return offset_; }

 private:
  bool start_is_origin(const Key& key) const { return offset_.count(key) == 0; }
  Eigen::Vector3d pose_of(const Key& key) const {
    return start_is_origin(key) ? Eigen::Vector3d(0, 0, 0)
                                : Eigen::Vector3d(x_.segment<3>(offset_.at(key)));
  }
  static Eigen::VectorXd compose(const Eigen::Vector3d& s, const Eigen::VectorXd& z) {
    Eigen::VectorXd out = z;
    out.head<2>() = s.head<2>() + Eigen::Rotation2Dd(s(2)) * Eigen::Vector2d(z.head<2>());
    if (z.size() == 3) out(2) = s(2) + z(2);
    return out;
  }
  void add(const Key& key, bool, const Eigen::VectorXd& value) {
    const Eigen::Index n = x_.size();
    offset_[key] = static_cast<int>(n);
    x_.conservativeResize(n + value.size());
    x_.tail(value.size()) = value;
    I_.conservativeResizeLike(Eigen::MatrixXd::Zero(x_.size(), x_.size()));
    i_.conservativeResizeLike(Eigen::VectorXd::Zero(x_.size()));
  }

  std::map<Key, int> offset_;
  Eigen::VectorXd x_, i_;
  Eigen::MatrixXd I_;
};

TEST(SlsjfFilter2, IsTheFilterOfThePaper) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const auto chain = random_chain<2>(seed, {.noise = 0.1, .turn = 1.5});
    Slsjf<2> filter;
    TextbookFilter textbook;
    for (const LocalMap<2>& map : chain.maps) {
      filter.fuse(map);
      textbook.fuse(map);
      const Values<2> values = filter.values();
      for (const auto& [key, offset] : textbook.variables()) {
        if (key.type == Tag("pose")) {
          const Eigen::Vector3d x = textbook.x().segment<3>(offset);
          EXPECT_LT((values.pose(key).t - x.head<2>()).norm(), 1e-6);
          EXPECT_LT(std::abs(std::remainder(heading(values.pose(key)) - x(2), 2 * M_PI)), 1e-6);
        } else {
          EXPECT_LT((values.point(key) - textbook.x().segment<2>(offset)).norm(), 1e-6);
        }
      }
    }
  }
}

TYPED_TEST(SlsjfFilter, LinksTwoVariablesExactlyWhereALocalMapHoldsBoth) {
  constexpr int D = TypeParam::value;
  const auto chain = random_chain<D>(3, {.maps = 15, .features = 60, .range = 4.0});
  const Slsjf<D> filter = fused<D>(chain.maps);
  std::set<std::pair<Key, Key>> linked;
  for (const LocalMap<D>& map : chain.maps) {
    std::vector<Key> keys = map.keys;
    keys.push_back(map.anchor.keys[0]);
    for (const Key& a : keys) {
      for (const Key& b : keys) linked.emplace(a, b);
    }
  }
  const auto& state = filter.filter().state();
  const Eigen::SparseMatrix<double> lower = filter.filter().information();
  const Eigen::MatrixXd I = Eigen::MatrixXd(lower).template selfadjointView<Eigen::Lower>();
  std::int64_t count = 0;
  for (int i = 0; i < state.size(); ++i) {
    for (int j = 0; j < state.size(); ++j) {
      const auto block = I.block(state.offset(i), state.offset(j), state.dim(i), state.dim(j));
      const bool first = state.key(i) == pose_key(0) || state.key(j) == pose_key(0);
      if (first) continue;  // the frame
      const bool expected = linked.count({state.key(i), state.key(j)}) > 0;
      EXPECT_EQ(!block.isZero(0.0), expected) << to_string(state.key(i)) << to_string(state.key(j));
      if (expected) count += block.size();
    }
  }
  EXPECT_EQ(filter.filter().nonzeros(), count);
  EXPECT_LT(count, std::int64_t{I.rows()} * I.cols());
  EXPECT_EQ(filter.filter().free_scalars(), I.rows() - kGauge<D>);
}

TYPED_TEST(SlsjfFilter, FindsTheSameWhateverTheOrderAndHowMuchIsFactoredAnew) {
  constexpr int D = TypeParam::value;
  const auto chain = random_chain<D>(4, {.maps = 30, .features = 120, .range = 4.0});
  const Slsjf<D> usual = fused<D>(chain.maps);
  std::vector<FilterOptions> choices(6);
  choices[0].incremental = false;
  choices[1].ordering = FilterOrdering::kMinimumDegree;
  choices[2].ordering = FilterOrdering::kMinimumDegree;
  choices[2].reorder_every = 1;
  choices[3].n0 = 30;
  choices[4].n0 = 2000;
  choices[5].n0 = 120;
  choices[5].d0 = 3.0;
  for (const FilterOptions& options : choices) {
    Slsjf<D> other(options);
    int whole = 0, reordered = 0;
    for (const LocalMap<D>& map : chain.maps) {
      const Fusion fusion = other.fuse(map);
      whole += fusion.factored_whole ? 1 : 0;
      reordered += fusion.reordered ? 1 : 0;
    }
    EXPECT_LT(distance(other.values(), usual.values()), 1e-8);
    const bool always = !options.incremental || options.ordering == FilterOrdering::kMinimumDegree;
    if (always || options.n0 == 2000) {
      EXPECT_EQ(whole, always ? 30 : 1);
    }
    if (options.n0 == 30 || options.n0 == 2000) {
      EXPECT_EQ(reordered == 1, options.n0 == 2000);
    }
  }
}

TYPED_TEST(SlsjfFilter, KnowsItsCovariance) {
  constexpr int D = TypeParam::value;
  const auto chain = random_chain<D>(5, {.noise = 0.05, .turn = 1.0});
  Slsjf<D> filter = fused<D>(chain.maps, {.n0 = 60});
  const std::vector<Key> keys{pose_key(7), point_key(3), pose_key(0), point_key(11)};
  const Eigen::MatrixXd P = filter.covariance(keys);
  EXPECT_LT(relative_distance(P, Covariance<D>(filter.map()).of(keys)), 1e-8);
  // And as the inverse of the whole matrix, in the order of arrival.
  const auto& state = filter.filter().state();
  const Eigen::SparseMatrix<double> lower = filter.filter().information();
  const Eigen::MatrixXd I = Eigen::MatrixXd(lower).template selfadjointView<Eigen::Lower>();
  const int i = *state.find(point_key(3));
  const Eigen::MatrixXd inverse = test::dense_inverse(I);
  EXPECT_LT(relative_distance(P.block(kGauge<D>, kGauge<D>, D, D),
                              inverse.block(state.offset(i), state.offset(i), D, D)),
            1e-8);
  EXPECT_TRUE(P.middleRows(kGauge<D> + D, kGauge<D>).isZero(0.0)) << "the frame is certain";
}

TYPED_TEST(SlsjfFilter, SmoothedIsTheOptimumOfJoining) {
  constexpr int D = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const auto chain = random_chain<D>(seed, {.maps = 20, .features = 60, .noise = 0.05});
    const std::span<const LocalMap<D>> maps(chain.maps);
    const FilterResult<D> smoothed = islsjf(maps);
    const JoinResult<D> best = join_all(maps);
    EXPECT_TRUE(smoothed.report.minimum);
    EXPECT_NEAR(smoothed.report.chi2, best.report.chi2, 1e-6 * best.report.chi2);
    EXPECT_LT(distance(smoothed.map.values, best.maps.at(0).values), 1e-3);
    EXPECT_EQ(smoothed.map.anchor, pose_anchor<D>(pose_key(0)));
    EXPECT_LE(smoothed.report.chi2, slsjf(maps).report.chi2);
    EXPECT_EQ(smoothed.report.fusions.size(), 20U);
  }
}

TYPED_TEST(SlsjfFilter, LinearisedAnewAtEveryFusionApproachesTheOptimum) {
  constexpr int D = TypeParam::value;
  const auto chain = random_chain<D>(6, {.maps = 20, .features = 60, .noise = 0.1});
  const std::span<const LocalMap<D>> maps(chain.maps);
  const double best = islsjf(maps).report.chi2;
  const double once = slsjf(maps).report.chi2 - best;
  const double often = slsjf(maps, {.relinearise_every = 1}).report.chi2 - best;
  EXPECT_GT(once, 0.0);
  EXPECT_LT(often, 0.2 * once);
  EXPECT_GT(often, -1e-7 * best);
}

TYPED_TEST(SlsjfFilter, PlacesAMapOfUnknownStartByItsFeatures) {
  constexpr int D = TypeParam::value;
  auto chain = random_chain<D>(7, {.maps = 6, .noise = 0.0});
  // Another session: poses of its own, the same features.
  LocalMap<D> stranger = chain.maps[2];
  stranger.anchor.keys[0].session = 1;
  for (Key& key : stranger.keys) {
    if (key.type == Tag("pose")) key.session = 1;
  }
  Slsjf<D> filter = fused<D>(chain.maps);
  filter.fuse(stranger);
  EXPECT_LT(distance(filter.values().pose(pose_key(2, 1)).t, chain.truth.pose(pose_key(2)).t),
            1e-8);
}

TYPED_TEST(SlsjfFilter, RefusesWhatItCannotPlaceAndGoesOn) {
  constexpr int D = TypeParam::value;
  auto chain = random_chain<D>(8, {.maps = 4, .noise = 0.0});
  LocalMap<D> stranger = chain.maps[2];
  stranger.anchor.keys[0].session = 1;
  for (Key& key : stranger.keys) key.session = 1;
  Slsjf<D> filter = fused<D>({chain.maps[0], chain.maps[1]});
  const std::string message = complaint_of<DisconnectedError>([&] { filter.fuse(stranger); });
  EXPECT_NE(message.find("1/pose:2"), std::string::npos) << message;
  EXPECT_NE(message.find("needs the pose it starts from"), std::string::npos) << message;
  EXPECT_EQ(filter.fused(), 2);
  filter.fuse(chain.maps[2]);
  filter.fuse(chain.maps[3]);
  EXPECT_LT(common_distance(filter.values(), chain.truth), 1e-8);
}

TYPED_TEST(SlsjfFilter, NamesAVariableThatIsNotDetermined) {
  constexpr int D = TypeParam::value;
  auto chain = random_chain<D>(9, {.maps = 3});
  LocalMap<D>& map = chain.maps[1];
  int row = 0;
  for (std::size_t k = 0; map.keys[k].type != Tag("point"); ++k) row += map.kinds[k]->dim;
  Eigen::MatrixXd I = map.information.dense();
  I.row(row).setZero();
  I.col(row).setZero();
  map.keys[1] = point_key(1000);
  map.information = SymmetricBlockMatrix::from_dense(map.information.offsets(), I);
  const std::string message = complaint_of<SingularError>([&] { fused<D>(chain.maps); });
  EXPECT_NE(message.find("point:1000"), std::string::npos) << message;
}

TYPED_TEST(SlsjfFilter, TakesTypesOfAUsersOwn) {
  constexpr int D = TypeParam::value;
  auto chain = random_chain<D>(10, {.maps = 6, .noise = 0.02});
  Dice dice(3);
  for (LocalMap<D>& map : chain.maps) {
    map.template add_term<BiasType<D>>(own::bias_key(1), Vec<1>(0.5 + 0.01 * dice.normal()));
    std::vector<int> offsets = map.information.offsets();
    offsets.push_back(offsets.back() + 1);
    map.information =
        SymmetricBlockMatrix::from_dense(offsets, dice.definite(offsets.back(), 100.0));
  }
  const std::span<const LocalMap<D>> maps(chain.maps);
  const Values<D> values = slsjf(maps).map.values;
  const Values<D> best = join_all(maps).maps.at(0).values;
  EXPECT_NEAR(values.template at<BiasType<D>>(own::bias_key(1))(0),
              best.template at<BiasType<D>>(own::bias_key(1))(0), 0.02);
}

TEST(SlsjfFilter2, RefusesImpossibleOptions) {
  EXPECT_THROW(Slsjf<2>({.n0 = -1}), InputError);
  EXPECT_THROW(Slsjf<2>({.reorder_every = 0}), InputError);
  EXPECT_THROW(slsjf(std::span<const LocalMap<2>>()), InputError);
  const auto chain = random_chain<2>(1);
  Slsjf<2> filter = fused<2>({chain.maps[0]});
  EXPECT_THROW(filter.relinearise(), InputError);
  EXPECT_THROW(filter.covariance(std::vector<Key>{pose_key(77)}), InputError);
}

TEST(SlsjfFilter2, CanBeStopped) {
  const auto chain = random_chain<2>(1);
  EXPECT_THROW(slsjf(std::span<const LocalMap<2>>(chain.maps), {},
                     [](const Progress& p) { return p.fraction < 0.5; }),
               CancelledError);
}

}  // namespace
}  // namespace mapjoin
