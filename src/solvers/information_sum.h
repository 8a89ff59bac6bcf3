#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

namespace mapjoin {

/// I = the sum over cliques, i likewise: small dense matrices and vectors over a few variables
/// each, in flat arrays. Variables are numbered in the order of arrival.
struct InformationSum {
  std::vector<std::int32_t> dims;       ///< per variable
  std::vector<std::int32_t> offset{0};  ///< per variable: its first scalar; and their number
  std::vector<std::int64_t> clique_start{0};
  std::vector<std::int32_t> variables;
  std::vector<std::int64_t> number_start{0};
  std::vector<double> numbers;  ///< per clique: n x n (lower triangle, column-major), then n

  int size() const { return static_cast<int>(dims.size()); }
  int scalars() const { return offset.back(); }
  std::int64_t cliques() const { return static_cast<std::int64_t>(clique_start.size()) - 1; }
  std::span<const std::int32_t> clique(std::int64_t k) const;
  /// Number of scalars of clique k.
  int rows(std::int64_t k) const;
  Eigen::Map<const Eigen::MatrixXd> matrix(std::int64_t k) const;
  Eigen::Map<const Eigen::VectorXd> vector(std::int64_t k) const;

  void add_variable(int dim);
  void add_clique(std::span<const std::int32_t> members, const Eigen::MatrixXd& lower,
                  const Eigen::VectorXd& vector);
  /// Forgets the cliques, keeps the variables.
  void clear();

  /// i, all of it.
  Eigen::VectorXd information_vector() const;
};

}  // namespace mapjoin
