#pragma once

#include <CLI/CLI.hpp>

namespace mapjoin::cli {

// Each adds a subcommand, which runs when the command line names it.
void add_build(CLI::App& app);
void add_solve(CLI::App& app);
void add_join(CLI::App& app);
void add_reframe(CLI::App& app);
void add_marginalize(CLI::App& app);
void add_compare(CLI::App& app);
void add_covariance(CLI::App& app);
void add_evaluate(CLI::App& app);
void add_simulate(CLI::App& app);
void add_info(CLI::App& app);
void add_demo(CLI::App& app);

}  // namespace mapjoin::cli
