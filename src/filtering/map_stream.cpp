#include "mapjoin/filtering/map_stream.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "mapjoin/frames/anchors.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/joining/join.h"
#include "mapjoin/joining/join_all.h"
#include "mapjoin/joining/report.h"
#include "mapjoin/solvers/covariance.h"

namespace mapjoin {

namespace {

/// One above the largest id of a type in a session that either map knows.
template <int D>
std::uint64_t free_id(const VariableSet<D>& global, const std::vector<Key>& local,
                      const Key& like) {
  std::uint64_t id = 0;
  const auto see = [&](const Key& key) {
    if (key.type == like.type && key.session == like.session) id = std::max(id, key.id + 1);
  };
  for (const auto& column : global.columns())
    std::for_each(column.keys.begin(), column.keys.end(), see);
  std::for_each(local.begin(), local.end(), see);
  return id;
}

/// The names of a local map's variables in the map, where they differ.
template <int D>
std::map<Key, Key> new_names(const VariableSet<D>& global, const LocalMap<D>& local,
                             const std::vector<std::pair<Key, Key>>& matches) {
  std::map<Key, Key> names;
  std::set<Key> taken;
  for (const auto& [ours, theirs] : matches) {
    if (std::find(local.keys.begin(), local.keys.end(), ours) == local.keys.end())
      throw InputError(fmt::format("association: {} is not in the local map", to_string(ours)));
    global.require(theirs, "association");
    if (ours.type != theirs.type)
      throw InputError(fmt::format("association: {} and {} are of different types", to_string(ours),
                                   to_string(theirs)));
    if (!names.emplace(ours, theirs).second || !taken.insert(theirs).second)
      throw InputError(fmt::format("association: {} and {} are matched, and one of them is already",
                                   to_string(ours), to_string(theirs)));
  }
  std::map<Tag, std::uint64_t> next;
  for (const Key& key : local.keys) {
    const bool pose = key.type == Tag("pose");
    if (pose || names.count(key) > 0 || !global.find(key)) continue;
    const auto first = next.emplace(key.type, free_id(global, local.keys, key)).first;
    names.emplace(key, Key{key.type, key.session, first->second++});
  }
  return names;
}

}  // namespace

template <int D>
MapStream<D>::MapStream(StreamOptions<D> options) : options_(std::move(options)) {
  switch (options_.method) {
    case StreamMethod::kDivideAndConquer:
      options_.join.tree = TreeShape::kOrder;
      break;
    case StreamMethod::kSlsjf:
      method_.template emplace<Slsjf<D>>(options_.filter);
      break;
    case StreamMethod::kDslam:
      method_.template emplace<DslamJoin<D>>(options_.filter);
      break;
    case StreamMethod::kEkf:
      method_.template emplace<EkfJoin<D>>();
      break;
  }
}

template <int D>
LocalMap<D> MapStream<D>::associated(const LocalMap<D>& local_map, Fusion& fusion) {
  renamed_.clear();
  matched_.clear();
  if (!options_.associate || size_ == 0) return local_map;
  const auto start = Clock::now();
  const Map<D> global = current();
  matched_ = options_.associate(global, to_map(local_map));
  const auto names = new_names(global.variables(), local_map, matched_);
  LocalMap<D> out = local_map;
  const auto rename = [&](Key& key) {
    const auto found = names.find(key);
    if (found != names.end()) key = found->second;
  };
  std::for_each(out.keys.begin(), out.keys.end(), rename);
  std::for_each(out.anchor.keys.begin(), out.anchor.keys.end(), rename);
  for (const auto& [ours, theirs] : names) {
    if (ours != theirs) renamed_.emplace_back(ours, theirs);
  }
  fusion.seconds_associate = seconds_since(start);
  return out;
}

template <int D>
Fusion MapStream<D>::add(const LocalMap<D>& given) {
  Fusion before;
  const LocalMap<D> local_map = associated(given, before);
  current_.reset();
  Fusion fusion;
  if (std::holds_alternative<std::vector<Level>>(method_)) {
    const auto start = Clock::now();
    push(local_map);
    fusion.seconds_factor = seconds_since(start);
  } else if (auto* const slsjf = std::get_if<Slsjf<D>>(&method_)) {
    fusion = slsjf->fuse(local_map);
  } else if (auto* const dslam = std::get_if<DslamJoin<D>>(&method_)) {
    fusion = dslam->fuse(local_map);
  } else {
    fusion = std::get<EkfJoin<D>>(method_).fuse(local_map);
  }
  fusion.seconds_associate = before.seconds_associate;
  if (size_++ == 0) frame_ = local_map.anchor;
  return fusion;
}

template <int D>
std::vector<Map<D>> MapStream<D>::join_pieces(std::vector<Map<D>> a, const std::vector<Map<D>>& b,
                                              bool root) const {
  a.insert(a.end(), b.begin(), b.end());
  JoinOptions options = options_.join;
  if (!root) options.root_solves = 1;
  return join_all(std::span<const Map<D>>(a), {}, options).maps;
}

/// A binary counter: equal digits carry.
template <int D>
void MapStream<D>::push(const LocalMap<D>& local_map) {
  auto& levels = std::get<std::vector<Level>>(method_);
  for (auto& half : halves_) half.clear();
  levels.push_back({0, join_all(std::span<const LocalMap<D>>(&local_map, 1), options_.join).maps});
  while (levels.size() > 1 && levels[levels.size() - 2].level == levels.back().level) {
    Level last = std::move(levels.back());
    levels.pop_back();
    Level& first = levels.back();
    std::vector<Map<D>> joined = join_pieces(first.pieces, last.pieces, false);
    if (levels.size() == 1) halves_ = {std::move(first.pieces), std::move(last.pieces)};
    first = {last.level + 1, std::move(joined)};
  }
}

template <int D>
Map<D> MapStream<D>::current() const {
  if (size_ == 0) throw InputError("no local map has arrived: there is no map yet");
  if (const auto* const slsjf = std::get_if<Slsjf<D>>(&method_)) return slsjf->map();
  if (const auto* const dslam = std::get_if<DslamJoin<D>>(&method_)) return dslam->map();
  if (const auto* const ekf = std::get_if<EkfJoin<D>>(&method_)) return ekf->map();
  if (current_) return *current_;
  const auto& levels = std::get<std::vector<Level>>(method_);
  // From the right, as the order tree does; the last join is its root.
  std::vector<Map<D>> pieces = levels.back().pieces;
  if (levels.size() == 1 && !halves_[0].empty()) pieces = join_pieces(halves_[0], halves_[1], true);
  for (std::size_t k = levels.size() - 1; k-- > 0;)
    pieces = join_pieces(levels[k].pieces, pieces, k == 0);
  if (pieces.size() > 1)
    throw DisconnectedError(fmt::format(
        "the local maps so far are {} pieces that share too little to be one map; the one of {} "
        "stands apart",
        pieces.size(), to_string(pieces[1].anchor)));
  current_ = change_frame(std::move(pieces[0]), frame_);
  return *current_;
}

template <int D>
Eigen::MatrixXd MapStream<D>::covariance(std::span<const Key> keys) {
  if (auto* const slsjf = std::get_if<Slsjf<D>>(&method_)) return slsjf->covariance(keys);
  if (auto* const dslam = std::get_if<DslamJoin<D>>(&method_)) return dslam->covariance(keys);
  if (auto* const ekf = std::get_if<EkfJoin<D>>(&method_)) return ekf->covariance(keys);
  return Covariance<D>(current()).of(keys);
}

template class MapStream<2>;
template class MapStream<3>;

}  // namespace mapjoin
