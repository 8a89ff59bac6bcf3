// Runs the program mapjoin the way a user does, and returns what it said.
#pragma once

#include <sys/wait.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/support/config.h"

namespace mapjoin::test {

/// A directory of its own for one test, removed with all its contents at the end.
class TemporaryDirectory {
 public:
  TemporaryDirectory() {
    std::string name = (std::filesystem::temp_directory_path() / "mapjoin_test_XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("cannot create " + name);
    path_ = name;
  }
  ~TemporaryDirectory() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryDirectory(const TemporaryDirectory&) = delete;
  TemporaryDirectory& operator=(const TemporaryDirectory&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::string file(const std::string& name) const { return (path_ / name).string(); }

 private:
  std::filesystem::path path_;
};

inline std::string read_text(const std::filesystem::path& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

/// What one run of the program left behind.
struct ProgramRun {
  int exit_code = -1;  ///< 128 + the signal's number if a signal ended it
  std::string out;     ///< standard output
  std::string err;     ///< standard error
};

/// One argument, so quoted that the shell takes it literally.
inline std::string shell_quoted(const std::string& argument) {
  std::string quoted = "'";
  for (const char c : argument) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

/// Runs `mapjoin <arguments>` with nothing on standard input.
inline ProgramRun run_program(const std::vector<std::string>& arguments) {
  const TemporaryDirectory scratch;
  const char* chosen = std::getenv("MAPJOIN_PROGRAM");
  std::string command = shell_quoted(chosen != nullptr ? chosen : kDefaultProgram);
  for (const std::string& argument : arguments) command += " " + shell_quoted(argument);
  command += " </dev/null >" + shell_quoted(scratch.file("out"));
  command += " 2>" + shell_quoted(scratch.file("err"));

  const int status = std::system(command.c_str());
  ProgramRun run;
  run.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  run.out = read_text(scratch.file("out"));
  run.err = read_text(scratch.file("err"));
  return run;
}

}  // namespace mapjoin::test
