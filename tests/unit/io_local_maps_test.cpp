#include "mapjoin/io/local_maps.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "mapjoin/io/euler_chart.h"
#include "tests/support/io.h"

namespace mapjoin {
namespace {

using test::expect_input_error;

/// A file with the given ids, all values 0.5 and information 2 E.
std::string map_text(int reference, const std::vector<int>& ids) {
  const auto n = static_cast<int>(ids.size());
  std::string text = fmt::format("{}\n{}\n", reference, n);
  for (const int id : ids) text += fmt::format("{} 0.5\n", id);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) text += i == j ? "2 " : "0 ";
    text += "\n";
  }
  return text;
}

class LocalMaps : public testing::Test {
 protected:
  void add(int number, const std::string& text) {
    test::write_text(folder_.file(fmt::format("localmap_{}.txt", number)), text);
  }
  template <int D>
  LocalMapSet<D> read(const LocalMapOptions& options = {}) {
    return std::get<LocalMapSet<D>>(read_local_maps(folder_.path(), options));
  }
  /// Expects that a set of this one file is refused at the line, with all the parts in the message.
  void expect_refused(const std::string& text, int line, std::vector<std::string> parts,
                      const LocalMapOptions& options = {}) {
    SCOPED_TRACE(text);
    add(1, text);
    parts.push_back(fmt::format("localmap_1.txt:{}: ", line));
    expect_input_error([&] { read_local_maps(folder_.path(), options); }, parts);
  }

  test::TemporaryDirectory folder_;
};

TEST_F(LocalMaps, PoseFeatureSetsTellPosesBySign) {
  add(1, map_text(0, {-1, -1, -1, 7, 7, 3, 3}));
  add(2, map_text(-1, {-2, -2, -2}));
  LocalMapOptions options;
  options.session = 5;
  const LocalMapSet<2> set = read<2>(options);
  EXPECT_TRUE(set.pose_feature);
  EXPECT_EQ(set.first_number, 1);
  ASSERT_EQ(set.maps.size(), 2U);
  EXPECT_EQ(set.maps[0].anchor.keys, std::vector<Key>{pose_key(0, 5)});
  EXPECT_EQ(set.maps[0].keys, (std::vector<Key>{pose_key(1, 5), point_key(7, 5), point_key(3, 5)}));
  EXPECT_EQ(set.maps[1].anchor.keys, std::vector<Key>{pose_key(1, 5)});
  EXPECT_EQ(set.maps[0].information.scalars(), 7);
  EXPECT_EQ(set.maps[0].information.blocks(), 3);  // zero blocks are left out
}

TEST_F(LocalMaps, WithoutNegativeIdsAllArePosesAndLongRunsRepeatThem) {
  add(3, map_text(0, {1, 1, 1, 2, 2, 2, 2, 2, 2}));
  const LocalMapSet<2> set = read<2>();
  EXPECT_FALSE(set.pose_feature);
  EXPECT_EQ(set.first_number, 3);
  EXPECT_EQ(set.maps[0].keys, (std::vector<Key>{pose_key(1), pose_key(2), pose_key(2)}));
}

TEST_F(LocalMaps, DimensionIsDecidedOverTheWholeSet) {
  add(1, map_text(0, {1, 1, 1, 1, 1, 1}));
  EXPECT_EQ(read<3>().maps[0].keys.size(), 1U);
  add(2, map_text(1, {2, 2, 2}));
  EXPECT_EQ(read<2>().maps[0].keys.size(), 2U);
  add(1, map_text(0, {-1, -1, -1, -1, -1, -1, 4, 4, 4}));
  add(2, map_text(1, {8, 8, 8}));
  EXPECT_EQ(read<3>().maps[1].keys, std::vector<Key>{point_key(8)});
}

TEST_F(LocalMaps, MapsComeInNumericalOrder) {
  for (int k = 8; k <= 11; ++k) add(k, map_text(k, {k + 1, k + 1, k + 1}));
  test::write_text(folder_.file("readme.txt"), "not a map");
  test::write_text(folder_.file("localmap_x.txt"), "not a map");
  const LocalMapSet<2> set = read<2>();
  ASSERT_EQ(set.maps.size(), 4U);
  for (std::uint64_t k = 0; k < 4; ++k) EXPECT_EQ(set.maps[k].anchor.keys[0], pose_key(8 + k));
}

template <int D>
Eigen::MatrixXd some_information(int n) {
  Eigen::MatrixXd A = Eigen::MatrixXd::Identity(n, n);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) A(i, j) += 0.3 * std::sin(1.0 + i + 2.7 * j);
  }
  return A.transpose() * A;
}

TEST_F(LocalMaps, InformationIsBroughtIntoTheTangentOfThePose) {
  // A small change d of the pose costs the same in both charts.
  const Eigen::MatrixXd I = some_information<3>(9);
  Eigen::VectorXd x(9);
  x << 1, 2, 3, 0.4, -0.8, 1.2, 5, 6, 7;
  std::string text = "0\n9\n";
  for (int i = 0; i < 9; ++i) text += fmt::format("{} {}\n", i < 6 ? -4 : 2, x(i));
  for (int i = 0; i < 9; ++i) {
    for (int j = 0; j < 9; ++j) text += fmt::format("{} ", I(i, j));
    text += "\n";
  }
  add(1, text);
  const LocalMap<3> map = read<3>().maps[0];
  const auto& pose = *reinterpret_cast<const Rigid3*>(map.values.data());
  const Eigen::MatrixXd body = map.information.dense();
  for (int k = 0; k < 5; ++k) {
    Eigen::VectorXd d(9);
    for (int i = 0; i < 9; ++i) d(i) = 1e-5 * std::cos(k + 3.0 * i);
    const Rigid3 moved = Pose3::retract<double>(pose, Vec<6>(d.head<6>()));
    Eigen::VectorXd change(9);
    change << file_coordinates<3>(moved) - Vec<6>(x.head<6>()), d.tail<3>();
    EXPECT_NEAR(change.dot(I * change) / d.dot(body * d), 1.0, 1e-4);
  }
}

TEST_F(LocalMaps, SetsComeBackFromText) {
  LocalMapSet<3> set;
  set.pose_feature = true;
  set.first_number = 4;
  LocalMap<3> map;
  map.anchor = {nullptr, {pose_key(9)}};
  map.add_term<Point3>(point_key(5), {0.1, 1.0 / 3.0, -7});
  map.add_term<Pose3>(pose_key(10), rigid3({1, 2, 3}, Eigen::Quaterniond(0.9, 0.3, -0.2, 0.5)));
  map.information = SymmetricBlockMatrix::from_dense({0, 3, 9}, some_information<3>(9));
  set.maps.push_back(map);
  const std::string folder = folder_.file("sub/folder");
  write_local_maps(folder, set);
  const auto back = std::get<LocalMapSet<3>>(read_local_maps(folder));
  EXPECT_EQ(back.first_number, 4);
  EXPECT_TRUE(back.pose_feature);
  ASSERT_EQ(back.maps.size(), 1U);
  EXPECT_EQ(back.maps[0].anchor.keys, map.anchor.keys);
  EXPECT_EQ(back.maps[0].keys, map.keys);
  for (std::size_t k = 0; k < map.values.size(); ++k)
    EXPECT_NEAR(back.maps[0].values[k], map.values[k], 1e-14);
  EXPECT_LT((back.maps[0].information.dense() - map.information.dense()).norm(), 1e-12);
}

TEST_F(LocalMaps, WritingRefusesWhatTheFormatCannotSay) {
  LocalMap<2> map;
  map.anchor = {nullptr, {pose_key(0)}};
  map.information = SymmetricBlockMatrix::from_dense({0, 2}, Eigen::MatrixXd::Identity(2, 2));
  map.add_term<Point2>(point_key(5), {1, 2});
  LocalMapSet<2> set;
  set.maps = {map, map};
  const std::string folder = folder_.file("out");
  const auto refused = [&](const std::vector<std::string>& parts) {
    expect_input_error([&] { write_local_maps(folder, set); }, parts);
    EXPECT_FALSE(std::filesystem::exists(folder));
  };
  refused({"localmap_1.txt", "the feature point:5 in a pose-only set"});
  set.pose_feature = true;
  set.maps[1].anchor.keys = {point_key(4)};
  refused({"localmap_2.txt", "an anchor that is not one pose"});
  set.maps[1] = map;
  set.maps[1].keys[0].id = 0;
  refused({"localmap_2.txt", "point:0 in a pose-feature set"});
  set.maps[1].keys[0] = point_key(5, 3);
  refused({"3/point:5, of another session than the anchor", "native maps"});
}

TEST_F(LocalMaps, WritingDoesNotMixSets) {
  add(1, map_text(0, {-1, -1, -1}));
  add(2, map_text(1, {-2, -2, -2}));
  LocalMapSet<2> set = read<2>();
  write_local_maps(folder_.path(), set);
  set.maps.pop_back();
  expect_input_error([&] { write_local_maps(folder_.path(), set); },
                     {"localmap_2.txt' is not of the set", "empty folder"});
}

TEST_F(LocalMaps, FoldersWithoutOrWithMissingMaps) {
  expect_input_error([&] { read_local_maps(folder_.path()); }, {"holds no localmap_K.txt"});
  for (const int k : {2, 3, 6, 8}) add(k, map_text(0, {1, 1, 1}));
  expect_input_error(
      [&] { read_local_maps(folder_.path()); },
      {"missing are: localmap_4.txt localmap_5.txt localmap_7.txt;", "numbered without gaps"});
  EXPECT_THAT(test::message_of<FileError>([&] { read_local_maps(folder_.file("none")); }),
              testing::HasSubstr("cannot read folder"));
}

TEST_F(LocalMaps, TwoFilesWithOneNumber) {
  add(1, map_text(0, {1, 1, 1}));
  test::write_text(folder_.file("localmap_01.txt"), map_text(0, {1, 1, 1}));
  expect_input_error([&] { read_local_maps(folder_.path()); }, {"have the same number"});
}

TEST_F(LocalMaps, TruncatedFiles) {
  expect_refused("", 0, {"ends before the id of the reference pose", "truncated"});
  expect_refused("0\n", 1, {"ends before the dimension of the state"});
  expect_refused("0\n3\n1 0\n1 0          \n", 4, {"ends before number 3 of the 3 of the state"});
  expect_refused("0\n3\n1 0\n1 0\n1 0\n1 0 0\n0 1 0\n", 7,
                 {"ends before row 3 of the 3 of the information matrix"});
  expect_refused("0\n3\n1 0\n1 0\n1 0\n1 0 0\n0 1\n0 0 1\n", 7,
                 {"the line ends where the information matrix's row was expected"});
  expect_refused("0\n3\n1 0\n1\n1 0\n1 0 0\n0 1 0\n0 0 1\n", 4,
                 {"the line ends where the value was expected", "expected: id value"});
}

TEST_F(LocalMaps, TooMuch) {
  expect_refused(map_text(0, {1, 1, 1}) + "7\n", 9, {"goes on after the information matrix"});
  expect_refused("0 1\n", 1, {"goes on with '1' after the id of the reference pose"});
  expect_refused("0\n3\n1 0 0\n1 0\n1 0\n1 0 0\n0 1 0\n0 0 1\n", 3,
                 {"goes on with '0' after the value"});
  expect_refused("0\n3\n1 0\n1 0\n1 0\n1 0 0 0\n0 1 0\n0 0 1\n", 6,
                 {"after a row of the information matrix"});
}

TEST_F(LocalMaps, DimensionsThatCannotBe) {
  for (const std::string n : {"0", "-3", "1000000", "4000000000", "9000000000000000000"}) {
    expect_refused("0\n" + n + "\n1 0\n", 2,
                   {"a state of dimension " + n + " is not in this file"});
  }
  expect_refused("0\n2.5\n", 2,
                 {"the dimension of the state is '2.5', but a whole number was expected"});
}

TEST_F(LocalMaps, RunsThatAreNoVariable) {
  expect_refused(map_text(0, {1, 1, 1, 2, 2}), 6,
                 {"id 2 stands on 2 lines in a row", "poses take 3 (2D) or 6 (3D)"});
  expect_refused(map_text(0, {-1, -1, -1, 2, 2, 2, 2}), 6,
                 {"id 2 stands on 4 lines in a row", "features 2 or 3"});
  expect_refused(map_text(0, {-1, -1, -1, 2, 2, 2}), 6,
                 {"that is 3D, while", "localmap_1.txt:3 is 2D"});
  expect_refused(map_text(0, {-1, -1, -1, 0, 0}), 6,
                 {"id 0 is neither a pose (negative) nor a feature"});
}

TEST_F(LocalMaps, TheReferenceInItsOwnState) {
  expect_refused(map_text(4, {4, 4, 4}), 3,
                 {"pose 4 is in the state, but it is the reference pose itself"});
}

TEST_F(LocalMaps, NumbersThatAreNotFinite) {
  expect_refused("0\n3\n1 0\n1 nan\n1 0\n1 0 0\n0 1 0\n0 0 1\n", 4,
                 {"the value is 'nan'", "finite"});
  expect_refused("0\n3\n1 0\n1 0\n1 0\n1 0 0\n0 inf 0\n0 0 1\n", 7, {"row is 'inf'", "finite"});
}

TEST_F(LocalMaps, MatricesThatAreNotSymmetric) {
  expect_refused("0\n3\n1 0\n1 0\n1 0\n1 0 0\n0 1 0.1\n0 0.2 1\n", 8,
                 {"not symmetric: row 3 column 2 is 0.2, but row 2 column 3 is 0.1"});
  add(1, "0\n3\n1 0\n1 0\n1 0\n1 0 0\n0 1 0.1\n0 0.10000001 1\n");
  const Eigen::MatrixXd I = read<2>().maps[0].information.dense();
  EXPECT_EQ(I, I.transpose());
}

TEST_F(LocalMaps, IndefiniteInformationFollowsThePolicy) {
  const std::string text = "0\n3\n1 0\n1 0\n1 0\n1 2 0\n2 1 0\n0 0 1\n";
  expect_refused(text, 6, {"indefinite (smallest eigenvalue -1)", "the first of 1 in this set"});
  for (const auto policy : {InformationPolicy::kClamp, InformationPolicy::kIsotropic}) {
    LocalMapOptions options;
    options.indefinite = policy;
    const LocalMapSet<2> set = read<2>(options);
    EXPECT_EQ(set.repaired, 1);
    EXPECT_TRUE(is_positive_semidefinite(set.maps[0].information.dense()));
  }
}

TEST_F(LocalMaps, GimbalLock) {
  std::string text = map_text(0, {1, 1, 1, 1, 1, 1});
  text.replace(text.find("1 0.5\n1 0.5\n1 0.5\n1 0.5\n1 0.5") + 26, 3, fmt::format("{}", M_PI / 2));
  expect_refused(text, 3,
                 {"pose 1 has a pitch of 1.5707963267948966 rad", "g2o file or native maps"});
}

}  // namespace
}  // namespace mapjoin
