#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace mapjoin {

/// How the state of an information filter is ordered, and when anew (SLSJF, section III-F).
enum class FilterOrdering {
  /// What is near the current pose stands at the bottom, by distance, the rest above it in a
  /// minimum
  /// degree order. As long as a local map looks at the bottom only, the order stays and the bottom
  /// alone is factored (III-G).
  kCombined,
  /// Minimum degree for all, anew every `reorder_every` local maps, and factored whole at each:
  /// what
  /// the paper compares with in its Fig. 3(f).
  kMinimumDegree
};

/// How the state is recovered from information vector and matrix.
enum class FilterRecovery {
  kCholesky,           ///< with the factor (SLSJF III-H)
  kConjugateGradients  ///< iterated from the estimate before, preconditioned by an incomplete
                       ///< factor (D-SLAM map joining, section V-C)
};

struct FilterOptions {
  FilterOrdering ordering = FilterOrdering::kCombined;
  FilterRecovery recovery = FilterRecovery::kCholesky;

  /// Scalars from the bottom of the state within which a local map's variables have to be for the
  /// order to stay. 0: the paper's rule of thumb, a tenth of the state; but never less than
  /// 200 or what five local maps hold, nor more than 400 beyond that (as in its experiment): the
  /// bottom is dense.
  int n0 = 0;
  /// Metres around the current pose within which variables go to the bottom when it is ordered
  /// anew. 0: the rule of thumb, as many as fill half of n0.
  double d0 = 0.0;
  int reorder_every = 5;    ///< local maps; kMinimumDegree only
  bool incremental = true;  ///< false: factor everything at each local map, to compare

  /// Linearise all local maps anew at every so many fusions, where the estimate is then (V-G): I
  /// and i are summed up again. 0: never, as published. Needs the local maps, which are then kept.
  int relinearise_every = 0;
};

/// What fusing one local map took.
struct Fusion {
  bool reordered = false;
  bool factored_whole = false;
  bool relinearised = false;
  int scalars = 0;                 ///< of the state afterwards
  int changed = 0;                 ///< scalars from the highest changed row of the bottom down
  int iterations = 0;              ///< of conjugate gradients
  double seconds_update = 0.0;     ///< initialising what is new, linearising, adding information
  double seconds_order = 0.0;      ///< deciding, and ordering
  double seconds_factor = 0.0;     ///< Cholesky, whole or of the bottom
  double seconds_recover = 0.0;    ///< solving for the estimate
  double seconds_associate = 0.0;  ///< of the caller's data association
  void add_seconds(const Fusion& other) {
    seconds_update += other.seconds_update;
    seconds_order += other.seconds_order;
    seconds_factor += other.seconds_factor;
    seconds_recover += other.seconds_recover;
    seconds_associate += other.seconds_associate;
  }
  double seconds() const {
    return seconds_update + seconds_order + seconds_factor + seconds_recover + seconds_associate;
  }
};

}  // namespace mapjoin
