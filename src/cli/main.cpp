#include <fmt/format.h>

#include <cstdio>
#include <exception>
#include <new>

#include "mapjoin/cli/command.h"
#include "mapjoin/cli/commands.h"
#include "mapjoin/cli/terminal.h"
#include "mapjoin/graph/error.h"

namespace {

// What the program returns; also in the help below and in the README.
constexpr int kInternalError = 1;
constexpr int kBadInput = 2;
constexpr int kInterrupted = 130;  // as a shell has it: 128 + SIGINT

constexpr const char* kFooter =
    R"(Files: .g2o (measurement graphs, solutions), .map (native: a map with its information and its
measurements), .tum (trajectories), folders of localmap_K.txt (sets of local maps).

Exit codes: 0 done; 2 bad input or usage (the message says what to do; no output file is written);
130 stopped by Ctrl-C; 1 an error in mapjoin itself.

Try:
  mapjoin demo --output demo
  mapjoin simulate manhattan --poses 3500 --output world.g2o --truth truth.g2o
  mapjoin solve world.g2o --output map.g2o
  mapjoin evaluate map.g2o --graph world.g2o --reference truth.g2o
)";

int fail(int code, const std::string& message) {
  fmt::print(stderr, "{} {}\n", mapjoin::cli::red("mapjoin: error:"), message);
  return code;
}

int run(int argc, char** argv) {
  using namespace mapjoin::cli;
  try {
    return run_program(
        {"mapjoin",
         "mapjoin: SLAM by joining submaps with linear least squares. No initial guess, no tuning.",
         "mapjoin " MAPJOIN_VERSION, kFooter},
        {add_solve, add_build, add_join, add_reframe, add_marginalize, add_compare, add_covariance,
         add_evaluate, add_simulate, add_info, add_demo},
        argc, argv);
  } catch (const UsageError& error) {
    return fail(kBadInput, error.what());
  } catch (const mapjoin::CancelledError& error) {
    return fail(kInterrupted, error.what());
  } catch (const mapjoin::Error& error) {
    return fail(kBadInput, error.what());
  } catch (const std::bad_alloc&) {
    return fail(kInternalError, "out of memory; the data is too large for this machine");
  }
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& error) {
    return fail(kInternalError, fmt::format("internal: {}. Please report this.", error.what()));
  }
}
