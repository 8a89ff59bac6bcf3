#include "mapjoin/joining/elimination_join.h"

#include <algorithm>
#include <numeric>
#include <optional>

#include "mapjoin/joining/checkpoint.h"
#include "mapjoin/joining/leaf.h"
#include "mapjoin/joining/memory_limit.h"
#include "mapjoin/joining/place.h"
#include "mapjoin/joining/refine.h"
#include "mapjoin/joining/report.h"
#include "mapjoin/joining/tree_walk.h"

namespace mapjoin {

namespace {

std::size_t at(std::int64_t k) { return static_cast<std::size_t>(k); }

/// Safeguards of a join: it is solved again while chi2 ends above this multiple of what the linear
/// model promised.
constexpr double kTrust = 2.0;
constexpr int kMostSolves = 8;
constexpr int kMostHalvings = 10;
constexpr double kNothing = 1e-14;  // of chi2: what an exact fit leaves

constexpr std::int64_t kSmallestFile = 256;  // variables of a subtree that a checkpoint keeps

/// A cut of the elimination tree: the fronts first .. root are a subtree.
struct Cut {
  std::int32_t first = 0;
  std::int32_t root = 0;
  std::int32_t parent = -1;            // the cut that joins this one with others
  std::int64_t variables = 0;          // of the whole subtree
  std::vector<std::int32_t> children;  // cuts below
  std::vector<std::vector<std::int64_t>>
      groups;  // observations of the fronts between, in connected handfuls
};

/// Chooses the cuts of a front structure.
class TreeCutter {
 public:
  TreeCutter(const FrontalStructure& structure, std::int64_t observations, int leaf, int arity)
      : s_(structure), observations_(observations), leaf_(leaf), arity_(arity) {
    const std::size_t fronts = s_.fronts.size();
    variables_.resize(fronts);
    fronts_below_.assign(fronts, 1);
    largest_child_.assign(fronts, 0);
    for (std::size_t f = 0; f < fronts; ++f) {
      variables_[f] += s_.fronts[f].end_position - s_.fronts[f].first_position;
      const std::int32_t parent = s_.fronts[f].parent;
      if (parent < 0) continue;
      variables_[at(parent)] += variables_[f];
      fronts_below_[at(parent)] += fronts_below_[f];
      largest_child_[at(parent)] = std::max(largest_child_[at(parent)], variables_[f]);
    }
  }

  std::vector<Cut> cuts() {
    std::vector<Cut> out;
    std::vector<std::int32_t> open;  // cuts whose parent is yet to come
    for (std::int32_t f = 0; f < static_cast<std::int32_t>(s_.fronts.size()); ++f) {
      if (!is_cut(f)) continue;
      Cut cut;
      cut.root = f;
      cut.variables = variables_[at(f)];
      cut.first = f + 1 - fronts_below_[at(f)];
      while (!open.empty() && out[at(open.back())].root >= cut.first) {
        cut.children.push_back(open.back());
        out[at(open.back())].parent = static_cast<std::int32_t>(out.size());
        open.pop_back();
      }
      std::reverse(cut.children.begin(), cut.children.end());
      gather(cut, out);
      open.push_back(static_cast<std::int32_t>(out.size()));
      out.push_back(std::move(cut));
    }
    return out;
  }

 private:
  /// A root of a tree, or the first front of its path whose subtree reaches one of the sizes.
  bool is_cut(std::int32_t f) const {
    if (s_.fronts[at(f)].parent < 0) return true;
    for (std::int64_t size = leaf_; size <= variables_[at(f)]; size *= arity_) {
      if (largest_child_[at(f)] < size) return true;
    }
    return false;
  }

  void add_owned(std::int32_t front, std::vector<std::int64_t>& group) const {
    for (const std::int64_t k : s_.owned_by(front)) {
      if (k < observations_) group.push_back(k);
    }
  }

  /// Observations of the cut's fronts that no cut below has: small subtrees apart from the path
  /// they hang on.
  void gather(Cut& cut, const std::vector<Cut>& cuts) const {
    std::vector<std::int64_t> path;
    std::int32_t f = cut.root;
    std::size_t below = cut.children.size();
    while (f >= cut.first) {
      if (below > 0 && cuts[at(cut.children[below - 1])].root == f) {
        f = cuts[at(cut.children[--below])].first - 1;
        continue;
      }
      if (f != cut.root && variables_[at(f)] < leaf_ && !cut.children.empty()) {
        std::vector<std::int64_t> group;
        const std::int32_t first = f + 1 - fronts_below_[at(f)];
        for (std::int32_t g = first; g <= f; ++g) add_owned(g, group);
        if (!group.empty()) cut.groups.push_back(std::move(group));
        f = first - 1;
        continue;
      }
      add_owned(f, path);
      --f;
    }
    if (!path.empty()) cut.groups.push_back(std::move(path));
    for (auto& group : cut.groups) std::sort(group.begin(), group.end());
  }

  const FrontalStructure& s_;
  std::int64_t observations_;
  std::int64_t leaf_;
  std::int64_t arity_;
  std::vector<std::int64_t> variables_, largest_child_;
  std::vector<std::int32_t> fronts_below_;
};

template <int D>
Piece<D> everything(const MeasurementGraph<D>& graph) {
  std::vector<int> variables(at(graph.variables.size()));
  std::iota(variables.begin(), variables.end(), 0);
  Piece<D> out = make_piece(graph.variables, std::move(variables));
  out.observations.resize(graph.size());
  std::iota(out.observations.begin(), out.observations.end(), std::int64_t{0});
  return out;
}

template <int D>
class EliminationWalk {
 public:
  EliminationWalk(const MeasurementGraph<D>& graph, const JoinOptions& options, WorkerPool& pool,
                  JoinReport& report)
      : graph_(graph), options_(options), pool_(pool), report_(report) {
    Places places(graph.variables.size());
    system_ = std::make_unique<ObservationSystem<D>>(graph, everything(graph),
                                                     std::span<const std::int32_t>(), places);
    const auto observations = static_cast<std::int64_t>(graph.size());
    cuts_ =
        TreeCutter(system_->structure(), observations, options.leaf_variables, arity_of(options))
            .cuts();
    results_.resize(cuts_.size());
    const FactorResidence residence =
        factor_residence(options, system_->statistics(), pool.threads());
    for (int t = 0; t < pool.threads(); ++t)
      desks_.push_back(std::make_unique<Desk>(graph.variables.size(), residence));
    report_.joins = static_cast<int>(cuts_.size());
    done_.assign(cuts_.size(), 0);
    if (!options.checkpoint.empty()) resume();
  }

  JoinedPieces<D> run() {
    walk_forest(tasks(), pool_, options_.progress, [&](int cut, int thread, LoopRunner loop) {
      do_cut(cut, *desks_[at(thread)], loop);
    });
    for (const auto& desk : desks_) report_.redone_joins += desk->redone;
    JoinedPieces<D> out;
    for (std::size_t c = 0; c < cuts_.size(); ++c) {  // roots only: the others' were taken
      for (Piece<D>& piece : results_[c]) out.pieces.push_back(std::move(piece));
    }
    if (out.pieces.size() > 1)
      out.pieces = place(graph_.variables, std::move(out.pieces), desks_[0]->places);
    FrontalCholesky& cholesky = *desks_[0]->scratch.cholesky;
    for (Piece<D>& piece : out.pieces) {
      if (out.pieces.size() == 1 && piece.size() == graph_.variables.size()) {
        std::sort(piece.observations.begin(), piece.observations.end());
        for (int s = 0; s < report_.root_solves; ++s)
          out.promised = linear_step(graph_, piece, *system_, cholesky, pool_).predicted_decrease;
        out.system = std::move(system_);
        continue;
      }
      ObservationSystem<D> system(graph_, piece, rank(), desks_[0]->places);
      for (int s = 0; s < report_.root_solves; ++s)
        linear_step(graph_, piece, system, cholesky, pool_);
    }
    out.cholesky = std::move(desks_[0]->scratch.cholesky);
    return out;
  }

 private:
  struct Desk {
    Desk(int variables, const FactorResidence& residence)
        : places(variables), scratch(FactorOptions{.residence = residence}) {}
    Places places;
    SubtreeScratch scratch;
    WorkerPool alone;
    int redone = 0;
  };

  std::span<const std::int32_t> rank() const { return system_->structure().position; }

  /// The cuts as work for walk_forest. What a join costs is what its fronts cost, all of them:
  /// those of the cuts below are computed again.
  std::vector<FrontTask> tasks() const {
    const FrontalStructure& structure = system_->structure();
    std::vector<double> cost_before{0.0};  // per front (+ 1)
    for (const Front& front : structure.fronts)
      cost_before.push_back(cost_before.back() +
                            FrontCostModel()(front.pivot_dim, front.update_dim));
    std::vector<FrontTask> out(cuts_.size());
    for (std::size_t c = cuts_.size(); c-- > 0;) {  // parents first
      const Cut& cut = cuts_[c];
      out[c].parent = cut.parent;
      out[c].waits_for = static_cast<std::int32_t>(cut.children.size());
      out[c].path_cost = cost_before[at(cut.root) + 1] - cost_before[at(cut.first)];
      if (cut.parent >= 0) out[c].path_cost += out[at(cut.parent)].path_cost;
    }
    return out;
  }

  /// One solve of a join, and with safeguards as many as it takes until the linear model keeps what
  /// it promises.
  bool solve_on_fronts(const Cut& cut, Piece<D>& piece, Desk& desk, LoopRunner loop) {
    Eigen::VectorXd d;
    const int most = options_.mode == Mode::kOptimal ? kMostSolves : 1;
    for (int solves = 1; solves <= most; ++solves) {
      const auto step =
          system_->solve_subtree(cut.first, cut.root, piece, desk.places, desk.scratch, d, loop);
      if (!step) return solves > 1;
      std::vector<std::vector<double>> before;
      if (most > 1) before = piece.data;
      retract(graph_.variables, piece, std::span<const double>(d.data(), at(d.size())));
      if (most == 1) return true;
      const double promised = step->chi2 - step->predicted_decrease;
      double chi2 =
          system_->subtree_chi2(cut.first, cut.root, piece, desk.places, desk.scratch, loop);
      for (int halving = 0; chi2 > step->chi2 && halving < kMostHalvings; ++halving) {
        d *= 0.5;
        piece.data = before;
        retract(graph_.variables, piece, std::span<const double>(d.data(), at(d.size())));
        chi2 = system_->subtree_chi2(cut.first, cut.root, piece, desk.places, desk.scratch, loop);
      }
      if (chi2 <= kTrust * promised + 1e-9 * step->chi2 + kNothing) return true;
      if (solves == 1) ++desk.redone;
    }
    return true;
  }

  void do_cut(int number, Desk& desk, LoopRunner loop) {
    if (done_[at(number)] != 0) return;
    const Cut& cut = cuts_[at(number)];
    std::vector<Piece<D>> pieces;
    for (const std::int32_t child : cut.children) {
      for (Piece<D>& piece : results_[at(child)]) pieces.push_back(std::move(piece));
      results_[at(child)] = {};
    }
    for (const auto& group : cut.groups) {
      for (Piece<D>& piece : leaf_pieces(graph_, group, desk.places))
        pieces.push_back(std::move(piece));
    }
    pieces = place(graph_.variables, std::move(pieces), desk.places);
    if (system_->structure().fronts[at(cut.root)].parent >= 0) {
      const bool whole = pieces.size() == 1;
      for (Piece<D>& piece : pieces) {
        if (whole && solve_on_fronts(cut, piece, desk, loop)) continue;
        ObservationSystem<D> system(graph_, piece, rank(), desk.places);
        linear_step_if_determined(graph_, piece, system, *desk.scratch.cholesky, desk.alone);
      }
    }
    results_[at(number)] = std::move(pieces);
    if (is_saved(number)) {
      checkpoint_->save(number, results_[at(number)]);
      for (const std::int32_t child : cut.children) {
        if (is_saved(child)) checkpoint_->remove(child);
      }
    }
  }

  /// Small subtrees are sooner joined again than read: a checkpoint holds what is worth a file.
  bool is_saved(int number) const {
    return checkpoint_ && cuts_[at(number)].variables >=
                              std::max<std::int64_t>(kSmallestFile, graph_.variables.size() / 512);
  }

  /// Takes up what a former run has saved: a subtree that is there needs nothing below it.
  void resume() {
    checkpoint_.emplace(options_.checkpoint, fingerprint(graph_, options_));
    std::vector<char> saved(cuts_.size(), 0);
    for (const int node : checkpoint_->saved()) saved.at(at(node)) = 1;
    for (std::size_t c = cuts_.size(); c-- > 0;) {
      if (saved[c] != 0) {
        if (done_[c] == 0) {
          results_[c] = checkpoint_->load(static_cast<int>(c));
        } else {
          checkpoint_->remove(static_cast<int>(c));
        }
        done_[c] = 1;
      }
      if (done_[c] == 0) continue;
      ++report_.resumed_joins;
      for (const std::int32_t child : cuts_[c].children) done_[at(child)] = 1;
    }
  }

  const MeasurementGraph<D>& graph_;
  const JoinOptions& options_;
  WorkerPool& pool_;
  JoinReport& report_;
  std::unique_ptr<ObservationSystem<D>> system_;
  std::vector<Cut> cuts_;
  std::vector<std::vector<Piece<D>>> results_;
  std::vector<std::unique_ptr<Desk>> desks_;
  std::vector<char> done_;  // by a former run, or below what was
  std::optional<Checkpoint<D>> checkpoint_;
};

}  // namespace

template <int D>
JoinedPieces<D> elimination_join(const MeasurementGraph<D>& graph, const JoinOptions& options,
                                 WorkerPool& pool, JoinReport& report) {
  return EliminationWalk<D>(graph, options, pool, report).run();
}

template JoinedPieces<2> elimination_join<2>(const MeasurementGraph<2>&, const JoinOptions&,
                                             WorkerPool&, JoinReport&);
template JoinedPieces<3> elimination_join<3>(const MeasurementGraph<3>&, const JoinOptions&,
                                             WorkerPool&, JoinReport&);

}  // namespace mapjoin
