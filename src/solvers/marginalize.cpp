#include "mapjoin/solvers/marginalize.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include "mapjoin/frames/align.h"
#include "mapjoin/frames/anchors.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/frames/exact_gauge.h"
#include "mapjoin/frames/points_anchor.h"
#include "mapjoin/graph/index.h"
#include "mapjoin/solvers/block_system.h"

namespace mapjoin {

namespace {

/// Numbers among the kept variables, -1 for dropped ones.
std::vector<int> places_of(std::span<const int> keep, int size) {
  std::vector<int> place(at(size), -1);
  for (std::size_t k = 0; k < keep.size(); ++k) place[at(keep[k])] = static_cast<int>(k);
  return place;
}

template <int D>
void require_frame(const Values<D>& values, std::span<const int> keep) {
  std::vector<CommonColumn<D>> columns;
  std::vector<std::vector<int>> rows(values.variables().columns().size());
  for (std::size_t c = 0; c < rows.size(); ++c) {
    const auto& column = values.variables().column(static_cast<int>(c));
    for (auto k = std::lower_bound(keep.begin(), keep.end(), column.first);
         k != keep.end() && *k < column.end(); ++k)
      rows[c].push_back(*k - column.first);
    const double* const data = values.data(static_cast<int>(c));
    columns.push_back({column.kind, data, data, rows[c], rows[c]});
  }
  if (fixes_frame(std::span<const CommonColumn<D>>(columns))) return;
  throw DegenerateFrameError(
      fmt::format("the {} kept variables do not fix a frame, so the map would lose where they are; "
                  "keep a pose, "
                  "or at least {}",
                  keep.size(), D == 2 ? "two points" : "three points that are not collinear"));
}

/// Schur complements of subtrees of dropped variables: one after another, each onto what is kept
/// around it.
class SchurComplement {
 public:
  SchurComplement(const SymmetricBlockMatrix& information, std::span<const int> place)
      : information_(information), place_(place) {
    std::vector<char> late;
    for (const int p : place) late.push_back(p >= 0);
    cliques_ = block_cliques(information, [&](int i, int j) {
      return place[at(i)] < 0 || place[at(j)] < 0;  // what is kept already stays as it is
    });
    const auto dropped = static_cast<std::int32_t>(std::count(late.begin(), late.end(), 0));
    structure_ = analyze(cliques_.dims, cliques_.view(), order_blocks_in_two(late, cliques_.view()),
                         {}, dropped);
    list_subtrees();
  }

  /// Information over what is kept. \returns the number of a variable that is not determined, or
  /// -1.
  int run(SymmetricBlockMatrix& out) {
    out = pattern();
    for (int j = 0; j < information_.size(); ++j) {
      for (std::int64_t s = information_.begin(j); s < information_.end(j); ++s) {
        const int i = information_.row(s);
        if (place_[at(i)] < 0 || place_[at(j)] < 0) continue;
        std::copy_n(information_.block(s), information_.dim(i) * information_.dim(j),
                    out.block(out.find(place_[at(i)], place_[at(j)])));
      }
    }
    for (const Subtree& tree : subtrees_) {
      const FactorStatus status = factor_.factorize_subtree(
          structure_, tree.first, tree.root, [&](std::int32_t f, const FrontView& view) {
            assemble_blocks(information_, cliques_, structure_, f, view);
          });
      if (!status.ok()) return status.failed_variable;
      add_update(tree.root, out);
    }
    return -1;
  }

 private:
  struct Subtree {
    std::int32_t first, root;
  };

  bool is_kept(std::int32_t front) const {
    return place_[at(structure_.order[at(structure_.fronts[at(front)].first_position)])] >= 0;
  }

  /// The trees of dropped variables. Each is a run of fronts.
  void list_subtrees() {
    std::int32_t first = 0;
    for (std::int32_t f = 0; f < static_cast<std::int32_t>(structure_.fronts.size()); ++f) {
      if (structure_.fronts[at(f)].parent >= 0) continue;
      if (!is_kept(f)) subtrees_.push_back({first, f});
      first = f + 1;
    }
  }

  /// Kept variables around a subtree, in elimination order.
  std::vector<int> around(std::int32_t root) const {
    std::vector<int> out;
    for (const std::int32_t position : structure_.updates_of(root))
      out.push_back(place_[at(structure_.order[at(position)])]);
    return out;
  }

  SymmetricBlockMatrix pattern() const {
    std::vector<int> offsets{0};
    for (int i = 0; i < information_.size(); ++i) {
      if (place_[at(i)] >= 0) offsets.push_back(offsets.back() + information_.dim(i));
    }
    std::vector<std::pair<int, int>> pairs;
    for (int j = 0; j < information_.size(); ++j) {
      for (std::int64_t s = information_.begin(j) + 1; s < information_.end(j); ++s) {
        const int i = place_[at(information_.row(s))];
        if (i >= 0 && place_[at(j)] >= 0) pairs.emplace_back(i, place_[at(j)]);
      }
    }
    std::size_t count = pairs.size();
    for (const Subtree& tree : subtrees_) {
      const std::size_t kept = structure_.updates_of(tree.root).size();
      count += kept * (kept - (kept > 0)) / 2;
    }
    pairs.reserve(count);
    for (const Subtree& tree : subtrees_) {
      const std::vector<int> kept = around(tree.root);
      for (std::size_t a = 0; a < kept.size(); ++a) {
        for (std::size_t b = 0; b < a; ++b) pairs.emplace_back(kept[a], kept[b]);
      }
    }
    return SymmetricBlockMatrix(std::move(offsets), pairs);
  }

  void add_update(std::int32_t root, SymmetricBlockMatrix& out) const {
    const std::vector<int> kept = around(root);
    const auto S = factor_.update_matrix(root);
    std::vector<int> order(kept.size()), first{0};
    for (const int i : kept) first.push_back(first.back() + out.dim(i));
    std::iota(order.begin(), order.end(), 0);
    std::sort(order.begin(), order.end(), [&](int a, int b) { return kept[at(a)] < kept[at(b)]; });
    for (std::size_t c = 0; c < order.size(); ++c) {
      const int b = order[c], j = kept[at(b)];
      std::int64_t slot = out.begin(j);
      for (std::size_t r = c; r < order.size(); ++r) {  // rows ascend in both
        const int a = order[r], i = kept[at(a)];
        while (out.row(slot) != i) ++slot;
        Eigen::Map<Eigen::MatrixXd> block(out.block(slot), out.dim(i), out.dim(j));
        if (a == b) {
          block += S.block(first[at(a)], first[at(a)], out.dim(i), out.dim(i))
                       .selfadjointView<Eigen::Lower>();
        } else if (a > b) {
          block += S.block(first[at(a)], first[at(b)], out.dim(i), out.dim(j));
        } else {
          block += S.block(first[at(b)], first[at(a)], out.dim(j), out.dim(i)).transpose();
        }
      }
    }
  }

  const SymmetricBlockMatrix& information_;
  std::span<const int> place_;
  BlockCliques cliques_;
  FrontalStructure structure_;
  std::vector<Subtree> subtrees_;
  FrontalCholesky factor_;
};

template <int D>
bool holds(const VariableSet<D>& variables, const Anchor<D>& anchor) {
  return anchor.kind != nullptr &&
         std::all_of(anchor.keys.begin(), anchor.keys.end(),
                     [&](const Key& key) { return variables.find(key).has_value(); });
}

/// Gives a map that has lost its anchor another one.
template <int D>
Map<D> anchored_anew(Map<D> map, const Anchor<D>& wanted) {
  std::optional<Anchor<D>> anchor;  // chosen before the map is moved from
  const int c = map.variables().find_column(Tag("pose"));
  if (wanted.kind != nullptr) {
    anchor = wanted;
  } else if (c >= 0) {
    anchor = pose_anchor<D>(map.variables().column(c).keys[0]);
  } else {
    anchor = farthest_points(map.values);
  }
  if (anchor) return change_frame(std::move(map), *anchor);
  map.anchor = {};
  return map;
}

}  // namespace

template <int D>
Map<D> marginalize(const Map<D>& given, std::span<const int> keep, const Anchor<D>& anchor) {
  require_information(given);
  require_frame(given.values, keep);
  Map<D> out;
  out.values = subset(given.values, keep);
  const bool solved_here = holds(out.variables(), given.solved_in);
  const bool exact = solved_here || is_gauge_free(given);
  const SymmetricBlockMatrix completed =
      exact ? SymmetricBlockMatrix() : completed_where_solved(given).information;
  const SymmetricBlockMatrix& information = exact ? given.information : completed;

  const std::vector<int> place = places_of(keep, given.variables().size());
  const int failed = SchurComplement(information, place).run(out.information);
  if (failed >= 0)
    throw SingularError(fmt::format(
        "the information does not determine {} once the rest is known, so it cannot be eliminated; "
        "keep it, or add measurements that fix it",
        to_string(given.variables().key(failed))));

  out.anchor = given.anchor;
  if (!holds(out.variables(), given.anchor)) out = anchored_anew(std::move(out), anchor);
  out.solved_in = solved_here ? given.solved_in : out.anchor;
  return out;
}

template <int D>
Map<D> marginalize(const Map<D>& map, std::span<const Key> keep, const Anchor<D>& anchor) {
  std::vector<int> numbers;
  for (const Key& key : keep) numbers.push_back(map.variables().require(key, "marginalize"));
  std::sort(numbers.begin(), numbers.end());
  numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
  return marginalize(map, std::span<const int>(numbers), anchor);
}

template <int D>
Map<D> marginalize_out(const Map<D>& map, std::span<const Key> drop, const Anchor<D>& anchor) {
  std::vector<char> dropped(at(map.variables().size()), 0);
  for (const Key& key : drop) dropped[at(map.variables().require(key, "marginalize"))] = 1;
  std::vector<int> keep;
  for (int i = 0; i < map.variables().size(); ++i) {
    if (dropped[at(i)] == 0) keep.push_back(i);
  }
  return marginalize(map, std::span<const int>(keep), anchor);
}

template <int D>
std::vector<int> poses_of(const VariableSet<D>& variables) {
  const int c = variables.find_column(Tag("pose"));
  std::vector<int> out(c < 0 ? 0 : at(variables.column(c).size()));
  std::iota(out.begin(), out.end(), c < 0 ? 0 : variables.column(c).first);
  return out;
}

template <int D>
std::vector<int> features_of(const VariableSet<D>& variables) {
  const int c = variables.find_column(Tag("pose"));
  std::vector<int> out;
  for (int i = 0; i < variables.size(); ++i) {
    if (c < 0 || i < variables.column(c).first || i >= variables.column(c).end()) out.push_back(i);
  }
  return out;
}

template <int D>
std::vector<int> last_pose_and_features(const VariableSet<D>& variables) {
  const std::vector<int> poses = poses_of(variables);
  if (poses.empty()) throw InputError("the map has no pose, so there is no last one to keep");
  std::vector<int> out = features_of(variables);
  out.insert(std::upper_bound(out.begin(), out.end(), poses.back()), poses.back());
  return out;
}

#define MAPJOIN_INSTANTIATE(D)                                                               \
  template Map<D> marginalize<D>(const Map<D>&, std::span<const Key>, const Anchor<D>&);     \
  template Map<D> marginalize<D>(const Map<D>&, std::span<const int>, const Anchor<D>&);     \
  template Map<D> marginalize_out<D>(const Map<D>&, std::span<const Key>, const Anchor<D>&); \
  template std::vector<int> poses_of<D>(const VariableSet<D>&);                              \
  template std::vector<int> features_of<D>(const VariableSet<D>&);                           \
  template std::vector<int> last_pose_and_features<D>(const VariableSet<D>&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
