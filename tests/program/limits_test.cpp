// Runs with less memory than they would like, and runs that are killed and taken up again.
#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include <chrono>
#include <random>
#include <thread>

#include "tests/program/workbench.h"

namespace mapjoin::test {
namespace {

using ::testing::HasSubstr;
using Clock = std::chrono::steady_clock;

class Limits : public Workbench {
 protected:
  /// Starts the program and kills it after `seconds`. \returns whether it had ended by itself.
  static bool run_for(double seconds, std::vector<std::string> arguments) {
    const char* chosen = std::getenv("MAPJOIN_PROGRAM");
    std::string program = chosen != nullptr ? chosen : kDefaultProgram;
    std::vector<char*> words{program.data()};
    for (std::string& argument : arguments) words.push_back(argument.data());
    words.push_back(nullptr);
    const pid_t child = fork();
    if (child == 0) {
      const int nowhere = open("/dev/null", O_RDWR);
      for (const int stream : {0, 1, 2}) dup2(nowhere, stream);
      execv(program.c_str(), words.data());
      _exit(127);
    }
    const auto end = Clock::now() + std::chrono::duration<double>(seconds);
    int status = 0;
    while (Clock::now() < end) {
      if (waitpid(child, &status, WNOHANG) == child) {
        EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
        return true;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    kill(child, SIGKILL);
    waitpid(child, &status, 0);
    return false;
  }

  static double number_in(const std::string& json, const std::string& name) {
    const std::string text = read_text(json);
    const std::size_t at = text.find('"' + name + "\":");
    EXPECT_NE(at, std::string::npos) << name << " in " << text;
    return at == std::string::npos ? 0.0 : std::stod(text.substr(at + name.size() + 3));
  }

  static std::size_t files_in(const std::string& folder) {
    std::error_code none;
    std::size_t count = 0;
    for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder, none))
      ++count;
    return count;
  }
};

TEST_F(Limits, ARunKilledTwentyTimesEndsWithTheSameBits) {
  const std::string world = simulate("sphere", 4000);
  const auto start = Clock::now();
  run({"solve", world, "--output", file("whole.g2o")});
  const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
  const std::string whole = read_text(file("whole.g2o"));

  const std::string folder = file("checkpoint");
  const std::vector<std::string> command{"solve", world,      "--checkpoint",
                                         folder,  "--output", file("out.g2o")};
  std::mt19937 random(3);
  std::uniform_real_distribution<double> moment(0.0, seconds);
  std::size_t most_files = 0;
  for (int kill = 0; kill < 20; ++kill) {
    if (run_for(moment(random), command)) {
      EXPECT_EQ(read_text(file("out.g2o")), whole);
      std::filesystem::remove(file("out.g2o"));
    } else if (std::filesystem::exists(file("out.g2o"))) {  // killed between that and its end
      EXPECT_EQ(read_text(file("out.g2o")), whole);
      std::filesystem::remove(file("out.g2o"));
    }
    most_files = std::max(most_files, files_in(folder));
  }
  EXPECT_GT(most_files, 0U);
  run(command);
  EXPECT_EQ(read_text(file("out.g2o")), whole);
  EXPECT_EQ(files_in(folder), 0U) << "the checkpoint outlives the result";
}

TEST_F(Limits, ACheckpointOfAnotherRunIsRefused) {
  const std::string folder = file("checkpoint");
  const std::string big = simulate("sphere", 4000);
  for (double seconds = 0.1; files_in(folder) == 0 && seconds < 60; seconds *= 1.3) {
    run_for(seconds, {"solve", big, "--checkpoint", folder, "--output", file("out.g2o")});
    std::filesystem::remove(file("out.g2o"));
  }
  ASSERT_GT(files_in(folder), 0U);
  const std::string other = simulate("sphere", 300, "2");
  expect_refused({"solve", other, "--checkpoint", folder, "--output", file("other.g2o")},
                 folder + " is the checkpoint of another run");
}

TEST_F(Limits, HalfTheMemoryGivesTheSameBits) {
  const std::string world = simulate("sphere", 20000);
  run({"solve", world, "--output", file("whole.g2o"), "--json", file("whole.json")});
  const double peak = number_in(file("whole.json"), "peak_memory_bytes");
  const auto limit = static_cast<std::int64_t>(peak / 2);
  for (const char* threads : {"1", "2"}) {
    run({"solve", world, "--threads", threads, "--memory-limit", std::to_string(limit), "--scratch",
         file(""), "--output", file("half.g2o"), "--json", file("half.json")});
    EXPECT_EQ(read_text(file("half.g2o")), read_text(file("whole.g2o")));
    EXPECT_LE(number_in(file("half.json"), "peak_memory_bytes"), 1.05 * static_cast<double>(limit));
  }
}

TEST_F(Limits, AMemoryLimitThatCannotBeHeldIsSaid) {
  const std::string world = simulate("manhattan", 3000);
  run({"solve", world, "--output", file("whole.g2o")});
  const std::string report =
      run({"solve", world, "--memory-limit", "1MB", "--output", file("little.g2o")});
  EXPECT_THAT(report, HasSubstr("memory limit of 1 MiB was too small"));
  EXPECT_EQ(read_text(file("little.g2o")), read_text(file("whole.g2o")));
}

TEST_F(Limits, AreRefusedWhereTheyMeanNothing) {
  const std::string world = simulate("manhattan", 50);
  for (const std::vector<std::string>& options :
       {std::vector<std::string>{"--checkpoint", file("c"), "--mode", "summary"},
        {"--checkpoint", file("c"), "--tree", "order"},
        {"--memory-limit", "1GB", "--mode", "paper"}}) {
    std::vector<std::string> command{"solve", world, "--output", file("out.g2o")};
    command.insert(command.end(), options.begin(), options.end());
    expect_refused(command, "leave");
  }
}

TEST_F(Limits, AMemoryLimitWithoutItsUnitIsAskedAbout) {
  const std::string world = simulate("manhattan", 50);
  expect_refused({"solve", world, "--memory-limit", "13000", "--output", file("out.g2o")},
                 "did you mean 13000MB?");
  run({"solve", world, "--memory-limit", "0", "--output", file("out.g2o")});  // none
}

}  // namespace
}  // namespace mapjoin::test
