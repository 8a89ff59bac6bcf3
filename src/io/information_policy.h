#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>

#include "mapjoin/io/text_scanner.h"

namespace mapjoin {

/// What a reader does with an information matrix that has a negative eigenvalue, that is, with a
/// measurement that would *reward* residuals. Positive semidefinite is legal: zero information
/// about a direction is a fact, not a fault.
enum class InformationPolicy {
  kRefuse,    ///< InputError: the first such line of the file, its smallest eigenvalue, how many
              ///< there are
  kClamp,     ///< the nearest matrix with all eigenvalues at least 1e-9 of the largest
  kIsotropic  ///< each part (translation, rotation, point) gets the mean of its diagonal; nothing
              ///< couples parts
};

/// True when a symmetric matrix is positive semidefinite up to rounding: no eigenvalue below -1e-9
/// of the largest. Diagonal matrices and positive definite ones are recognised without eigenvalues.
bool is_positive_semidefinite(const Eigen::Ref<const Eigen::MatrixXd>& information);

/// Of a symmetric matrix.
double smallest_eigenvalue(const Eigen::Ref<const Eigen::MatrixXd>& information);

/// Raises all eigenvalues to at least 1e-9 of the largest: the nearest such matrix in the Frobenius
/// norm. \throws InputError when no eigenvalue is positive.
void clamp_information(Eigen::Ref<Eigen::MatrixXd> information);

/// Replaces the matrix by diag(m_1 E, m_2 E, ...), one multiple of the identity for each of the
/// consecutive `parts` (their sizes: 2, 1 for a pose of the plane; 3, 3 for one of space), m being
/// the mean of that part's diagonal. \throws InputError when a mean is negative.
void make_information_isotropic(Eigen::Ref<Eigen::MatrixXd> information,
                                std::span<const int> parts);

/// Applies a policy to the information matrices of one file, one after another.
class InformationGate {
 public:
  explicit InformationGate(InformationPolicy policy) : policy_(policy) {}

  /// Checks one symmetric matrix, and repairs it in place where the policy says so.
  /// \throws InputError when it cannot be repaired.
  void check(Eigen::Ref<Eigen::MatrixXd> information, std::span<const int> parts,
             const FileLine& where);

  /// To be called at the end of the file, or of the set of files; `whole` says which in the
  /// message. \throws InputError when the policy is to refuse and anything was wrong.
  void finish(std::string_view whole = "file") const;

  /// How many matrices were repaired.
  std::int64_t repaired() const { return policy_ == InformationPolicy::kRefuse ? 0 : found_; }

 private:
  InformationPolicy policy_;
  std::int64_t found_ = 0;
  double first_eigenvalue_ = 0.0;
  std::string first_where_;
};

}  // namespace mapjoin
