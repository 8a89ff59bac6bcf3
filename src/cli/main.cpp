#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <memory>
#include <new>

#include "mapjoin/cli/arguments.h"
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

int usage_error(const CLI::App& app, const CLI::ParseError& error) {
  std::string command = "mapjoin";
  for (const CLI::App* chosen : app.get_subcommands()) command += " " + chosen->get_name();
  return fail(kBadInput, fmt::format("{}\nSee '{} --help'.", error.what(), command));
}

int run(CLI::App& app, int argc, char** argv) {
  try {
    app.parse(argc, argv);
    return 0;
  } catch (const CLI::Success& asked) {  // help or version
    return app.exit(asked);
  } catch (const CLI::ParseError& error) {
    return usage_error(app, error);
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
    CLI::App app(
        "mapjoin: SLAM by joining submaps with linear least squares. No initial guess, no tuning.",
        "mapjoin");
    app.formatter(std::make_shared<mapjoin::cli::HelpFormatter>());
    app.set_version_flag("--version", "mapjoin " MAPJOIN_VERSION);
    app.require_subcommand(1);
    app.footer(kFooter);
    mapjoin::cli::add_solve(app);
    mapjoin::cli::add_build(app);
    mapjoin::cli::add_join(app);
    mapjoin::cli::add_reframe(app);
    mapjoin::cli::add_marginalize(app);
    mapjoin::cli::add_compare(app);
    mapjoin::cli::add_covariance(app);
    mapjoin::cli::add_evaluate(app);
    mapjoin::cli::add_simulate(app);
    mapjoin::cli::add_info(app);
    mapjoin::cli::add_demo(app);
    return run(app, argc, argv);
  } catch (const std::exception& error) {
    return fail(kInternalError, fmt::format("internal: {}. Please report this.", error.what()));
  }
}
