#include "mapjoin/joining/elimination_join.h"

#include <algorithm>
#include <numeric>
#include <optional>
#include <utility>

#include "mapjoin/graph/index.h"
#include "mapjoin/joining/checkpoint.h"
#include "mapjoin/joining/leaf.h"
#include "mapjoin/joining/memory_limit.h"
#include "mapjoin/joining/place.h"
#include "mapjoin/joining/refine.h"
#include "mapjoin/joining/report.h"
#include "mapjoin/joining/tree_cuts.h"
#include "mapjoin/joining/tree_walk.h"
#include "mapjoin/solvers/pool_loop.h"

namespace mapjoin {

namespace {

/// Safeguards of a join: it is solved again while chi2 ends above this multiple of what the linear
/// model promised.
constexpr double kTrust = 2.0;
constexpr int kMostSolves = 8;
constexpr int kMostHalvings = 10;
constexpr double kNothing = 1e-14;  // of chi2: what an exact fit leaves

// Small subtrees are sooner joined again than read: a checkpoint keeps those of so many variables,
// or of a fraction of all; but what was joined from leaves (the second size) in any case.
constexpr std::int64_t kSmallestFile = 256;
constexpr std::int64_t kFiles = 512;

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
    system_ = std::make_unique<ObservationSystem<D>>(
        graph, everything(graph), std::span<const std::int32_t>(), places, &pool);
    const auto observations = static_cast<std::int64_t>(graph.size());
    const std::vector<std::int64_t> sizes = submap_sizes(options, graph.variables.size());
    worth_a_file_ = std::max(
        kSmallestFile, std::min(sizes[sizes.size() > 1 ? 1 : 0], graph.variables.size() / kFiles));
    cuts_ = cut_tree(system_->structure(), observations, sizes);
    results_.resize(cuts_.size());
    const FactorResidence residence =
        factor_residence(options, system_->statistics(), pool.threads());
    for (int t = 0; t < pool.threads(); ++t)
      desks_.push_back(std::make_unique<Desk>(graph.variables.size(), residence));
    desks_[0]->scratch.cholesky->reserve(system_->structure());  // it will hold the root's
    report_.joins = static_cast<int>(cuts_.size());
    done_.assign(cuts_.size(), 0);
    plan_ = plan_cuts(system_->structure(), cuts_, pool.threads());
    for (const int leaves : plan_.leaves) leaves_.emplace_back(at(leaves));
    if (!options.checkpoint.empty()) resume();
  }

  JoinedPieces<D> run() {
    walk_forest(plan_.forest, plan_.together, pool_, options_.progress,
                [&](int number, int thread, LoopRunner loop) {
                  const CutTask& task = plan_.tasks[at(number)];
                  Desk& desk = *desks_[at(thread)];
                  if (done_[at(task.cut)] != 0) return;
                  if (task.leaf >= 0) {
                    leaves_[at(task.cut)][at(task.leaf)] = lay_out(task, desk);
                  } else if (plan_.together[at(number)] != 0) {
                    do_cut(task, desk, pool_, loop_on(pool_));
                  } else {
                    do_cut(task, desk, desk.alone, loop);
                  }
                });
    for (const auto& desk : desks_) report_.redone_joins += desk->redone;
    JoinedPieces<D> out;
    for (std::size_t c = 0; c < cuts_.size(); ++c) {  // roots only: the others' were taken
      for (Piece<D>& piece : results_[c]) out.pieces.push_back(std::move(piece));
    }
    if (out.pieces.size() > 1)
      out.pieces =
          place(graph_.variables, std::move(out.pieces), desks_[0]->places, loop_on(pool_));
    FrontalCholesky& cholesky = *desks_[0]->scratch.cholesky;
    for (Piece<D>& piece : out.pieces) {
      if (out.pieces.size() == 1 && piece.size() == graph_.variables.size()) {
        if (piece.observations.size() == graph_.size()) {  // so all of them: no need to sort
          std::iota(piece.observations.begin(), piece.observations.end(), std::int64_t{0});
        } else {
          std::sort(piece.observations.begin(), piece.observations.end());
        }
        for (int s = 1; s <= report_.root_solves; ++s) {
          if (s == report_.root_solves && options_.mode == Mode::kOptimal)
            out.last_solve.values = piece.data;
          const auto step = linear_step(graph_, piece, *system_, cholesky, pool_);
          out.last_solve.chi2 = step.chi2;
          out.last_solve.promised = step.predicted_decrease;
        }
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

  /// The local maps of a task's groups.
  std::vector<Piece<D>> lay_out(const CutTask& task, Desk& desk) {
    std::vector<Piece<D>> pieces;
    for (std::size_t g = task.first; g < task.end; ++g) {
      std::vector<std::int64_t>& group = cuts_[at(task.cut)].groups[g];
      std::sort(group.begin(), group.end());
      for (Piece<D>& piece : leaf_pieces(graph_, group, desk.places))
        pieces.push_back(std::move(piece));
    }
    return pieces;
  }

  /// One solve of a join, and with safeguards as many as it takes until the linear model keeps what
  /// it promises.
  bool solve_on_fronts(const Cut& cut, Piece<D>& piece, Desk& desk, WorkerPool& pool,
                       LoopRunner loop) {
    Eigen::VectorXd d;
    const int most = options_.mode == Mode::kOptimal ? kMostSolves : 1;
    for (int solves = 1; solves <= most; ++solves) {
      const auto step = system_->solve_subtree(cut.first, cut.root, piece, desk.places,
                                               desk.scratch, d, pool, loop);
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

  /// By the threads of `pool`, which may be this one alone; then `loop` may have others help.
  void do_cut(const CutTask& task, Desk& desk, WorkerPool& pool, LoopRunner loop) {
    const int number = task.cut;
    const Cut& cut = cuts_[at(number)];
    std::vector<Piece<D>> pieces;
    const auto take = [&](std::vector<Piece<D>> from) {
      for (Piece<D>& piece : from) pieces.push_back(std::move(piece));
    };
    for (const std::int32_t child : cut.children) take(std::exchange(results_[at(child)], {}));
    for (auto& leaf : std::exchange(leaves_[at(number)], {})) take(std::move(leaf));
    take(lay_out(task, desk));
    pieces = place(graph_.variables, std::move(pieces), desk.places, loop);
    if (system_->structure().fronts[at(cut.root)].parent >= 0) {
      const bool whole = pieces.size() == 1;
      for (Piece<D>& piece : pieces) {
        if (whole && solve_on_fronts(cut, piece, desk, pool, loop)) continue;
        ObservationSystem<D> system(graph_, piece, rank(), desk.places);
        linear_step_if_determined(graph_, piece, system, *desk.scratch.cholesky, pool);
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

  bool is_saved(int number) const {
    return checkpoint_ && cuts_[at(number)].variables >= worth_a_file_;
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
  std::int64_t worth_a_file_ = 0;  // variables of a subtree that a checkpoint keeps
  CutPlan plan_;
  std::vector<std::vector<std::vector<Piece<D>>>> leaves_;  // per cut: per leaf task
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
