#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <limits>

#include "mapjoin/io/local_maps.h"
#include "tests/support/dense.h"
#include "tests/support/io.h"
#include "tests/support/matlab.h"
#include "tests/support/random_maps.h"

namespace mapjoin {
namespace {

using test::expect_input_error;
using test::matlab_file;

Eigen::MatrixXd state(const std::vector<int>& ids) {
  Eigen::MatrixXd out(static_cast<Eigen::Index>(ids.size()), 2);
  for (std::size_t k = 0; k < ids.size(); ++k)
    out.row(static_cast<Eigen::Index>(k)) << ids[k], 0.1 * static_cast<double>(k + 1);
  return out;
}

class MatlabMaps : public testing::Test {
 protected:
  void SetUp() override {
    add(1, state({0, 0, 0}), Eigen::Matrix3d::Identity());
    try {
      read_local_maps(folder_.path());
    } catch (const InputError& error) {
      if (std::string(error.what()).find("built without matio") == std::string::npos) return;
      EXPECT_THAT(error.what(), testing::HasSubstr("-DMAPJOIN_WITH_MATIO=ON"));
      GTEST_SKIP() << "built without matio";
    }
  }
  void write(int number, const std::string& content) {
    test::write_text(folder_.file(fmt::format("localmap_{}.mat", number)), content);
  }
  void add(int number, const Eigen::MatrixXd& st, const Eigen::MatrixXd& P) {
    write(number, matlab_file({{"localmap_st", st}, {"localmap_P", P}}));
  }
  void expect_refused(const std::vector<std::string>& parts) {
    expect_input_error([&] { read_local_maps(folder_.path()); }, parts);
  }

  test::TemporaryDirectory folder_;
};

TEST_F(MatlabMaps, StartAtThePoseBeforeAndHoldTheInverseOfTheCovariance) {
  test::Dice dice(1);
  const Eigen::MatrixXd P = dice.definite(7, 0.01);
  add(1, state({0, 0, 0, 9, 9, 4, 4}), P);
  add(2, state({0, 0, 0}), Eigen::Matrix3d::Identity());
  LocalMapOptions options;
  options.session = 3;
  const auto set = std::get<LocalMapSet<2>>(read_local_maps(folder_.path(), options));
  EXPECT_TRUE(set.pose_feature);
  EXPECT_EQ(set.first_number, 1);
  ASSERT_EQ(set.maps.size(), 2U);
  EXPECT_EQ(set.maps[0].anchor.keys, std::vector<Key>{pose_key(0, 3)});
  EXPECT_EQ(set.maps[0].keys, (std::vector<Key>{pose_key(1, 3), point_key(9, 3), point_key(4, 3)}));
  EXPECT_EQ(set.maps[1].anchor.keys, std::vector<Key>{pose_key(1, 3)});
  EXPECT_EQ(set.maps[1].keys, std::vector<Key>{pose_key(2, 3)});
  // In the tangent of the library the end pose's position is in its own frame.
  Eigen::MatrixXd B = Eigen::MatrixXd::Identity(7, 7);
  B.topLeftCorner<2, 2>() = Eigen::Rotation2Dd(0.3).toRotationMatrix();
  const Eigen::MatrixXd expected = B.transpose() * test::dense_inverse(P) * B;
  EXPECT_LT(test::relative_distance(set.maps[0].information.dense(), expected), 1e-12);
}

TEST_F(MatlabMaps, MayBeOfSpace) {
  add(1, state({0, 0, 0, 0, 0, 0, 7, 7, 7}), Eigen::MatrixXd::Identity(9, 9));
  const auto set = std::get<LocalMapSet<3>>(read_local_maps(folder_.path()));
  EXPECT_EQ(set.maps[0].keys, (std::vector<Key>{pose_key(1), point_key(7)}));
}

TEST_F(MatlabMaps, GiveWayToTextInAFolderOfBoth) {
  test::write_text(folder_.file("localmap_1.txt"), "5\n3\n6 1\n6 2\n6 0\n1 0 0\n0 1 0\n0 0 1\n");
  const auto set = std::get<LocalMapSet<2>>(read_local_maps(folder_.path()));
  EXPECT_EQ(set.maps[0].anchor.keys[0], pose_key(5));
}

TEST_F(MatlabMaps, AreRefusedWhenTheyEndEarly) {
  const std::string whole =
      matlab_file({{"localmap_st", state({0, 0, 0})}, {"localmap_P", Eigen::Matrix3d::Identity()}});
  for (const std::size_t size : {std::size_t{0}, std::size_t{60}, std::size_t{130},
                                 std::size_t{180}, whole.size() - 8, whole.size() - 1}) {
    SCOPED_TRACE(size);
    write(1, whole.substr(0, size));
    expect_refused({"localmap_1.mat"});
  }
  write(1, "Just a text that somebody has called so, long enough for a header of a MATLAB file. " +
               std::string(200, '.'));
  expect_refused({"no MATLAB file of level 5", "save -v7"});
}

TEST_F(MatlabMaps, NameTheVariableThatIsMissingOrWrong) {
  write(1, matlab_file({{"localmap_P", Eigen::Matrix3d::Identity()}}));
  expect_refused({"localmap_1.mat", "no variable localmap_st"});
  write(1, matlab_file({{"localmap_st", state({0, 0, 0})}}));
  expect_refused({"no variable localmap_P"});
  add(1, state({0, 0, 0}).transpose(), Eigen::Matrix3d::Identity());
  expect_refused({"localmap_st is 2 x 3"});
  add(1, state({0, 0, 0}), Eigen::MatrixXd::Identity(3, 4));
  expect_refused({"localmap_P is 3 x 4, but the state has 3"});
  add(1, state({0, 0, 0, 5, 5}), Eigen::Matrix3d::Identity());
  expect_refused({"localmap_P is 3 x 3, but the state has 5"});
}

TEST_F(MatlabMaps, RefuseNumbersThatAreNone) {
  Eigen::MatrixXd P = Eigen::Matrix3d::Identity();
  P(1, 2) = std::numeric_limits<double>::quiet_NaN();
  add(1, state({0, 0, 0}), P);
  expect_refused({"row 2 column 3 of localmap_P is nan"});
  Eigen::MatrixXd st = state({0, 0, 0});
  st(2, 1) = std::numeric_limits<double>::infinity();
  add(1, st, Eigen::Matrix3d::Identity());
  expect_refused({"row 3 column 2 of localmap_st is inf"});
}

TEST_F(MatlabMaps, RefuseIdsThatAreNone) {
  Eigen::MatrixXd st = state({0, 0, 0, 5, 5});
  st(3, 0) = st(4, 0) = 5.5;
  add(1, st, Eigen::MatrixXd::Identity(5, 5));
  expect_refused({"row 4 of localmap_st", "the id is 5.5"});
  add(1, state({0, 0, 0, -5, -5}), Eigen::MatrixXd::Identity(5, 5));
  expect_refused({"the id is -5"});
  add(1, state({0, 0, 0, 5}), Eigen::MatrixXd::Identity(4, 4));
  expect_refused({"row 4 of localmap_st", "id 5 stands on 1 lines"});
}

TEST_F(MatlabMaps, RefuseCovariancesThatAreNone) {
  Eigen::MatrixXd P = Eigen::Matrix3d::Identity();
  P(0, 2) = 0.5;
  add(1, state({0, 0, 0}), P);
  expect_refused({"localmap_P is not symmetric", "row 3 column 1 is 0", "row 1 column 3 is 0.5"});
  P(0, 2) = 0.0;
  P(1, 1) = -2.0;
  add(1, state({0, 0, 0}), P);
  expect_refused({"not positive definite (smallest eigenvalue -2)"});
  LocalMapOptions options;
  options.indefinite = InformationPolicy::kClamp;
  const auto set = std::get<LocalMapSet<2>>(read_local_maps(folder_.path(), options));
  EXPECT_EQ(set.repaired, 1);
}

TEST_F(MatlabMaps, AreNumberedFromOneWithoutGaps) {
  add(3, state({0, 0, 0}), Eigen::Matrix3d::Identity());
  expect_refused({"missing are: localmap_2.mat"});
  add(0, state({0, 0, 0}), Eigen::Matrix3d::Identity());
  add(2, state({0, 0, 0}), Eigen::Matrix3d::Identity());
  expect_refused({"localmap_0.mat", "from 1"});
}

}  // namespace
}  // namespace mapjoin
