#include <fmt/format.h>

#include <cmath>
#include <cstring>

#include "mapjoin/graph/dense.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/io/local_map_raw.h"
#include "mapjoin/io/read_file.h"

#ifdef MAPJOIN_HAS_MATIO
#include <matio.h>

#include <memory>
#include <optional>
#endif

namespace mapjoin::detail {

#ifndef MAPJOIN_HAS_MATIO

RawMap read_raw_matlab(const std::filesystem::path& path, std::int64_t /*number*/,
                       InformationPolicy /*indefinite*/, std::int64_t& /*repaired*/) {
  throw InputError(fmt::format(
      "{}: this mapjoin was built without matio and cannot read MATLAB files: build it with "
      "-DMAPJOIN_WITH_MATIO=ON (Debian and Ubuntu: libmatio-dev), or convert the set to text",
      path.string()));
}

#else

namespace {

constexpr std::size_t kHeader = 128;
constexpr std::size_t kVersionAt = 124;
constexpr std::uint32_t kCompressed = 15;
constexpr std::uint32_t kMatrix = 14;

std::uint32_t word_at(const std::string& content, std::size_t at) {
  std::uint32_t word = 0;
  std::memcpy(&word, content.data() + at, sizeof(word));
  return word;
}

/// A level 5 file is a header and elements, each with its size in front: do they fill the file?
/// matio believes sizes, and a file that ends early would give numbers that nobody wrote.
void check_complete(const std::string& file) {
  const std::string content = read_file(file);
  const bool level5 = content.size() >= kHeader && content.compare(kVersionAt + 2, 2, "IM") == 0 &&
                      content[kVersionAt + 1] == 1;
  if (!level5) {
    throw InputError(fmt::format(
        "{} is no MATLAB file of level 5, or one of another byte order; save it with save -v7",
        file));
  }
  std::size_t at = kHeader;
  while (at < content.size()) {
    const bool whole =
        content.size() - at >= 8 && content.size() - at - 8 >= word_at(content, at + 4);
    if (!whole) {
      throw InputError(
          fmt::format("{}: the file ends within a variable; it is truncated: copy it again", file));
    }
    const std::uint32_t type = word_at(content, at);
    if (type != kCompressed && type != kMatrix)
      throw InputError(fmt::format(
          "{}: byte {} begins no variable; the file is damaged: save it again", file, at));
    at += 8 + word_at(content, at + 4);
  }
}

struct CloseFile {
  void operator()(mat_t* file) const { Mat_Close(file); }
};
struct FreeVariable {
  void operator()(matvar_t* variable) const { Mat_VarFree(variable); }
};

/// A real matrix of double precision.
Eigen::MatrixXd read_matrix(mat_t* mat, const std::string& file, const char* name) {
  const std::unique_ptr<matvar_t, FreeVariable> variable(Mat_VarRead(mat, name));
  if (variable == nullptr) {
    throw InputError(fmt::format(
        "{}: there is no variable {}; a local map has localmap_st (id, value) and localmap_P "
        "(covariance)",
        file, name));
  }
  if (variable->class_type != MAT_C_DOUBLE || variable->isComplex != 0 || variable->rank != 2 ||
      variable->data == nullptr) {
    throw InputError(
        fmt::format("{}: {} is no real matrix of double precision; save it as one", file, name));
  }
  const auto rows = static_cast<Eigen::Index>(variable->dims[0]);
  const auto columns = static_cast<Eigen::Index>(variable->dims[1]);
  if (variable->nbytes != sizeof(double) * variable->dims[0] * variable->dims[1])
    throw InputError(
        fmt::format("{}: {} is damaged: it does not hold its {} x {} numbers; save it "
                    "again",
                    file, name, rows, columns));
  const Eigen::MatrixXd matrix =
      Eigen::Map<const Eigen::MatrixXd>(static_cast<const double*>(variable->data), rows, columns);
  for (Eigen::Index j = 0; j < columns; ++j) {
    for (Eigen::Index i = 0; i < rows; ++i) {
      if (!std::isfinite(matrix(i, j)))
        throw InputError(fmt::format("{}: row {} column {} of {} is {}, not a finite number", file,
                                     i + 1, j + 1, name, matrix(i, j)));
    }
  }
  return matrix;
}

void read_state(const Eigen::MatrixXd& state, std::int64_t end_pose, RawMap& map) {
  if (state.cols() != 2 || state.rows() < 1) {
    throw InputError(fmt::format(
        "{}: localmap_st is {} x {}; it should have a row of id and value for each number of the "
        "state",
        map.file, state.rows(), state.cols()));
  }
  for (Eigen::Index k = 0; k < state.rows(); ++k) {
    const double id = state(k, 0);
    if (!(id >= 0.0 && id <= 9e15 && id == std::floor(id))) {
      throw InputError(
          fmt::format("{}: the id is {}; ids are 0 for the end pose, and whole positive "
                      "numbers for features",
                      map.where(k + 1), id));
    }
    map.add(id == 0.0 ? -end_pose : static_cast<std::int64_t>(id), state(k, 1), k + 1);
  }
}

void check_covariance(const Eigen::MatrixXd& P, const RawMap& map) {
  const auto n = static_cast<Eigen::Index>(map.state.size());
  if (P.rows() != n || P.cols() != n) {
    throw InputError(
        fmt::format("{}: localmap_P is {} x {}, but the state has {} numbers; save both "
                    "from the same map",
                    map.file, P.rows(), P.cols(), n));
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < i; ++j) {
      if (asymmetric(P, static_cast<int>(i), static_cast<int>(j)))
        throw InputError(fmt::format(
            "{}: localmap_P is not symmetric: row {} column {} is {}, but row {} column {} is {}",
            map.file, i + 1, j + 1, P(i, j), j + 1, i + 1, P(j, i)));
    }
  }
}

/// Sizes of what is isotropic of its own: positions, rotations.
std::vector<int> parts_of(const RawMap& map) {
  std::vector<int> out;
  for (const Run& run : map.runs) {
    const bool pose = run.id < 0;
    if (pose && run.length == 3) {
      out.insert(out.end(), {2, 1});
    } else if (pose && run.length == 6) {
      out.insert(out.end(), {3, 3});
    } else {
      out.push_back(run.length);
    }
  }
  return out;
}

/// P^-1, of a covariance matrix that the policy has made positive definite if it was not.
Eigen::MatrixXd inverse(Eigen::MatrixXd P, const RawMap& map, InformationPolicy policy,
                        std::int64_t& repaired) {
  P = symmetric_part(P);
  std::optional<Eigen::MatrixXd> out = inverse_of_definite(P);
  if (!out) {
    if (policy == InformationPolicy::kRefuse) {
      throw InputError(fmt::format(
          "{}: the covariance matrix localmap_P is not positive definite (smallest eigenvalue "
          "{:.6g}): correct it, or choose to clamp it or to take the isotropic equivalent",
          map.file, smallest_eigenvalue(P)));
    }
    if (policy == InformationPolicy::kClamp) {
      clamp_information(P);
    } else {
      make_information_isotropic(P, parts_of(map));
    }
    ++repaired;
    out = inverse_of_definite(P);
    if (!out)
      throw InputError(fmt::format("{}: localmap_P cannot be made positive definite", map.file));
  }
  return symmetric_part(*out);
}

}  // namespace

RawMap read_raw_matlab(const std::filesystem::path& path, std::int64_t number,
                       InformationPolicy indefinite, std::int64_t& repaired) {
  RawMap map;
  map.file = path.string();
  map.matlab = true;
  if (number < 1)
    throw InputError(
        fmt::format("{}: number MATLAB local maps from 1: map K starts at pose K - 1", map.file));
  map.reference = number - 1;
  check_complete(map.file);
  const std::unique_ptr<mat_t, CloseFile> mat(Mat_Open(map.file.c_str(), MAT_ACC_RDONLY));
  if (mat == nullptr)
    throw FileError(fmt::format("cannot read '{}': it is no MATLAB file", map.file));
  read_state(read_matrix(mat.get(), map.file, "localmap_st"), number, map);
  const Eigen::MatrixXd P = read_matrix(mat.get(), map.file, "localmap_P");
  check_covariance(P, map);
  map.information = inverse(P, map, indefinite, repaired);
  return map;
}

#endif

}  // namespace mapjoin::detail
