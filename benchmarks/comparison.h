#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "benchmarks/measure.h"
#include "benchmarks/problem.h"

namespace mapjoin::benchmarks {

struct ComparisonOptions {
  std::vector<int> threads = {1, 2};
  int repeat = 5;
  int between = 2;     ///< rounds of the joins alone after each round, values alone
  double round = 0.2;  ///< seconds a round; who takes less runs as often as fits into them
  double slow = 5.0;   ///< seconds; what takes longer is run once
  bool ceres = true;
  double ceres_limit = 60.0;  ///< seconds after which Ceres is stopped
};

/// Everybody's figures with one number of threads.
struct ThreadFigures {
  int threads = 1;
  Contender join;                       ///< to the optimum, values alone
  Contender with_information;           ///< the same and the information matrix of the result
  std::vector<Contender> side_by_side;  ///< as many joins at once, of one thread each; none of one
  std::vector<Contender>
      cholmod;                   ///< one factorisation; each variant, with one thread and with all
  std::vector<Contender> ceres;  ///< one, or none where it was not run

  /// The fastest of CHOLMOD's variants.
  const Contender& once() const;
  /// Seconds to the optimum over those of one factorisation.
  double ratio() const { return join.seconds() / once().seconds(); }
  /// The same in processor seconds, which a busy machine disturbs less.
  double cpu_ratio() const;
  /// Times as fast as with one thread.
  double speed_up(const ThreadFigures& one) const { return times_as_fast(join, one.join); }
  /// How many times the work of one thread the processors do when nobody waits for anybody: at most
  /// the number of threads, less where they share a core, caches, memory or a host with others.
  double machine_speed_up(const ThreadFigures& one) const;
};

/// What one data set gave.
struct Comparison {
  std::string name;
  bool local_maps = false;
  int dimension = 2;
  std::int64_t poses = 0, features = 0, observations = 0;
  double factor_rows = 0.0;  ///< unknowns, the held pose's not counted

  double chi2 = 0.0;         ///< of mapjoin's result, evaluated anew
  double optimum = 0.0;      ///< what it is held against
  std::string optimum_from;  ///< "reference", "refinement from the truth", "tightest ..."
  int refine_solves = 0, joins = 0, redone_joins = 0;
  double ceres_chi2 = 0.0;
  int ceres_iterations = 0;
  std::string why_not_ceres;  ///< empty where it was run

  std::vector<ThreadFigures> threads;

  double error() const { return (chi2 - optimum) / optimum; }  ///< relative
  bool reached() const;                                        ///< within kTolerance
  bool ceres_reached() const;
};

/// Of chi2, relative: what counts as the optimum.
inline constexpr double kTolerance = 1e-6;

/// The linear system of the last step of any solver: the final information with one pose held.
struct FinalSystem {
  Eigen::SparseMatrix<double> lower;
  Eigen::VectorXd b;
};

/// One problem and everybody who solves it. Does not move: they refer to it.
class ComparisonRace {
 public:
  /// Runs everybody once. \throws InputError when the data fall into several pieces: there is no
  /// one factorisation to compare with.
  ComparisonRace(AnyProblem problem, const ComparisonOptions& options);
  ComparisonRace(const ComparisonRace&) = delete;
  ComparisonRace& operator=(const ComparisonRace&) = delete;

  void run_round() { race_->run_round(); }
  /// Joins alone, those on one thread and on more: they are quick, and how many times as fast one
  /// is as the other is what a shared machine disturbs most.
  void run_between() { race_->run_between(); }
  Comparison finish() &&;

 private:
  template <int D>
  void enter(const Problem<D>& problem);

  AnyProblem problem_;
  ComparisonOptions options_;
  FinalSystem system_;
  Comparison out_;                  // Ceres writes down where it ends
  std::vector<std::size_t> sizes_;  // of groups of contenders
  std::optional<Race> race_;
};

}  // namespace mapjoin::benchmarks
