#include "mapjoin/joining/summary_tree.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <memory>

#include "mapjoin/frames/anchors.h"
#include "mapjoin/frames/local_map.h"
#include "mapjoin/graph/index.h"
#include "mapjoin/joining/common_points.h"
#include "mapjoin/joining/leaf.h"
#include "mapjoin/joining/place.h"
#include "mapjoin/joining/refine.h"
#include "mapjoin/joining/report.h"
#include "mapjoin/joining/summary_join.h"
#include "mapjoin/joining/tree_walk.h"
#include "mapjoin/solvers/blas_threads.h"

namespace mapjoin {

namespace {

constexpr int kMostLeafSolves = 20;
constexpr double kLeafTolerance = 1e-9;

/// How often maps were joined in frames of points, and which of these frames is least certain.
template <int D>
struct PointFrames {
  int count = 0;
  ChosenPoints<D> worst;

  void add(const ChosenPoints<D>& chosen) {
    if (count == 0 || chosen.certainty < worst.certainty) worst = chosen;
    ++count;
  }
  void add(const PointFrames& other) {
    if (other.count == 0) return;
    const int total = count + other.count;
    add(other.worst);
    count = total;
  }
};

/// A map and the pose its first local map started from (number in the graph, -1: none).
template <int D>
struct Started {
  Summary<D> summary;
  int start = -1;
  PointFrames<D> frames{};  ///< of the joins that made it
};

struct SummaryDesk {
  explicit SummaryDesk(int variables) : places(variables) {}
  Places places;
  FrontalCholesky cholesky;
  WorkerPool alone;
};

/// The pose that two maps are joined at: the start of the second if the first knows it, else the
/// lowest they share.
template <int D>
int common_pose(const VariableSet<D>& all, const Started<D>& first, const Started<D>& second) {
  const std::vector<int>& a = first.summary.piece.variables;
  const std::vector<int>& b = second.summary.piece.variables;
  if (second.start >= 0 && std::binary_search(a.begin(), a.end(), second.start))
    return second.start;
  const int c = all.find_column(Tag("pose"));
  if (c < 0) return -1;
  const Piece<D>& piece = second.summary.piece;
  for (int k = piece.column_start[at(c)]; k < piece.column_start[at(c) + 1]; ++k) {
    if (std::binary_search(a.begin(), a.end(), b[at(k)])) return b[at(k)];
  }
  return -1;
}

template <int D>
bool has_pose(const VariableSet<D>& all, const Piece<D>& piece) {
  const int c = all.find_column(Tag("pose"));
  return c >= 0 && piece.column_size(at(c)) > 0;
}

/// The pose that a piece's first observation was made from; -1 where its frame is not a pose's.
template <int D>
int start_of(const ObservationList<D>& list, const Piece<D>& piece) {
  const int variable = piece.variables[at(list.clique(0)[0])];
  return list.graph().variables.kind(variable).tag == Tag("pose") ? variable : -1;
}

/// Does any variable but one stand in more than one observation? Else the values are the
/// measurements themselves.
template <int D>
bool redundant(const ObservationList<D>& list) {
  std::vector<bool> seen(list.dims().size(), false);
  const std::int32_t centre = list.clique(0)[0];
  for (std::int64_t k = 0; k < static_cast<std::int64_t>(list.size()); ++k) {
    const auto clique = list.clique(k);
    if (clique[0] != centre) return true;
    for (const std::int32_t v : clique.subspan(1)) {
      if (seen[at(v)]) return true;
      seen[at(v)] = true;
    }
    const MeasurementGraph<D>& graph = list.graph();
    const auto submap =
        list.observation(k) - static_cast<std::int64_t>(graph.size() - graph.submaps.size());
    if (submap < 0) continue;
    const auto terms =
        graph.submaps.term_start[at(submap) + 1] - graph.submaps.term_start[at(submap)];
    if (terms != static_cast<std::int64_t>(clique.size()) - 1)
      return true;  // a variable that is a term twice
  }
  return false;
}

/// The local maps of a leaf from its measurements: solved where a variable is measured more than
/// once.
template <int D>
std::vector<Started<D>> local_maps(const MeasurementGraph<D>& graph,
                                   std::span<const std::int64_t> observations, SummaryDesk& desk) {
  std::vector<Piece<D>> pieces =
      place(graph.variables, leaf_pieces(graph, observations, desk.places), desk.places);
  std::vector<Started<D>> out;
  for (Piece<D>& piece : pieces) {
    Started<D> map;
    const ObservationList<D> list(graph, piece, desk.places);
    map.start = start_of(list, piece);
    if (redundant(list)) {
      ObservationSystem<D> system(graph, piece, {}, desk.places);
      refine(graph, piece, system, desk.cholesky, desk.alone, kMostLeafSolves, kLeafTolerance, {});
    }
    map.summary.information = list.information(piece);
    map.summary.piece = std::move(piece);
    out.push_back(std::move(map));
  }
  return out;
}

template <int D>
class SummaryWalk {
 public:
  using Leaf = std::function<std::vector<Started<D>>(int leaf, SummaryDesk& desk)>;

  SummaryWalk(const VariableSet<D>& all, const JoinTree& tree, Leaf leaf,
              const JoinOptions& options, WorkerPool& pool)
      : all_(all), tree_(tree), leaf_(std::move(leaf)), options_(options), pool_(pool) {
    for (int t = 0; t < pool.threads(); ++t)
      desks_.push_back(std::make_unique<SummaryDesk>(all_.size()));
    results_.resize(at(tree.nodes()));
  }

  std::vector<Started<D>> run() {
    walk_tree(tree_, pool_, options_.progress,
              [&](int node, int thread, bool) { do_node(node, *desks_[at(thread)]); });
    return std::move(results_.back());
  }

 private:
  void do_node(int node, SummaryDesk& desk) {
    std::vector<Started<D>>& result = results_[at(node)];
    if (node < tree_.leaves()) {
      result = leaf_(node, desk);
      return;
    }
    for (const std::int32_t child : tree_.children_of(node)) {
      for (Started<D>& map : results_[at(child)]) result.push_back(std::move(map));
      results_[at(child)] = {};
    }
    const bool root = node + 1 == tree_.nodes();
    if (options_.mode == Mode::kPaper) {
      join_pairs(result, root);
    } else {
      join_group(result, desk, root);
    }
  }

  /// As published, two at a time in the given order: at poses; and where there are none, at points
  /// (section 7). Maps that share neither stay side by side.
  void join_pairs(std::vector<Started<D>>& maps, bool root) const {
    join_pairs(maps, [&](const Started<D>& first, const Started<D>& second) -> Anchor<D> {
      const int pose = common_pose(all_, first, second);
      return pose < 0 ? Anchor<D>() : pose_anchor<D>(all_.key(pose));
    });
    join_pairs(maps, [&](Started<D>& first, const Started<D>& second) -> Anchor<D> {
      // Those with poses wait for the map that links these, as long as one may come.
      if (!root && has_pose(all_, first.summary.piece) && has_pose(all_, second.summary.piece))
        return {};
      const Summary<D>* const both[2] = {&first.summary, &second.summary};
      const auto chosen = common_points<D>(all_, both);
      if (!chosen) return {};
      first.frames.add(*chosen);
      return chosen->anchor;
    });
  }

  template <class Common>
  void join_pairs(std::vector<Started<D>>& maps, const Common& common) const {
    for (std::size_t a = 0; a < maps.size(); ++a) {
      for (std::size_t b = a + 1; b < maps.size(); ++b) {
        const Anchor<D> anchor = common(maps[a], maps[b]);
        if (anchor.kind == nullptr) continue;
        maps[a].summary =
            join_as_published(all_, std::move(maps[a].summary), std::move(maps[b].summary), anchor,
                              options_.strategy == Strategy::kDivideAndConquer);
        maps[a].frames.add(maps[b].frames);
        maps.erase(maps.begin() + static_cast<std::ptrdiff_t>(b));
        b = a;  // the grown map may share with one passed over
      }
    }
  }

  void join_group(std::vector<Started<D>>& maps, SummaryDesk& desk, bool root) const {
    std::vector<Summary<D>> summaries;
    for (Started<D>& map : maps) summaries.push_back(std::move(map.summary));
    maps.clear();
    const int solves = root ? std::max(1, options_.root_solves) : 1;
    for (Summary<D>& joined : join_summaries(all_, std::move(summaries), solves, desk.places)) {
      maps.push_back({std::move(joined)});
    }
  }

  const VariableSet<D>& all_;
  const JoinTree& tree_;
  Leaf leaf_;
  const JoinOptions& options_;
  WorkerPool& pool_;
  std::vector<std::unique_ptr<SummaryDesk>> desks_;
  std::vector<std::vector<Started<D>>> results_;
};

template <int D>
JoinTree summary_tree(const MeasurementGraph<D>& graph, std::span<const Key> order,
                      const JoinOptions& options) {
  if (options.mode == Mode::kSummary && options.tree == TreeShape::kGraph &&
      options.strategy == Strategy::kDivideAndConquer) {
    return graph_tree(graph, leaf_of(options), arity_of(options));
  }
  const auto maps = local_maps_of(graph, order);
  return options.strategy == Strategy::kSequential ? sequential_tree(maps)
                                                   : divide_and_conquer_tree(maps);
}

/// The observations that lie within a piece.
template <int D>
void collect_observations(const CliqueList& all, Piece<D>& piece, Places& places) {
  places.mark(piece.variables);
  piece.observations.clear();
  for (std::size_t k = 0; k < all.size(); ++k) {
    const auto begin = all.variables.begin() + all.start[k];
    const auto end = all.variables.begin() + all.start[k + 1];
    if (std::all_of(begin, end, [&](std::int32_t v) { return places[v] >= 0; })) {
      piece.observations.push_back(static_cast<std::int64_t>(k));
    }
  }
  places.clear(piece.variables);
}

/// A map without poses stays in the frame it was solved in. One that was not solved in any is as
/// good in all.
template <int D>
Map<D> without_pose(Map<D> map, const Anchor<D>& solved_in, JoinReport& report) {
  if (solved_in.kind == nullptr) {
    map = into_points(std::move(map), report);
    map.solved_in = map.anchor;
    return map;
  }
  report.notes.push_back(fmt::format("the piece of {} has no pose: it is in the frame of {}",
                                     to_string(map.variables().key(0)), to_string(solved_in)));
  map = change_frame(std::move(map), solved_in);
  map.solved_in = solved_in;
  return map;
}

template <int D>
std::string note_of(const PointFrames<D>& frames) {
  return fmt::format(
      "{} {} in the frame of common points, chosen to be far apart; the distances of {} are the "
      "least certain, at {:.0f} standard deviations",
      frames.count, frames.count == 1 ? "join" : "joins", to_string(frames.worst.anchor),
      frames.worst.certainty);
}

/// The joined summaries as maps, judged by the observations of `graph`: in the frames of their
/// lowest poses; where they have none, of the points they were solved in the frame of, or of
/// others.
template <int D>
JoinResult<D> finish(const MeasurementGraph<D>& graph, std::vector<Started<D>> joined) {
  JoinResult<D> result;
  JoinReport& report = result.report;
  count_variables(graph, report);
  Places places(graph.variables.size());
  const CliqueList all = cliques(graph);
  for (Started<D>& map : joined) {
    Summary<D>& summary = map.summary;
    const Anchor<D> anchor = lowest_pose_anchor(graph.variables, summary.piece);
    if (!anchor.keys.empty()) {
      const int place = summary.piece.column_start[at(graph.variables.find_column(Tag("pose")))];
      auto* const pose =
          reinterpret_cast<Rigid<D>*>(value_of(graph.variables, summary.piece, place));
      move(graph.variables, summary, motion_into(*pose));
      *pose = Rigid<D>::identity();
    }
    collect_observations(all, summary.piece, places);
    report.chi2 += ObservationList<D>(graph, summary.piece, places).chi2(summary.piece);
    Map<D> out;
    out.values = to_values(graph.variables, summary.piece);
    out.information = std::move(summary.information);
    out.anchor = anchor;
    out.solved_in = anchor;
    if (anchor.keys.empty()) out = without_pose(std::move(out), summary.solved_in, report);
    if (map.frames.count > 0) report.notes.push_back(note_of(map.frames));
    result.maps.push_back(std::move(out));
  }
  report.chi2_linear = report.chi2;
  report.components = static_cast<int>(result.maps.size());
  std::sort(result.maps.begin(), result.maps.end(), lower_map_first<D>);
  return result;
}

/// What a map without poses was solved in the frame of.
template <int D>
Anchor<D> points_solved_in(const Map<D>& map) {
  return map.variables().find_column(Tag("pose")) < 0 ? map.solved_in : Anchor<D>();
}

}  // namespace

template <int D>
JoinResult<D> join_by_summaries(const MeasurementGraph<D>& graph, std::span<const Key> order,
                                const JoinOptions& options) {
  const auto start = Clock::now();
  const SingleThreadedBlas blas;
  const std::shared_ptr<WorkerPool> workers = workers_of(options);
  WorkerPool& pool = *workers;
  const JoinTree tree = summary_tree(graph, order, options);
  const auto leaf = [&](int node, SummaryDesk& desk) {
    return local_maps(graph, tree.leaf(node), desk);
  };
  JoinResult<D> result =
      finish(graph, SummaryWalk<D>(graph.variables, tree, leaf, options, pool).run());
  result.report.joins = tree.joins();
  result.report.seconds = seconds_since(start);
  return result;
}

template <int D>
JoinResult<D> join_by_summaries(std::span<const Map<D>> maps, const MeasurementGraph<D>& links,
                                const JoinOptions& options) {
  const auto start = Clock::now();
  const SingleThreadedBlas blas;
  const std::shared_ptr<WorkerPool> workers = workers_of(options);
  WorkerPool& pool = *workers;
  MeasurementGraphBuilder<D>
      builder;  // what the result is judged by: each map as one observation, and the links
  for (const Map<D>& map : maps) builder.add(as_local_map(map));
  builder.add(links);
  const MeasurementGraph<D> graph = std::move(builder).build();
  const auto stars = local_maps_of(links);
  std::vector<std::vector<std::int64_t>> leaves(maps.size() + stars.size());
  const bool wide = options.mode == Mode::kSummary && options.tree == TreeShape::kGraph;
  const JoinTree tree = options.strategy == Strategy::kSequential
                            ? sequential_tree(leaves)
                            : divide_and_conquer_tree(leaves, wide ? arity_of(options) : 2);
  const auto leaf = [&](int node, SummaryDesk& desk) -> std::vector<Started<D>> {
    if (at(node) < maps.size()) {
      const Map<D>& map = maps[at(node)];
      Started<D> out{
          {to_piece(graph.variables, map.values), map.information, points_solved_in(map)}, -1};
      if (is_pose_anchor(map.anchor))
        out.start = graph.variables.find(map.anchor.keys[0]).value_or(-1);
      return {std::move(out)};
    }
    std::vector<Started<D>> out = local_maps(links, stars[at(node) - maps.size()], desk);
    for (Started<D>& star : out) {  // from the numbers of the links to those of all
      if (star.start >= 0) star.start = *graph.variables.find(links.variables.key(star.start));
      star.summary.piece =
          to_piece(graph.variables, to_values(links.variables, star.summary.piece));
    }
    return out;
  };
  JoinResult<D> result =
      finish(graph, SummaryWalk<D>(graph.variables, tree, leaf, options, pool).run());
  result.report.joins = tree.joins();
  result.report.seconds = seconds_since(start);
  return result;
}

#define MAPJOIN_INSTANTIATE(D)                                                                     \
  template JoinResult<D> join_by_summaries<D>(const MeasurementGraph<D>&, std::span<const Key>,    \
                                              const JoinOptions&);                                 \
  template JoinResult<D> join_by_summaries<D>(std::span<const Map<D>>, const MeasurementGraph<D>&, \
                                              const JoinOptions&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
