#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "mapjoin/io/information_policy.h"

namespace mapjoin::detail {

/// Entries of the state with equal ids.
struct Run {
  std::int64_t id = 0;  ///< negative: a pose, in a set that tells poses from features
  int first = 0;
  int length = 0;
  std::int64_t line = 0;  ///< where it begins in the file
};

/// A local map as it stands in a file, before anyone knows whether it is 2D or 3D.
struct RawMap {
  std::string file;
  bool matlab = false;
  std::int64_t reference = 0;
  std::vector<Run> runs;
  std::vector<double> state;
  Eigen::MatrixXd information;
  std::int64_t matrix_line = 0;

  /// "localmap_3.txt:17", "localmap_3.mat: row 16 of localmap_st".
  std::string where(std::int64_t line) const;
  /// Adds an entry of the state.
  void add(std::int64_t id, double value, std::int64_t line);
};

/// The largest difference of two entries that should be equal, relative to what they are a part of.
inline constexpr double kAsymmetry = 1e-6;
bool asymmetric(const Eigen::MatrixXd& matrix, int i, int j);

/// A localmap_K.txt. \throws InputError with file and line; FileError.
RawMap read_raw_text(const std::filesystem::path& path);

/// A localmap_K.mat: `localmap_st` (n x 2: id, value; id 0 is the pose where the map ends) and
/// `localmap_P` (n x n: covariance). It starts at pose K - 1 and ends at pose K. `repaired` counts
/// covariance matrices that the policy changed. \throws InputError that names the file and the
/// variable, or that says how to build with matio; FileError.
RawMap read_raw_matlab(const std::filesystem::path& path, std::int64_t number,
                       InformationPolicy indefinite, std::int64_t& repaired);

}  // namespace mapjoin::detail
