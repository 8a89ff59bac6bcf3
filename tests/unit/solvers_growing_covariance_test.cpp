// A covariance matrix whose variables come and go.
#include "mapjoin/solvers/growing_covariance.h"

#include <gtest/gtest.h>

#include <numeric>
#include <utility>
#include <vector>

#include "tests/support/random_maps.h"

namespace mapjoin {
namespace {

using namespace test;  // NOLINT

/// Against the same matrix kept whole, through any coming and going.
TEST(GrowingCovariance, IsADenseMatrixWhoseVariablesComeAndGo) {
  Dice dice(3);
  GrowingCovariance P;
  Eigen::MatrixXd whole = Eigen::MatrixXd::Zero(400, 400);
  std::vector<std::pair<int, int>> there;  // (row, dim)
  const auto random = [&](int columns) {   // as gains and covariances are: zero for what left
    Eigen::MatrixXd out = Eigen::MatrixXd::Zero(P.size(), columns);
    for (const auto& [first, size] : there)
      out.middleRows(first, size) = dice.matrix(size, columns);
    return out;
  };
  for (int k = 0; k < 200; ++k) {
    if (k % 3 == 2) {
      const std::size_t which = static_cast<std::size_t>(k * 7) % there.size();
      const auto [row, dim] = there[which];
      P.remove(row, dim);
      whole.middleRows(row, dim).setZero();
      whole.middleCols(row, dim).setZero();
      there.erase(there.begin() + static_cast<std::ptrdiff_t>(which));
      continue;
    }
    const int dim = k % 2 == 0 ? 3 : 2;
    const int row = P.add(dim);
    there.emplace_back(row, dim);
    ASSERT_LE(P.size(), 400);
    EXPECT_EQ(P.columns(row, dim).norm(), 0.0) << "nothing is left of who was there before";
    Eigen::MatrixXd columns = random(dim);
    columns.middleRows(row, dim) = (columns.middleRows(row, dim) * 0.5).eval();
    columns.middleRows(row, dim) += columns.middleRows(row, dim).transpose().eval();
    P.set_columns(row, columns);
    whole.block(0, row, P.size(), dim) = columns;
    whole.block(row, 0, dim, P.size()) = columns.transpose();
    const Eigen::MatrixXd X = random(4);
    P.subtract_square(X);
    whole.topLeftCorner(P.size(), P.size()) -= X * X.transpose();
    for (const auto& [first, size] : there)
      EXPECT_LT(relative_distance(P.columns(first, size), whole.block(0, first, P.size(), size)),
                1e-12);
  }
  std::vector<int> rows(static_cast<std::size_t>(P.size()));
  std::iota(rows.begin(), rows.end(), 0);
  EXPECT_LT(relative_distance(P.of(rows), whole.topLeftCorner(P.size(), P.size())), 1e-12);
}

}  // namespace
}  // namespace mapjoin
