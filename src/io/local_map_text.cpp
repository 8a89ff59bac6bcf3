#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "mapjoin/graph/error.h"
#include "mapjoin/io/local_map_raw.h"
#include "mapjoin/io/read_file.h"
#include "mapjoin/io/text_scanner.h"

namespace mapjoin::detail {

namespace {

void next_line(TextScanner& scan, const std::string& what) {
  if (scan.next_line()) return;
  throw InputError(fmt::format("{}: the file ends before {}; it is truncated: write it again",
                               scan.where(), what));
}

void read_state(TextScanner& scan, RawMap& map, int n) {
  map.state.reserve(static_cast<std::size_t>(n));
  for (int k = 0; k < n; ++k) {
    next_line(scan, fmt::format("number {} of the {} of the state", k + 1, n));
    scan.expect("id value");
    const std::int64_t id = scan.integer("the id");
    const double value = scan.number("the value");
    scan.expect_end_of_line("the value");
    map.add(id, value, scan.line());
  }
}

void check_symmetry(const TextScanner& scan, const RawMap& map, int row) {
  const Eigen::MatrixXd& I = map.information;
  for (int j = 0; j < row; ++j) {
    if (!asymmetric(I, row, j)) continue;
    throw InputError(fmt::format(
        "{}: the information matrix is not symmetric: row {} column {} is {}, but row {} column {} "
        "is {}; write both the same",
        scan.where(), row + 1, j + 1, I(row, j), j + 1, row + 1, I(j, row)));
  }
}

void read_information(TextScanner& scan, RawMap& map, int n) {
  map.information.resize(n, n);
  for (int i = 0; i < n; ++i) {
    next_line(scan, fmt::format("row {} of the {} of the information matrix", i + 1, n));
    if (i == 0) map.matrix_line = scan.line();
    for (int j = 0; j < n; ++j) map.information(i, j) = scan.number("the information matrix's row");
    scan.expect_end_of_line("a row of the information matrix");
    check_symmetry(scan, map, i);
    for (int j = 0; j < i; ++j) {
      map.information(i, j) = map.information(j, i) =
          0.5 * (map.information(i, j) + map.information(j, i));
    }
  }
}

}  // namespace

std::string RawMap::where(std::int64_t line) const {
  return matlab ? fmt::format("{}: row {} of localmap_st", file, line)
                : fmt::format("{}:{}", file, line);
}

void RawMap::add(std::int64_t id, double value, std::int64_t line) {
  if (runs.empty() || runs.back().id != id)
    runs.push_back({id, static_cast<int>(state.size()), 0, line});
  ++runs.back().length;
  state.push_back(value);
}

bool asymmetric(const Eigen::MatrixXd& matrix, int i, int j) {
  const double difference = std::abs(matrix(i, j) - matrix(j, i));
  if (difference == 0.0) return false;
  const double scale = std::max({std::abs(matrix(i, j)), std::abs(matrix(j, i)),
                                 std::sqrt(std::abs(matrix(i, i) * matrix(j, j)))});
  return !(difference <= kAsymmetry * scale);
}

RawMap read_raw_text(const std::filesystem::path& path) {
  const std::string text = read_file(path);
  RawMap map;
  map.file = path.string();
  TextScanner scan(map.file, text);
  next_line(scan, "the id of the reference pose");
  scan.expect("the id of the reference pose, alone");
  map.reference = std::abs(scan.integer("the id of the reference pose"));
  scan.expect_end_of_line("the id of the reference pose");
  next_line(scan, "the dimension of the state");
  scan.expect("the dimension of the state, alone");
  const std::int64_t n = scan.integer("the dimension of the state");
  scan.expect_end_of_line("the dimension of the state");
  // A state and its matrix take at least two bytes a number: a larger n is a lie that must not be
  // allocated.
  if (n < 1 || n > static_cast<std::int64_t>(text.size()) ||
      n * n > static_cast<std::int64_t>(text.size())) {
    scan.fail(fmt::format("a state of dimension {} is not in this file", n),
              "correct the dimension, or write the file again");
  }
  read_state(scan, map, static_cast<int>(n));
  read_information(scan, map, static_cast<int>(n));
  if (scan.next_line())
    scan.fail("the file goes on after the information matrix", "remove what is too much");
  return map;
}

}  // namespace mapjoin::detail
