#include "mapjoin/io/information_policy.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>

#include "mapjoin/graph/error.h"
#include "mapjoin/graph/rotation.h"
#include "mapjoin/graph/symmetric.h"

namespace mapjoin {

namespace {

constexpr double kTolerance = 1e-9;

using Matrix = Eigen::Ref<const Eigen::MatrixXd>;

template <int N>
bool factorizes(const Matrix& information) {
  const Mat<N, N> copy = information;
  return copy.llt().info() == Eigen::Success;
}

bool factorizes_at_any_size(const Matrix& information) {
  switch (information.rows()) {
    case 2:
      return factorizes<2>(information);
    case 3:
      return factorizes<3>(information);
    case 6:
      return factorizes<6>(information);
    default:
      return Eigen::LLT<Eigen::MatrixXd>(information).info() == Eigen::Success;
  }
}

bool is_diagonal(const Matrix& information) {
  for (Eigen::Index j = 0; j < information.cols(); ++j) {
    for (Eigen::Index i = j + 1; i < information.rows(); ++i) {
      if (information(i, j) != 0.0) return false;
    }
  }
  return true;
}

}  // namespace

bool is_positive_semidefinite(const Matrix& information) {
  if (is_diagonal(information)) return (information.diagonal().array() >= 0.0).all();
  if (factorizes_at_any_size(information)) return true;
  const Eigen::VectorXd values = eigenvalues(information);
  return values.minCoeff() >= -kTolerance * values.maxCoeff();
}

double smallest_eigenvalue(const Matrix& information) {
  return eigenvalues(information).minCoeff();
}

void clamp_information(Eigen::Ref<Eigen::MatrixXd> information) {
  const Spectrum found = spectrum(information);
  const double largest = found.values.maxCoeff();
  if (!(largest > 0.0)) {
    throw InputError(
        "an information matrix without a positive eigenvalue cannot be clamped; "
        "remove the measurement");
  }
  const Eigen::VectorXd raised = found.values.cwiseMax(kTolerance * largest);
  const Eigen::MatrixXd& V = found.vectors;
  const Eigen::MatrixXd nearest = V * raised.asDiagonal() * V.transpose();
  information = 0.5 * (nearest + nearest.transpose());
}

void make_information_isotropic(Eigen::Ref<Eigen::MatrixXd> information,
                                std::span<const int> parts) {
  const Eigen::VectorXd diagonal = information.diagonal();
  information.setZero();
  int at = 0;
  for (const int size : parts) {
    const double mean = diagonal.segment(at, size).mean();
    if (mean < 0.0) {
      throw InputError(
          "an information matrix with a negative mean on its diagonal has no isotropic "
          "equivalent; remove the measurement");
    }
    information.diagonal().segment(at, size).setConstant(mean);
    at += size;
  }
}

void InformationGate::check(Eigen::Ref<Eigen::MatrixXd> information, std::span<const int> parts,
                            const FileLine& where) {
  if (is_positive_semidefinite(information)) return;
  if (found_++ == 0) {
    first_eigenvalue_ = smallest_eigenvalue(information);
    first_where_ = where.text();
  }
  if (policy_ == InformationPolicy::kRefuse) return;
  try {
    if (policy_ == InformationPolicy::kClamp) {
      clamp_information(information);
    } else {
      make_information_isotropic(information, parts);
    }
  } catch (const InputError& error) {
    throw InputError(where.text() + ": " + error.what());
  }
}

void InformationGate::finish(std::string_view whole) const {
  if (policy_ != InformationPolicy::kRefuse || found_ == 0) return;
  throw InputError(
      fmt::format("{}: the information matrix is indefinite (smallest eigenvalue {:.6g}), the "
                  "first of {} in this {}; measurements "
                  "cannot have negative weight: correct them, or choose to clamp them to the "
                  "nearest positive definite "
                  "matrix or to take the isotropic equivalent",
                  first_where_, first_eigenvalue_, found_, whole));
}

}  // namespace mapjoin
