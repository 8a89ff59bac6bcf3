#include "mapjoin/graph/symmetric.h"

#include <gtest/gtest.h>

#include "tests/support/random_maps.h"

namespace mapjoin {
namespace {

using test::Dice;

TEST(Spectrum, PutsTheMatrixTogetherAgain) {
  Dice dice(3);
  for (const int n : {1, 2, 3, 6, 15}) {
    SCOPED_TRACE(n);
    const Eigen::MatrixXd A = dice.definite(n) - 2.0 * dice.definite(n);
    const Spectrum found = spectrum(A);
    const Eigen::MatrixXd& V = found.vectors;
    EXPECT_LT((V * found.values.asDiagonal() * V.transpose() - A).norm(), 1e-13 * A.norm());
    EXPECT_LT((V.transpose() * V - Eigen::MatrixXd::Identity(n, n)).norm(), 1e-13);
    for (int k = 1; k < n; ++k) EXPECT_LE(found.values(k - 1), found.values(k));
    EXPECT_LT((eigenvalues(A) - found.values).norm(), 1e-13 * A.norm());
  }
}

TEST(Spectrum, ReadsTheLowerTriangle) {
  Eigen::Matrix2d A;
  A << 2.0, 99.0, 1.0, 2.0;
  EXPECT_LT((eigenvalues(A) - Eigen::Vector2d(1.0, 3.0)).norm(), 1e-15);
}

}  // namespace
}  // namespace mapjoin
