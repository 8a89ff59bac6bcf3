#include "tests/program/workbench.h"

namespace mapjoin::test {
namespace {

using ::testing::HasSubstr;

class Help : public Workbench {};

const char* const kCommands[] = {"solve",    "join",     "reframe", "marginalize", "covariance",
                                 "evaluate", "simulate", "info",    "demo",        "compare"};

TEST_F(Help, OfTheProgramNamesAllCommandsAndExitCodes) {
  const std::string help = run({"--help"});
  for (const char* command : kCommands) EXPECT_THAT(help, HasSubstr(command));
  EXPECT_THAT(help, HasSubstr("Exit codes"));
}

TEST_F(Help, OfEachCommandHasAnExampleAndFitsATerminal) {
  for (const char* command : kCommands) {
    const std::string help = run({command, "--help"});
    EXPECT_THAT(help, HasSubstr(std::string("mapjoin ") + command)) << command;
    EXPECT_THAT(help, HasSubstr("Example")) << command;
    std::istringstream lines(help);
    for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 100U) << line;
  }
}

TEST_F(Help, ExplainsTheModes) {
  for (const char* command : {"solve", "join"}) {
    const std::string help = run({command, "--help"});
    for (const char* mode : {"optimal", "observe", "summary", "paper"}) {
      EXPECT_THAT(help, HasSubstr(std::string("  ") + mode + "  ")) << command;
    }
  }
}

TEST_F(Help, TellsTheVersion) { EXPECT_THAT(run({"--version"}), HasSubstr("mapjoin ")); }

TEST_F(Help, IsOfferedWhenTheUsageIsWrong) {
  expect_refused({}, "mapjoin --help");
  expect_refused({"slove"}, "mapjoin --help");
  expect_refused({"solve"}, "mapjoin solve --help");
  expect_refused({"solve", "a.g2o", "--output", "b.g2o", "--mode", "best"}, "mapjoin solve --help");
  expect_refused({"solve", "a.g2o", "--output", "b.g2o", "--frobnicate"}, "frobnicate");
  expect_refused({"solve", "a.g2o", "--output", "b.g2o", "--threads", "-3"}, "--threads");
}

TEST_F(Help, HasNoColourInAFile) {
  EXPECT_EQ(run({"--help"}).find('\033'), std::string::npos);
  EXPECT_EQ(run_program({"solve"}).err.find('\033'), std::string::npos);
}

}  // namespace
}  // namespace mapjoin::test
