// Writes MATLAB files of level 5, without matio: what readers are tested with.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace mapjoin::test {

inline void append_words(std::string& out, std::initializer_list<std::uint32_t> words) {
  for (const std::uint32_t w : words) out.append(reinterpret_cast<const char*>(&w), sizeof(w));
}

/// One variable: a real matrix of doubles.
inline std::string matlab_variable(const std::string& name, const Eigen::MatrixXd& matrix) {
  std::string body;
  append_words(body, {6, 8, 6, 0});  // array flags: double
  append_words(body, {5, 8, static_cast<std::uint32_t>(matrix.rows()),
                      static_cast<std::uint32_t>(matrix.cols())});
  append_words(body, {1, static_cast<std::uint32_t>(name.size())});
  body += name;
  while (body.size() % 8 != 0) body += '\0';
  const auto bytes =
      static_cast<std::uint32_t>(sizeof(double) * static_cast<std::size_t>(matrix.size()));
  append_words(body, {9, bytes});
  body.append(reinterpret_cast<const char*>(matrix.data()), bytes);
  std::string out;
  append_words(out, {14, static_cast<std::uint32_t>(body.size())});
  return out + body;
}

inline std::string matlab_file(
    const std::vector<std::pair<std::string, Eigen::MatrixXd>>& variables) {
  std::string out = "MATLAB 5.0 MAT-file";
  out.resize(124, ' ');
  out += '\0';
  out += '\1';
  out += "IM";
  for (const auto& [name, matrix] : variables) out += matlab_variable(name, matrix);
  return out;
}

}  // namespace mapjoin::test
