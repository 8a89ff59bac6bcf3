// Random symmetric positive definite systems given by cliques, and their dense twins.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <cstdint>
#include <numeric>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "mapjoin/solvers/frontal_cholesky.h"

namespace mapjoin::testing_support {

// A least-squares problem of random measurements: each clique adds J'J and J'r, J random with
// `rows` rows.
class CliqueProblem {
 public:
  explicit CliqueProblem(std::vector<std::int32_t> dims, unsigned seed = 1)
      : dims_(std::move(dims)), random_(seed) {
    offset_.resize(dims_.size() + 1, 0);
    std::inclusive_scan(dims_.begin(), dims_.end(), offset_.begin() + 1);
  }

  void add(std::vector<std::int32_t> clique, int rows) {
    int columns = 0;
    for (const auto v : clique) columns += dims_[v];
    Eigen::MatrixXd jacobian(rows, columns);
    for (double& value : jacobian.reshaped()) value = normal_(random_);
    Eigen::VectorXd residual(rows);
    for (double& value : residual) value = normal_(random_);
    add(std::move(clique), jacobian.transpose() * jacobian, jacobian.transpose() * residual);
  }

  void add(std::vector<std::int32_t> clique, Eigen::MatrixXd information, Eigen::VectorXd vector) {
    vars_.insert(vars_.end(), clique.begin(), clique.end());
    start_.push_back(static_cast<std::int64_t>(vars_.size()));
    information_.push_back(std::move(information));
    vector_.push_back(std::move(vector));
  }

  // A clique that determines all of its variables by itself.
  void add_full(std::vector<std::int32_t> clique) {
    int columns = 0;
    for (const auto v : clique) columns += dims_[v];
    add(std::move(clique), columns + 1);
  }

  const std::vector<std::int32_t>& dims() const { return dims_; }
  Cliques cliques() const { return {start_, vars_}; }
  int scalars() const { return offset_.back(); }
  int offset(std::int32_t v) const { return offset_[v]; }

  template <class Body>  // body(k, i, j, first scalar of i in the clique, of j)
  void for_each_block(std::int64_t k, Body&& body) const {
    const auto clique = cliques()[k];
    for (std::size_t i = 0, row = 0; i < clique.size(); row += dims_[clique[i++]]) {
      for (std::size_t j = 0, col = 0; j <= i; col += dims_[clique[j++]]) body(i, j, row, col);
    }
  }

  auto assembler(const FrontalStructure& structure) const {
    return [this, &structure](std::int32_t front, const FrontView& view) {
      for (const std::int64_t k : structure.owned_by(front)) {
        const auto at = structure.clique_rows(k);
        const auto clique = cliques()[k];
        for_each_block(k, [&](std::size_t i, std::size_t j, std::size_t row, std::size_t col) {
          const int r = dims_[clique[i]];
          const int c = dims_[clique[j]];
          view.add(at[i], at[j], information_[k].block(row, col, r, c));
          if (i == j) view.add_rhs(at[i], vector_[k].segment(row, r));
        });
      }
    };
  }

  // The right-hand side alone, for FrontalCholesky::eliminate.
  auto rhs_assembler(const FrontalStructure& structure) const {
    return [this, &structure](std::int32_t front, double* rhs, double* /*room*/) {
      for (const std::int64_t k : structure.owned_by(front)) {
        const auto at = structure.clique_rows(k);
        const auto clique = cliques()[k];
        Eigen::Index row = 0;
        for (std::size_t i = 0; i < clique.size(); ++i) {
          for (int c = 0; c < dims_[clique[i]]; ++c) rhs[at[i] + c] += vector_[k][row++];
        }
      }
    };
  }

  Eigen::MatrixXd dense() const {
    Eigen::MatrixXd h = Eigen::MatrixXd::Zero(scalars(), scalars());
    for (std::int64_t k = 0; k < cliques().size(); ++k) {
      const auto clique = cliques()[k];
      for_each_block(k, [&](std::size_t i, std::size_t j, std::size_t row, std::size_t col) {
        const int r = dims_[clique[i]];
        const int c = dims_[clique[j]];
        const Eigen::MatrixXd block = information_[k].block(row, col, r, c);
        h.block(offset(clique[i]), offset(clique[j]), r, c) += block;
        if (i != j) h.block(offset(clique[j]), offset(clique[i]), c, r) += block.transpose();
      });
    }
    return h;
  }

  Eigen::VectorXd dense_rhs() const {
    Eigen::VectorXd b = Eigen::VectorXd::Zero(scalars());
    for (std::int64_t k = 0; k < cliques().size(); ++k) {
      std::size_t row = 0;
      for (const auto v : cliques()[k]) {
        b.segment(offset(v), dims_[v]) += vector_[k].segment(row, dims_[v]);
        row += dims_[v];
      }
    }
    return b;
  }

  std::mt19937& random() { return random_; }

 private:
  std::vector<std::int32_t> dims_;
  std::vector<std::int32_t> offset_;
  std::vector<std::int64_t> start_ = {0};
  std::vector<std::int32_t> vars_;
  std::vector<Eigen::MatrixXd> information_;
  std::vector<Eigen::VectorXd> vector_;
  std::mt19937 random_;
  std::normal_distribution<double> normal_;
};

inline std::vector<std::int32_t> random_dims(int variables, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<std::int32_t> dims(variables);
  for (auto& dim : dims) dim = std::uniform_int_distribution<>(1, 9)(random);
  return dims;
}

// `cliques` cliques of 1 to 6 different variables; variables close in number meet more often, so
// there is some sparsity.
inline CliqueProblem random_problem(int variables, int cliques, unsigned seed,
                                    std::vector<std::int32_t> dims = {}) {
  if (dims.empty()) dims = random_dims(variables, seed);
  CliqueProblem problem(dims, seed);
  std::mt19937& random = problem.random();
  for (int v = 0; v < variables; ++v) problem.add_full({v});
  for (int k = 0; k < cliques; ++k) {
    const int size = std::uniform_int_distribution<>(1, std::min(6, variables))(random);
    const int center = std::uniform_int_distribution<>(0, variables - 1)(random);
    const int reach = std::uniform_int_distribution<>(0, 9)(random) == 0 ? variables : 10;
    std::set<std::int32_t> chosen = {center};
    while (static_cast<int>(chosen.size()) < size) {
      const int v = center + std::uniform_int_distribution<>(-reach, reach)(random);
      chosen.insert(((v % variables) + variables) % variables);
    }
    std::vector<std::int32_t> clique(chosen.begin(), chosen.end());
    std::shuffle(clique.begin(), clique.end(), random);
    problem.add(clique, 4);
  }
  return problem;
}

// rows x columns variables of dimension `dim` with a measurement to the right and down.
inline CliqueProblem grid_problem(int rows, int columns, int dim, unsigned seed = 1) {
  CliqueProblem problem(std::vector<std::int32_t>(static_cast<std::size_t>(rows) * columns, dim),
                        seed);
  problem.add_full({0});
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      const int v = r * columns + c;
      if (c + 1 < columns) problem.add({v, v + 1}, dim);
      if (r + 1 < rows) problem.add({v, v + columns}, dim);
    }
  }
  return problem;
}

inline BlockGraph graph_of(const CliqueProblem& problem) {
  return block_graph(static_cast<std::int32_t>(problem.dims().size()), problem.cliques());
}

inline FrontalStructure analyze(const CliqueProblem& problem, const OrderingOptions& ordering = {},
                                const MergingOptions& merging = {}) {
  return mapjoin::analyze(problem.dims(), problem.cliques(),
                          order_blocks(problem.dims(), problem.cliques(), ordering), merging);
}

}  // namespace mapjoin::testing_support
