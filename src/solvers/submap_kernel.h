#pragma once

#include <span>
#include <vector>

#include "mapjoin/graph/measurement_graph.h"

namespace mapjoin {

/// Buffers of linearize_submap, kept between calls.
struct SubmapScratch {
  std::vector<double> numbers;
  std::vector<int> first;     // per term: first scalar within the observation
  std::vector<int> position;  // per term: which of the clique's variables
};

/// Residual, Jacobian and normal equations of one local map as an integrated observation (DESIGN
/// section 3).
///
/// In the anchor's frame at the current estimate, x' = T_a(x)^-1 x, the residual is r = local(X,
/// x') with Jacobian S (E - g(x') C(x')^-1 P) D. `values[i]` is the current value of the i-th
/// variable of the observation's clique and `rows[i]` its first row in the target; the clique lists
/// the anchor's variables first, then those of the terms in order, each once. Adds J^T I J and -J^T
/// I r to the target; a null target only computes. \returns r^T I r. Cost: O(blocks of the
/// observation's information).
template <int D>
double linearize_submap(const MeasurementGraph<D>& graph, std::size_t observation,
                        const double* const* values, std::span<const std::int32_t> rows,
                        const DenseTarget* target, SubmapScratch& scratch);

}  // namespace mapjoin
