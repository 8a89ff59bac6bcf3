#include "mapjoin/io/information_policy.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "tests/support/io.h"

namespace mapjoin {
namespace {

using test::expect_input_error;

constexpr int kParts[] = {2, 1};

Eigen::MatrixXd indefinite() {
  Eigen::MatrixXd I(3, 3);
  I << 1, 2, 0, 2, 1, 0, 0, 0, 5;
  return I;
}

TEST(InformationPolicy, SemidefiniteIsLegal) {
  EXPECT_TRUE(is_positive_semidefinite(Eigen::MatrixXd::Zero(3, 3)));
  EXPECT_TRUE(is_positive_semidefinite(Eigen::MatrixXd::Ones(3, 3)));
  EXPECT_TRUE(is_positive_semidefinite(Eigen::MatrixXd::Ones(7, 7)));
  EXPECT_TRUE(is_positive_semidefinite(Eigen::MatrixXd::Identity(6, 6)));
}

TEST(InformationPolicy, NegativeEigenvaluesAreFound) {
  EXPECT_FALSE(is_positive_semidefinite(indefinite()));
  EXPECT_FALSE(is_positive_semidefinite(-Eigen::MatrixXd::Identity(2, 2)));
  EXPECT_NEAR(smallest_eigenvalue(indefinite()), -1.0, 1e-12);
}

TEST(InformationPolicy, ClampingRaisesNegativeEigenvaluesOnly) {
  Eigen::MatrixXd I = indefinite();
  clamp_information(I);
  EXPECT_TRUE(is_positive_semidefinite(I));
  EXPECT_NEAR(I(0, 0), 1.5, 1e-8);  // 3 (1 1)(1 1)^T / 2
  EXPECT_NEAR(I(0, 1), 1.5, 1e-8);
  EXPECT_NEAR(I(2, 2), 5.0, 1e-12);
  EXPECT_GT(smallest_eigenvalue(I), 1e-9);
}

TEST(InformationPolicy, IsotropicTakesTheMeanOfEachPart) {
  Eigen::MatrixXd I = indefinite();
  I(0, 0) = 3.0;
  make_information_isotropic(I, kParts);
  EXPECT_EQ(I, Eigen::Vector3d(2, 2, 5).asDiagonal().toDenseMatrix());
}

TEST(InformationPolicy, HopelessMatricesAreRefusedWhateverThePolicy) {
  Eigen::MatrixXd I = -Eigen::MatrixXd::Identity(3, 3);
  for (const auto policy : {InformationPolicy::kClamp, InformationPolicy::kIsotropic}) {
    InformationGate gate(policy);
    expect_input_error(
        [&] {
          gate.check(I, kParts, {"a.g2o", 7});
        },
        {"a.g2o:7:", "remove the measurement"});
    I = -Eigen::MatrixXd::Identity(3, 3);
  }
}

TEST(InformationPolicy, RefusingNamesTheFirstAndCountsAll) {
  InformationGate gate(InformationPolicy::kRefuse);
  Eigen::MatrixXd good = Eigen::MatrixXd::Identity(3, 3);
  Eigen::MatrixXd bad = indefinite();
  gate.check(good, kParts, {"a.g2o", 1});
  gate.check(bad, kParts, {"a.g2o", 2});
  gate.check(bad, kParts, {"a.g2o", 5});
  EXPECT_EQ(bad, indefinite());
  expect_input_error([&] { gate.finish(); }, {"a.g2o:2:", "smallest eigenvalue -1",
                                              "the first of 2 in this file", "clamp"});
  EXPECT_EQ(gate.repaired(), 0);
}

TEST(InformationPolicy, RepairsAreCounted) {
  InformationGate gate(InformationPolicy::kClamp);
  Eigen::MatrixXd bad = indefinite();
  gate.check(bad, kParts, {"a.g2o", 2});
  gate.finish();
  EXPECT_EQ(gate.repaired(), 1);
}

}  // namespace
}  // namespace mapjoin
