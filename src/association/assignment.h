#pragma once

#include <Eigen/Core>
#include <vector>

namespace mapjoin {

/// The assignment problem: every row gets a column of its own, with the least sum of costs.
///
/// `cost` has at least as many columns as rows. \returns the column of each row. Shortest
/// augmenting paths with potentials (the Hungarian method), O(rows^2 columns).
std::vector<int> assign(const Eigen::MatrixXd& cost);

}  // namespace mapjoin
