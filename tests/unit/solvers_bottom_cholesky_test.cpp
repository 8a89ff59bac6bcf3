// The factor that changes at the bottom only: equal to a dense one after every addition.

#include <gtest/gtest.h>

#include <numeric>

#include "mapjoin/solvers/bottom_cholesky.h"
#include "mapjoin/solvers/dense_blas.h"
#include "tests/support/random_maps.h"

namespace mapjoin {
namespace {

using namespace test;  // NOLINT

/// I and i of a sum, densely.
Eigen::MatrixXd dense(const InformationSum& sum) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(sum.scalars(), sum.scalars());
  for (std::int64_t k = 0; k < sum.cliques(); ++k) {
    std::vector<int> rows;
    for (const std::int32_t v : sum.clique(k)) {
      for (int s = 0; s < sum.dims[static_cast<std::size_t>(v)]; ++s)
        rows.push_back(sum.offset[static_cast<std::size_t>(v)] + s);
    }
    const Eigen::MatrixXd full = Eigen::MatrixXd(sum.matrix(k)).selfadjointView<Eigen::Lower>();
    out(rows, rows) += full;
  }
  return out;
}

/// A clique over the given variables, in a random order.
void add_random(Dice& dice, InformationSum& sum, std::vector<std::int32_t> members) {
  std::shuffle(members.begin(), members.end(), dice.generator());
  int n = 0;
  for (const std::int32_t v : members) n += sum.dims[static_cast<std::size_t>(v)];
  sum.add_clique(members, dice.definite(n), dice.matrix(n, 1));
}

void expect_solved(const InformationSum& sum, const BottomCholesky& factor, Dice& dice) {
  const Eigen::MatrixXd I = dense(sum);
  EXPECT_LT((I * factor.solution() - sum.information_vector()).cwiseAbs().maxCoeff(), 1e-8);
  const Eigen::MatrixXd B = dice.matrix(I.rows(), 3);
  Eigen::MatrixXd X = B;
  factor.solve_in_place(X);
  EXPECT_LT((I * X - B).cwiseAbs().maxCoeff(), 1e-8);
}

TEST(BottomCholesky, FollowsEveryAdditionAtTheBottom) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Dice dice(seed);
    InformationSum sum;
    for (int v = 0; v < 40; ++v) sum.add_variable(1 + dice.below(3));
    for (std::int32_t v = 0; v + 3 < 40; ++v) add_random(dice, sum, {v, v + 1, v + 3});
    std::vector<std::int32_t> top(25), bottom(15);
    std::iota(top.begin(), top.end(), 0);
    std::iota(bottom.begin(), bottom.end(), 25);
    std::shuffle(top.begin(), top.end(), dice.generator());
    std::shuffle(bottom.begin(), bottom.end(), dice.generator());
    BottomCholesky factor;
    ASSERT_EQ(factor.refactor(sum, top, bottom), -1);
    expect_solved(sum, factor, dice);
    for (int round = 0; round < 8; ++round) {
      std::vector<std::int32_t> members{25 + dice.below(15), sum.size(), sum.size() + 1};
      sum.add_variable(2);
      sum.add_variable(3);
      add_random(dice, sum, members);
      ASSERT_EQ(factor.add(sum, sum.cliques() - 1), -1);
      EXPECT_TRUE(factor.in_bottom(sum.size() - 1));
      EXPECT_EQ(factor.height(sum.size() - 1), 3);
      expect_solved(sum, factor, dice);
    }
  }
}

TEST(BottomCholesky, MayBeAllTopOrAllBottom) {
  Dice dice(3);
  InformationSum sum;
  for (int v = 0; v < 20; ++v) sum.add_variable(2);
  for (std::int32_t v = 0; v + 2 < 20; ++v) add_random(dice, sum, {v, v + 2});
  std::vector<std::int32_t> all(20);
  std::iota(all.begin(), all.end(), 0);
  BottomCholesky top, bottom;
  ASSERT_EQ(top.refactor(sum, all, {}), -1);
  ASSERT_EQ(bottom.refactor(sum, {}, all), -1);
  expect_solved(sum, top, dice);
  expect_solved(sum, bottom, dice);
  EXPECT_EQ(bottom.nonzeros(), 40 * 41 / 2);
  EXPECT_LT(top.nonzeros(), bottom.nonzeros());
}

TEST(BottomCholesky, NamesWhatIsNotDetermined) {
  Dice dice(4);
  InformationSum sum;
  for (int v = 0; v < 6; ++v) sum.add_variable(2);
  for (std::int32_t v = 0; v + 1 < 5; ++v) add_random(dice, sum, {v, v + 1});
  const std::vector<std::int32_t> some{0, 1, 2}, rest{3, 4, 5};
  BottomCholesky factor;
  EXPECT_EQ(factor.refactor(sum, some, rest), 5);
  EXPECT_EQ(factor.refactor(sum, rest, some), 5);
  sum.add_clique(std::vector<std::int32_t>{5}, Eigen::Matrix2d::Identity(),
                 Eigen::Vector2d::Zero());
  ASSERT_EQ(factor.refactor(sum, some, rest), -1);
  sum.add_variable(2);
  sum.add_clique(std::vector<std::int32_t>{5, 6}, Eigen::Matrix4d::Zero(), Eigen::Vector4d::Zero());
  EXPECT_EQ(factor.add(sum, sum.cliques() - 1), 6);
}

TEST(DenseBlas, AgreesWithPlainProducts) {
  Dice dice(5);
  const Eigen::MatrixXd A = dice.matrix(7, 5), B = dice.matrix(5, 4), P = dice.definite(7);
  Eigen::MatrixXd C = dice.matrix(7, 4);
  const Eigen::MatrixXd expected = 0.5 * C + 2.0 * A * B;
  multiply(2.0, A, B, 0.5, C);
  EXPECT_LT(relative_distance(C, expected), 1e-13);
  Eigen::MatrixXd S = P;
  add_square(-0.1, A, S);
  const Eigen::MatrixXd lower = S.triangularView<Eigen::Lower>();
  const Eigen::MatrixXd square = P - 0.1 * A * A.transpose();
  EXPECT_LT(relative_distance(lower, square.triangularView<Eigen::Lower>()), 1e-13);
  Eigen::MatrixXd L = P;
  ASSERT_EQ(factor_lower(L), -1);
  L.triangularView<Eigen::StrictlyUpper>().setZero();
  EXPECT_LT(relative_distance(L * L.transpose(), P), 1e-13);
  Eigen::MatrixXd left = dice.matrix(7, 3), right = dice.matrix(3, 7);
  const Eigen::MatrixXd b = left, c = right;
  solve_lower_left(L, left);
  solve_lower_right(L, right);
  EXPECT_LT(relative_distance(L * left, b), 1e-12);
  Eigen::MatrixXd transposed = b;
  solve_transposed_left(L, transposed);
  EXPECT_LT(relative_distance(L.transpose() * transposed, b), 1e-12);
  EXPECT_LT(relative_distance(right * L.transpose(), c), 1e-12);
  Eigen::MatrixXd bad = -P;
  EXPECT_EQ(factor_lower(bad), 0);
}

}  // namespace
}  // namespace mapjoin
