#include "mapjoin/solvers/information_sum.h"

#include "mapjoin/graph/index.h"

namespace mapjoin {

std::span<const std::int32_t> InformationSum::clique(std::int64_t k) const {
  return std::span(variables).subspan(at(clique_start[at(k)]),
                                      at(clique_start[at(k) + 1] - clique_start[at(k)]));
}

int InformationSum::rows(std::int64_t k) const {
  int n = 0;
  for (const std::int32_t v : clique(k)) n += dims[at(v)];
  return n;
}

Eigen::Map<const Eigen::MatrixXd> InformationSum::matrix(std::int64_t k) const {
  const int n = rows(k);
  return {numbers.data() + number_start[at(k)], n, n};
}

Eigen::Map<const Eigen::VectorXd> InformationSum::vector(std::int64_t k) const {
  const int n = rows(k);
  return {numbers.data() + number_start[at(k)] + static_cast<std::ptrdiff_t>(n) * n, n};
}

void InformationSum::add_variable(int dim) {
  dims.push_back(dim);
  offset.push_back(offset.back() + dim);
}

void InformationSum::add_clique(std::span<const std::int32_t> members, const Eigen::MatrixXd& lower,
                                const Eigen::VectorXd& vector) {
  variables.insert(variables.end(), members.begin(), members.end());
  clique_start.push_back(static_cast<std::int64_t>(variables.size()));
  numbers.insert(numbers.end(), lower.data(), lower.data() + lower.size());
  numbers.insert(numbers.end(), vector.data(), vector.data() + vector.size());
  number_start.push_back(static_cast<std::int64_t>(numbers.size()));
}

void InformationSum::clear() {
  clique_start.resize(1);
  number_start.resize(1);
  variables.clear();
  numbers.clear();
}

Eigen::VectorXd InformationSum::information_vector() const {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(scalars());
  for (std::int64_t k = 0; k < cliques(); ++k) {
    const auto part = vector(k);
    Eigen::Index row = 0;
    for (const std::int32_t v : clique(k)) {
      out.segment(offset[at(v)], dims[at(v)]) += part.segment(row, dims[at(v)]);
      row += dims[at(v)];
    }
  }
  return out;
}

}  // namespace mapjoin
