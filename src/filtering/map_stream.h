#pragma once

#include <array>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <variant>
#include <vector>

#include "mapjoin/filtering/dslam.h"
#include "mapjoin/filtering/ekf_join.h"
#include "mapjoin/filtering/slsjf.h"
#include "mapjoin/joining/options.h"

/// \file
/// Local maps that arrive one at a time, and a map to ask at any moment: what divide and conquer
/// and the filters have in common.

namespace mapjoin {

/// How a stream of local maps becomes one map.
enum class StreamMethod {
  kDivideAndConquer,  ///< linear joins in pairs: `StreamOptions::join.mode` says what of
  kSlsjf,
  kDslam,
  kEkf
};

/// Which features of an arriving local map are already in the map: pairs (key in the local map, key
/// in the map so far). Of what is in no pair, poses keep their keys and features are new: they keep
/// their keys too, where these are free, and get the lowest free ids where they are not.
/// `associate_arrivals()` in association/arrivals.h makes one.
template <int D>
using AssociateFunction =
    std::function<std::vector<std::pair<Key, Key>>(const Map<D>& global, const Map<D>& local)>;

template <int D>
struct StreamOptions {
  StreamMethod method = StreamMethod::kSlsjf;
  FilterOptions filter;  ///< kSlsjf and kDslam
  JoinOptions join;      ///< kDivideAndConquer; mode observe or summary are made for it
  /// Asked at every local map but the first. Empty: equal keys are equal variables.
  AssociateFunction<D> associate;
};

/// A stream of local maps.
///
///     MapStream<2> stream({.method = StreamMethod::kSlsjf});
///     for (const LocalMap<2>& map : arriving) {
///       stream.add(map);
///       show(stream.current().values, stream.covariance(keys));
///     }
///
/// Divide and conquer keeps joined maps of 2^k local maps, like the digits of a binary number: of n
/// local maps at most log2 n + 1, and each is joined log2 n times. current() joins what is there;
/// after the last local map that is the map of the order tree (joining/join_tree.h).
template <int D>
class MapStream {
 public:
  explicit MapStream(StreamOptions<D> options = {});

  /// \returns what it took, association included; for divide and conquer, joins count as
  /// seconds_factor. \throws as the method does, and then the stream is of no more use; InputError
  /// when the association names keys that do not exist, or one of them twice.
  Fusion add(const LocalMap<D>& local_map);

  int size() const { return size_; }
  /// The map so far, in the frame of the first local map. The filters' costs O(n) and, for kEkf, an
  /// inversion; divide and conquer's up to log2 n joins, kept until the next local map arrives.
  /// \throws InputError before the first local map; DisconnectedError where the local maps so far
  /// are several pieces (divide and conquer).
  Map<D> current() const;
  /// Joint covariance of some variables of current(), in the frame of the first local map.
  Eigen::MatrixXd covariance(std::span<const Key> keys);
  /// What the features of the last local map were found to be: pairs (its key, the map's key), of
  /// those that changed their name.
  const std::vector<std::pair<Key, Key>>& renamed() const { return renamed_; }
  /// What the association answered for the last local map.
  const std::vector<std::pair<Key, Key>>& matched() const { return matched_; }

 private:
  /// Joined maps of 2^level local maps each, as pieces.
  struct Level {
    int level = 0;
    std::vector<Map<D>> pieces;
  };
  LocalMap<D> associated(const LocalMap<D>& local_map, Fusion& fusion);
  void push(const LocalMap<D>& local_map);
  std::vector<Map<D>> join_pieces(std::vector<Map<D>> a, const std::vector<Map<D>>& b,
                                  bool root) const;

  StreamOptions<D> options_;
  std::variant<std::vector<Level>, Slsjf<D>, DslamJoin<D>, EkfJoin<D>> method_;
  /// What the only level is joined of, where there is one: in observing joins the root solves more
  /// often than others, and it is the root until the next local map arrives.
  std::array<std::vector<Map<D>>, 2> halves_;
  Anchor<D> frame_;
  int size_ = 0;
  std::vector<std::pair<Key, Key>> renamed_, matched_;
  mutable std::optional<Map<D>> current_;  ///< of divide and conquer
};

extern template class MapStream<2>;
extern template class MapStream<3>;

}  // namespace mapjoin
