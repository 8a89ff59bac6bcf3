// A directory to run the program in, and what its runs are expected to do.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/program.h"

namespace mapjoin::test {

class Workbench : public ::testing::Test {
 protected:
  std::string file(const std::string& name) const { return directory_.file(name); }

  /// Writes a file (folders on the way are made) and returns its path.
  std::string write(const std::string& name, const std::string& content) const {
    const std::filesystem::path path = file(name);
    std::filesystem::create_directories(path.parent_path());
    std::ofstream(path, std::ios::binary) << content;
    return path.string();
  }

  /// Names of all files and folders there are.
  std::set<std::string> listing() const {
    std::set<std::string> names;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(directory_.path())) {
      names.insert(entry.path().string());
    }
    return names;
  }

  /// Runs the program, which must succeed. Returns what it printed.
  static std::string run(const std::vector<std::string>& arguments) {
    const ProgramRun run = run_program(arguments);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    EXPECT_EQ(run.err, "");
    return run.out;
  }

  /// Runs the program, which must refuse: exit code 2, a message that holds `message`, no file.
  void expect_refused(const std::vector<std::string>& arguments, const std::string& message) const {
    const std::set<std::string> before = listing();
    const ProgramRun run = run_program(arguments);
    EXPECT_EQ(run.exit_code, 2) << run.out << run.err;
    EXPECT_EQ(run.err.rfind("mapjoin: error: ", 0), 0U) << run.err;
    EXPECT_THAT(run.err, ::testing::HasSubstr(message));
    EXPECT_EQ(run.out, "");
    EXPECT_EQ(listing(), before) << "a refused run left files behind";
  }

  /// Makes a world with its truth: world.g2o, truth.g2o.
  std::string simulate(const std::string& world, int poses, const std::string& seed = "1") const {
    run({"simulate", world, "--poses", std::to_string(poses), "--seed", seed, "--output",
         file("world.g2o"), "--truth", file("truth.g2o")});
    return file("world.g2o");
  }

  /// The number after a name in what evaluate prints.
  static double figure(const std::string& text, const std::string& name) {
    std::istringstream words(text);
    std::string word;
    while (words >> word) {
      double value = 0.0;
      if (word == name && words >> value) return value;
    }
    ADD_FAILURE() << "no " << name << " in: " << text;
    return 0.0;
  }

 private:
  TemporaryDirectory directory_;
};

}  // namespace mapjoin::test
