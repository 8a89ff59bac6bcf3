#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "mapjoin/graph/map.h"
#include "mapjoin/solvers/worker_pool.h"

namespace mapjoin {

/// What a join carries on to the next.
enum class Mode {
  /// As published: pairs in index order, one common pose, joined information completed exactly (in
  /// sequential joining the sparse sum: exact completion would make it dense).
  kPaper,
  kSummary,  ///< a map is (values, information) and nothing else: for sharing, privacy, bandwidth,
             ///< life-long mapping
  kObserve,  ///< maps keep their measurements; one linear solve a join, two at the root
  kOptimal   ///< observe, then refine to the nonlinear least squares optimum over all measurements
};

/// Which maps are joined with which.
enum class TreeShape {
  kGraph,  ///< from the graph's structure: when order means nothing, and for speed
  kOrder   ///< neighbours by index
};

enum class Strategy {
  kDivideAndConquer,  ///< Linear SLAM section 5.2
  kSequential         ///< section 5.1: each map onto all before it
};

/// Where a long run is.
struct Progress {
  std::string_view phase;  ///< "join" or "refine"
  double fraction = 0.0;   ///< of the phase, 0 to 1
};

/// Called now and then from the thread that called the library; return false to stop with
/// CancelledError.
using ProgressCallback = std::function<bool(const Progress&)>;

/// Of chi2: what refinement may leave above the minimum, by its estimate, where nobody asks for
/// another figure. Less than 1e-6 then: what is left was at most 2.7 times the estimate.
inline constexpr double kRefineTolerance = 3e-7;
/// The most that can be asked for: farther from the minimum the estimate of what is left is none.
inline constexpr double kMostRefineTolerance = 1e-3;

struct JoinOptions {
  Mode mode = Mode::kOptimal;
  TreeShape tree = TreeShape::kGraph;
  Strategy strategy = Strategy::kDivideAndConquer;
  int threads = 1;  ///< results are the same bits for any number
  /// Threads that live on between calls, for programs that join small maps often: to start and end
  /// threads takes as long as a join of a hundred poses. Used by one call at a time; in place of
  /// `threads`. Empty: each call has its own.
  std::shared_ptr<WorkerPool> workers;
  int leaf_variables = 0;  ///< variables a leaf of the graph tree holds, about; 0: the mode's own
                           ///< (summary 32, observe and optimal 64)
  int arity = 0;           ///< maps joined at once in the graph tree; 0: the mode's own (summary
                           ///< 4, observe and optimal 32, and above that 1024)
  int root_solves = 0;     ///< linear solves at the root; 0: the mode's own (paper and summary 1,
                           ///< observe and optimal 2)
  int max_refine_solves = 100;
  /// Optimal mode: refinement ends when no more than this fraction of chi2 is left above its
  /// minimum, by an estimate; 0 to kMostRefineTolerance.
  double refine_tolerance = kRefineTolerance;
  bool information = true;  ///< also compute the information matrix of the result
  ProgressCallback progress;

  /// Bytes of memory that the process is to stay within, 0: no limit. Joins that do not fit (graph
  /// tree, observe and optimal mode) keep factors in files of `scratch`; the result is the same.
  std::int64_t memory_limit = 0;
  std::filesystem::path scratch;  ///< empty: the system's temporary directory
  /// A folder in which finished subtrees are kept (graph tree, observe and optimal mode), so that a
  /// run that was killed is taken up where it was by calling again; empty: none. The result is the
  /// same. remove_checkpoint() when it is no longer needed.
  std::filesystem::path checkpoint;
};

/// How many threads a call has.
inline int threads_of(const JoinOptions& options) {
  return options.workers ? options.workers->threads() : options.threads;
}
/// The threads of a call: those of the options, or new ones.
inline std::shared_ptr<WorkerPool> workers_of(const JoinOptions& options) {
  return options.workers ? options.workers : std::make_shared<WorkerPool>(options.threads);
}

/// What a run did.
struct JoinReport {
  double chi2 = 0.0;         ///< over all measurements, at the result
  double chi2_linear = 0.0;  ///< after the linear part: before refinement
  int solves_per_join = 1;
  int root_solves = 1;
  int refine_solves = 0;  ///< linear solves of the refinement
  int joins = 0;
  int redone_joins = 0;   ///< joins that a safeguard solved once more or in smaller steps
  int resumed_joins = 0;  ///< joins that were found in the checkpoint
  bool minimum = true;    ///< optimal mode: the end is a minimum, to refine_tolerance
  std::int64_t poses = 0;
  std::int64_t features = 0;  ///< variables that are no poses
  std::int64_t observations = 0;
  int components = 1;
  double seconds = 0.0;            ///< all of it
  double seconds_refine = 0.0;     ///< of which refinement
  std::vector<std::string> notes;  ///< what a user should know, in sentences
};

/// The joined maps, one for each rigid piece, each in the frame of its lowest pose (or of points,
/// where it has no pose) and ordered by the anchor; and a report.
template <int D>
struct JoinResult {
  std::vector<Map<D>> maps;
  JoinReport report;
};

}  // namespace mapjoin
