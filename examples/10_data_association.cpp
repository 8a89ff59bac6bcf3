// Two local maps whose features have no names: which of them are the same?
//
//     10_data_association
//
// A robot drives past two rows of trees and makes a local map of each half of its way. It knows
// that one ends where the other starts, and how trees lie to it, but not which tree is which.
#include <fmt/format.h>

#include <cmath>

#include "mapjoin/association/association.h"
#include "mapjoin/frames/anchors.h"
#include "mapjoin/graph/rename_keys.h"
#include "mapjoin/joining/join.h"

using namespace mapjoin;

namespace {

const std::vector<Vec<2>> kTrees = {{2.0, 3.1},  {4.5, -2.8}, {7.2, 2.6},  {9.9, -3.3},
                                    {11.8, 3.4}, {14.1, 2.2}, {16.3, -2.5}};

/// What is seen from a pose: the pose 8 m ahead, and trees first .. last - 1, each under a name of
/// this map's own, with a few centimetres of error.
Map<2> local_map(std::uint64_t start, double x, std::size_t first, std::size_t last,
                 std::uint64_t names) {
  LocalMap<2> map;
  map.anchor = pose_anchor<2>(pose_key(start));
  map.add_term<Pose2>(pose_key(start + 1), rigid2(8.03, -0.04, 0.004));
  std::vector<int> offsets{0, 3};
  for (std::size_t k = first; k < last; ++k) {
    const Vec<2> error(0.05 * std::sin(3.0 * static_cast<double>(k + names)),
                       0.05 * std::cos(5.0 * static_cast<double>(k + names)));
    map.add_term<Point2>(point_key(names + k), kTrees[k] - Vec<2>(x, 0.0) + error);
    offsets.push_back(offsets.back() + 2);
  }
  const int n = offsets.back();  // 5 cm, and 0.01 rad for the heading
  Eigen::MatrixXd information = 400.0 * Eigen::MatrixXd::Identity(n, n);
  information(2, 2) = 1e4;
  map.information = SymmetricBlockMatrix::from_dense(offsets, information);
  return to_map(map);
}

}  // namespace

int main() {
  const Map<2> a = local_map(0, 0.0, 0, 5, 100);
  const Map<2> b = local_map(1, 8.0, 2, 7, 200);

  const Association found = associate(a, b);  // by joint compatibility
  for (const Match& match : found.matches) {
    fmt::print("{} is {}: chi2 {:.2f}, suspicious above {:.1f}\n", to_string(match.b),
               to_string(match.a), match.chi2, match.bound);
  }
  for (const Key& key : found.unmatched) fmt::print("{} is new\n", to_string(key));

  // Under the names of the first map, it is a join like any other.
  const Map<2> joined = join(a, rename_keys(b, Renaming(names_in_a(found))));
  fmt::print("joined: {} variables\n", joined.values.size());

  bool right = found.matches.size() == 3 && found.unmatched.size() == 2;
  for (const Match& match : found.matches) right = right && match.a.id + 100 == match.b.id;
  return right && joined.values.size() == 3 + 7 ? 0 : 1;
}
