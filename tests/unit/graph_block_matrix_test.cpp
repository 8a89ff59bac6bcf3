#include "mapjoin/graph/block_matrix.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <utility>
#include <vector>

#include "mapjoin/graph/error.h"
#include "tests/support/random_maps.h"

namespace mapjoin {
namespace {

using Eigen::MatrixXd;
using test::Dice;

struct Pattern {
  std::vector<int> offsets{0};
  std::vector<std::pair<int, int>> pairs;  // in either orientation, with repetitions
  std::set<std::pair<int, int>> lower;     // what must be there

  Pattern(Dice& dice, int n, int couples) {
    for (int k = 0; k < n; ++k) {
      offsets.push_back(offsets.back() + 1 + dice.below(6));
      lower.emplace(k, k);
    }
    for (int k = 0; k < couples && n > 0; ++k) {
      const int i = dice.below(n), j = dice.below(n);
      for (int times = 0; times <= dice.below(2); ++times) pairs.emplace_back(i, j);
      lower.emplace(std::max(i, j), std::min(i, j));
    }
  }
  int dim(int i) const {
    return offsets[static_cast<std::size_t>(i) + 1] - offsets[static_cast<std::size_t>(i)];
  }
  int at(int i) const { return offsets[static_cast<std::size_t>(i)]; }
  /// A symmetric matrix with random blocks in the pattern.
  MatrixXd random_dense(Dice& dice) const {
    MatrixXd out = MatrixXd::Zero(offsets.back(), offsets.back());
    for (const auto& [i, j] : lower) {
      const MatrixXd block = dice.matrix(dim(i), dim(j));
      out.block(at(i), at(j), dim(i), dim(j)) += block;
      out.block(at(j), at(i), dim(j), dim(i)) += block.transpose();
    }
    return out;
  }
};

TEST(SymmetricBlockMatrix, HasTheBlocksAskedForInOrderAndNoOthers) {
  Dice dice(1);
  for (int round = 0; round < 60; ++round) {
    const Pattern pattern(dice, dice.below(25), dice.below(60));
    const SymmetricBlockMatrix M(pattern.offsets, pattern.pairs);
    ASSERT_EQ(M.size() + 1, static_cast<int>(pattern.offsets.size()));
    EXPECT_EQ(M.scalars(), pattern.offsets.back());
    std::set<std::pair<int, int>> found;
    for (int j = 0; j < M.size(); ++j) {
      EXPECT_EQ(M.row(M.begin(j)), j) << "the diagonal block comes first";
      for (auto s = M.begin(j); s < M.end(j); ++s) {
        if (s > M.begin(j)) {
          EXPECT_GT(M.row(s), M.row(s - 1));
        }
        EXPECT_TRUE(found.emplace(M.row(s), j).second);
        EXPECT_EQ(M.find(M.row(s), j), s);
      }
    }
    EXPECT_EQ(found, pattern.lower);
    EXPECT_TRUE(M.dense().isZero(0.0));
  }
}

TEST(SymmetricBlockMatrix, IsTheDenseMatrixItWasMadeFrom) {
  Dice dice(2);
  for (int round = 0; round < 60; ++round) {
    const Pattern pattern(dice, 1 + dice.below(20), dice.below(40));
    MatrixXd dense = pattern.random_dense(dice);
    const auto M = SymmetricBlockMatrix::from_dense(pattern.offsets, dense);
    EXPECT_EQ(M.dense(), dense);
    EXPECT_EQ(MatrixXd(M.lower()), MatrixXd(dense.triangularView<Eigen::Lower>()));
    EXPECT_EQ(M.blocks(), static_cast<std::int64_t>(pattern.lower.size()));
    const MatrixXd x = dice.matrix(dense.cols(), 3);
    EXPECT_LT(test::distance(M.times(x), dense * x), 1e-11);
    EXPECT_LT(test::distance(M * Eigen::VectorXd(x.col(0)), dense * x.col(0)), 1e-11);
    // Only the lower triangle is looked at.
    dense.triangularView<Eigen::StrictlyUpper>().setConstant(99.0);
    EXPECT_EQ(SymmetricBlockMatrix::from_dense(pattern.offsets, dense), M);
  }
}

TEST(SymmetricBlockMatrix, AddsBlocksFromEitherSide) {
  Dice dice(3);
  for (int round = 0; round < 40; ++round) {
    const Pattern pattern(dice, 2 + dice.below(15), 5 + dice.below(30));
    SymmetricBlockMatrix M(pattern.offsets, pattern.pairs);
    MatrixXd dense = MatrixXd::Zero(M.scalars(), M.scalars());
    for (const auto& [i, j] : pattern.pairs) {
      MatrixXd block = dice.matrix(pattern.dim(i), pattern.dim(j));
      if (i == j) block = (block + block.transpose()).eval();
      M.add(i, j, block);
      dense.block(pattern.at(i), pattern.at(j), block.rows(), block.cols()) += block;
      if (i != j)
        dense.block(pattern.at(j), pattern.at(i), block.cols(), block.rows()) += block.transpose();
    }
    EXPECT_LT(test::distance(M.dense(), dense), 1e-13);
  }
}

TEST(SymmetricBlockMatrix, RefusesABlockOutsideItsPattern) {
  SymmetricBlockMatrix M({0, 2, 4, 5}, std::vector<std::pair<int, int>>{{0, 2}});
  EXPECT_NO_THROW(M.add(2, 0, MatrixXd::Ones(1, 2)));
  EXPECT_NO_THROW(M.add(0, 2, MatrixXd::Ones(2, 1)));
  EXPECT_THROW(M.add(1, 0, MatrixXd::Ones(2, 2)), Error);
}

TEST(SymmetricBlockMatrix, CanBeEmpty) {
  const SymmetricBlockMatrix none;
  EXPECT_EQ(none.size(), 0);
  EXPECT_EQ(none.scalars(), 0);
  EXPECT_EQ(none.dense().size(), 0);
  EXPECT_EQ(none, SymmetricBlockMatrix({0}, {}));
}

}  // namespace
}  // namespace mapjoin
